"""What the post says in English is in the catalogue of phrases, each with the same parameters."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from importlib.resources import files
from types import MappingProxyType

import pytest

from command_post.alert_desk import AlertDesk, Known
from command_post.box_words import box_words
from command_post.roster import _ACTIVITIES, _DOUBTFUL
from command_post.supplies import air_words, why_silent
from command_post.teams import Left
from command_post.told import why_nowhere
from edge_agent.agent import NOT_KEPT
from edge_agent.alarms import AlarmWatch
from shared.codec import Refusal, decode, parse_key
from shared.mcap_reader import read_recording
from shared.messages import (
    Alarm,
    Beat,
    DapInstallation,
    DapState,
    ImuSample,
    Mayday,
    NodeHealth,
    OutsideWord,
    Supplies,
    TrackEstimate,
)
from shared.strangers import LINK_WORDS, WORDS, AtLinks, Strangers
from tests.replay.renew_recordings import RECORDINGS

PHRASES: dict[str, dict[str, str]] = json.loads(
    (files("command_post.web") / "static" / "phrases.json").read_text(encoding="utf-8")
)
PARAMETER = re.compile(r"\{(\w+)\}")


def reads(text: str) -> bool:
    """Say whether the page can say it in another language, by the page's own rules."""
    for phrase in PHRASES.values():
        pieces = PARAMETER.split(phrase["en"])
        pattern = "".join(
            "(.+?)" if number % 2 else re.escape(piece) for number, piece in enumerate(pieces)
        )
        if re.fullmatch(pattern, text):
            return True
    parts = next((text.split(each) for each in ("; ", ", ") if each in text), [text])
    return len(parts) > 1 and all(map(reads, parts))


@pytest.mark.parametrize("code", PHRASES)
def test_a_phrase_has_the_same_parameters_in_each_language(code: str) -> None:
    english, korean = PHRASES[code]["en"], PHRASES[code]["ko"]
    assert sorted(PARAMETER.findall(english)) == sorted(PARAMETER.findall(korean))
    assert re.search("[가-힣]|^[^a-z]*$", PARAMETER.sub("", korean)), korean


def test_no_two_phrases_are_alike() -> None:
    english = [phrase["en"] for phrase in PHRASES.values()]
    assert len(set(english)) == len(english)


def alerted() -> Iterator[str]:
    """Yield the words of all kinds of alerts."""
    desk, node, dap = AlertDesk(0), ("responder", "r1"), ("dap", "dap1")
    common = {"event_time_ns": 5, "sequence": 0}
    for kind in ("motionless", "fall"):
        for phase in ("pre_alarm", "alarm"):
            said = Alarm(**common, kind=kind, phase=phase, confidence=1.0, reason="the boot moves")
            yield from (alert.words for alert in desk.hear(node, said, 5))  # type: ignore[arg-type]
    mayday = Mayday(**common, phase="called", called_ns=5, reason="the button was held")
    beat = Beat(
        **common, run="0" * 16, last_number=0, kept_from=0, acknowledged=0,  # type: ignore[arg-type]
        supplies=Supplies(battery=0.05, air_bar=20.0, air_left_s=60.0),
    )  # fmt: skip
    changed = [*desk.hear(node, mayday, 5), *desk.hear(node, beat, 5), *desk.hear(dap, beat, 5)]  # type: ignore[arg-type]
    changed += desk.pass_time(60 * 10**9)
    changed += desk.hear(node, beat, 70 * 10**9)  # type: ignore[arg-type]
    changed += desk.leave([Left("r1", "48 m from r3, the nearest of team alpha")], 5)
    changed += desk.leave([Left("r1", None)], 5)
    changed += desk.doubt([Known("moved", "dap", "dap1", "strides too long or too short")], 5)
    changed += desk.doubt([], 6)
    for kind in ("mayday", "cancel"):
        word = OutsideWord(**common, kind=kind, uid="u", callsign="E5", words="help", position=None)  # type: ignore[arg-type]
        changed += desk.hear_outside(word, 5)
    yield from (alert.words for alert in changed)


def boxes() -> Iterator[str]:
    """Yield what is said of DAPs' boxes, and of where they are."""
    for going in (None, "switched off", "failed: no radio"):
        for share, hot_c in ((0.1, 90.0), (0.9, 20.0), (None, None)):
            state = DapState(
                event_time_ns=0, sequence=0, battery_share=share, temperature_c=hot_c, going=going
            )
            for silent_ns in (0, 10**12):
                yield from box_words(state, silent_ns)
    for at_rest in (False, True):
        yield (
            why_nowhere(
                DapInstallation(
                    event_time_ns=0, sequence=0, installer_id=None, position=None, at_rest=at_rest
                )
            )
            or ""
        )
    for told in (None, Supplies(battery=0.01), Supplies(temperature_c=99.0)):
        yield f"nothing heard for 10 s: {why_silent('dap', told)}"
    yield air_words(Supplies(air_bar=20.0, air_left_s=60.0))


def strangers() -> Iterator[str]:
    """Yield what is said of strangers."""
    at_links = AtLinks(
        dict.fromkeys(LINK_WORDS, 1), {("r1", "r2"): 1, ("r1", ""): 1, ("", "r2"): 1}
    )
    turned = MappingProxyType({(why, "r1"): 1 for why in WORDS})
    yield from (noticed.words for noticed in Strangers().noticed(at_links, turned))
    yield from (f"12 messages {how} were not let in" for how in _DOUBTFUL.values())


def alarms() -> Iterator[str]:
    """Yield what an agent says of a boot that lies still and moves again."""
    watch = AlarmWatch()
    for number in range(400):
        rate = 1.0 if number > 350 else 0.0
        sample = ImuSample(number * 100_000_000, (0.0, 0.0, -9.8), (rate, 0.0, 0.0))
        yield from (event.reason for event in watch.take_sample(sample))
    yield NOT_KEPT


def recorded() -> Iterator[str]:
    """Yield the reasons and findings that stand in the project's recordings."""
    for path in sorted(RECORDINGS.glob("*.mcap")):
        for each in read_recording(path):
            key = parse_key(each.key)
            if isinstance(key, Refusal) or key.topic not in ("track", "health"):
                continue
            match decode(key, each.payload):
                case TrackEstimate(reason=reason) if reason:
                    yield reason
                case NodeHealth(level=level, findings=findings) if level != "ok":
                    yield from findings


def test_all_that_is_said_can_be_said_in_another_language() -> None:
    said = {*alerted(), *boxes(), *strangers(), *alarms(), *recorded(), *_ACTIVITIES.values()}
    assert {each for each in said if not reads(each)} == set()
    assert len(said) > 40
