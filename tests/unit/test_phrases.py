"""What the post says in English is in the catalogue of phrases, each with the same parameters."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import get_args

import pytest

from command_post.coverage import Coverage
from command_post.desks import orders
from command_post.desks.alert_desk import AlertDesk, Known
from command_post.nodes.box_words import box_words
from command_post.nodes.supplies import air_words, why_silent
from command_post.nodes.teams import Left
from command_post.nodes.told import Told, why_nowhere
from command_post.review.past import _Placed
from command_post.roster import _ACTIVITIES, _DOUBTFUL, DapStatus, ResponderStatus
from command_post.ways import Turn
from command_post.web import app
from edge_agent.agent import NOT_KEPT
from edge_agent.alarms import AlarmWatch
from shared.codec import Refusal, decode, parse_key
from shared.mcap_reader import read_recording
from shared.messages import (
    Alarm,
    AlertKind,
    AlertStage,
    Beat,
    DapInstallation,
    DapState,
    ImuSample,
    LocalPosition,
    Mayday,
    NeighbourHeard,
    NodeHealth,
    OrderKind,
    OutsideWord,
    Supplies,
    TrackEstimate,
    TrackStatus,
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
    yield from dead_boxes()
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


def dead_boxes() -> Iterator[str]:
    """Yield what is said of a DAP that has fallen silent, by what others hear of it."""
    box = DapState(
        event_time_ns=0, sequence=0, battery_share=None, temperature_c=None, going=None,
        worry="ble:hci0 is gone",
    )  # fmt: skip
    near = NeighbourHeard(
        event_time_ns=0, sequence=0, dap_id="d1", rssi_mean_dbm=-70.0, rssi_variance_db2=1.0,
        sample_count=9,
    )  # fmt: skip
    up = DapInstallation(event_time_ns=0, sequence=0, installer_id=None, position=None)
    for later_s in (1, 50):
        told = Told()
        for message in (box, up):
            told.take("dap", "d1", message, 0)
        told.take("dap", "d2", near, later_s * 10**9)
        told.take("dap", "d2", box, 60 * 10**9)
        yield from told.of_box("d1", 60 * 10**9, 60 * 10**9)


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


def refusals() -> Iterator[str]:
    """Yield what the page and the orders refuse with, a word in the place of each value."""
    rooms = [*Path(app.__file__).parent.glob("*.py"), Path(orders.__file__)]
    for called in (node for room in rooms for node in ast.walk(ast.parse(room.read_text()))):
        match called:
            case ast.Call(func=ast.Name("RefusedError"), args=[_, words]):
                yield from _written(words)
            case ast.Assign(targets=[ast.Name("why")], value=words) | ast.Return(value=words):
                yield from _written(words)


def _written(words: ast.expr | None) -> Iterator[str]:
    match words:
        case ast.Constant(value=str(text)) if " " in text:
            yield text
        case ast.JoinedStr(values=parts):
            told = "".join(
                str(each.value) if isinstance(each, ast.Constant) else "x" for each in parts
            )
            if " " in told:
                yield told


def past() -> Iterator[str]:
    """Yield what a time line and advice say."""
    yield from ("the post was not at work", "nothing was received", "to: everybody", "to: r1, r2")
    coverage = Coverage()
    for name in ("r1", "r2"):
        coverage.take(_Placed(name, 0.0, 0.0, 0.0, (9.0, 0.0, 9.0)))
    beside = LocalPosition(north_m=0.0, east_m=20.0, down_m=0.0, covariance_m2=(1.0, 0.0, 1.0))
    yield from (site.reason for daps in ([], [beside]) for site in coverage.sites(daps))


def _names(literal: object) -> Iterator[str]:
    for each in get_args(literal):
        yield from (each,) if isinstance(each, str) else _names(each)


def test_the_words_of_the_page_are_there_in_both_languages() -> None:
    static = files("command_post.web") / "static"
    written = (static / "words.js").read_text(encoding="utf-8")
    of = {}
    for language in ("en", "ko"):
        block = written.partition(f"  {language}: {{")[2].partition("\n  },")[0]
        of[language] = dict(re.findall(r'(\w+): "([^"]*)"', block))
    english, korean = of["en"], of["ko"]
    assert english.keys() == korean.keys()
    foreign = {name for name, text in korean.items() if not re.search("[가-힣]", text)}
    assert foreign == {"units", "language", "off_p95"}
    for name, text in english.items():
        assert sorted(PARAMETER.findall(text)) == sorted(PARAMETER.findall(korean[name]))
    page = (static / "index.html").read_text(encoding="utf-8")
    scripts = [
        each.read_text(encoding="utf-8") for each in static.iterdir() if each.name.endswith(".js")
    ]
    used = re.findall(r'data-(?:word|label)="(\w+)"', page)
    used += re.findall(r'\b(?:word|counted)\("(\w+)"', "".join(scripts))
    assert set(used) <= english.keys()
    told = (AlertKind, OrderKind, TrackStatus, Turn, ResponderStatus, DapStatus, AlertStage)
    kinds = {name for each in told for name in _names(each)}
    assert kinds <= english.keys(), "what is said by a word of its own"


def test_all_that_is_said_can_be_said_in_another_language() -> None:
    said = {*alerted(), *boxes(), *strangers(), *alarms(), *recorded(), *_ACTIVITIES.values()}
    said |= {*refusals(), *past()}
    assert {each for each in said if not reads(each)} == set()
    assert len(said) > 40
