"""Whatever fails of taking an incident up, the next best way is taken, and a post begins."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from command_post.desks.announcer import Outgoing
from command_post.incident import Incident
from command_post.recorder.file import RecordingFile
from command_post.recorder.recording import RecordedIncident
from command_post.resuming import taking_up
from command_post.resuming.beside import BEGINNING, Place
from command_post.resuming.checkpoint import Kept, State
from command_post.resuming.gist import Gist
from command_post.resuming.taking_up import TakenUp, TakingUp
from shared.codec import encode
from shared.gate import Gate
from shared.gate_notes import noted
from shared.mcap_reader import Recording, read_recording
from shared.messages import Mayday, OrderRequest
from shared.seal import sealed
from shared.units import NS_PER_S
from tests.unit.test_post import NOW_NS, SETTINGS, key, start, stride

RUN = b"\x01" * 8
WALKED = 12


def recorded(folder: Path) -> Recording:
    """Return what two responders did, and a commander ordered, until a post was killed."""
    file = RecordingFile(folder / "a.mcap", {})
    incident = RecordedIncident(Incident(SETTINGS), file)
    mayday = Mayday(
        event_time_ns=NOW_NS, sequence=1, phase="called", called_ns=NOW_NS, reason="by hand"
    )
    back = OrderRequest(event_time_ns=NOW_NS, sequence=0, kind="evacuate", to=(), text="")
    heard = [(key("start", node=name), start()) for name in ("r1", "r2")]
    heard += [(key("mayday", node="r2"), encode(mayday))]
    heard += [(key("order_request", "post", "c"), encode(back))]
    for number in range(WALKED):
        heard += [(key("increment", node=name), stride(number)) for name in ("r1", "r2")]
    for number, (key_text, payload) in enumerate(heard, 1):
        now_ns = NOW_NS + number * NS_PER_S // 2
        incident.handle(key_text, sealed(payload, RUN, number), now_ns)
    file.sync()
    file.abandon()
    return read_recording(file.part)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return recorded(tmp_path_factory.mktemp("killed"))


@pytest.fixture
def gist(recording: Recording) -> Gist:
    gist = Gist()
    gist.read(recording)
    return gist


def failing(*_: object, **__: object) -> None:
    raise ZeroDivisionError("nobody thought of that")


class FailingIncident(Incident):
    """As of a state that can be loaded, and no more."""

    def handle(self, key: str, payload: bytes, now_ns: int) -> list[Outgoing]:  # noqa: ARG002
        """Fail."""
        raise MemoryError


def kept(incident: Incident) -> Kept:
    return Kept(State(incident, Gate().remembered(), None, 7), BEGINNING)


def taken_up(recording: Recording, gist: Gist, states: Iterator[Kept] | None = None) -> TakenUp:
    begin = partial(Incident, SETTINGS)
    return TakingUp(recording, gist, states or iter(()), begin).take_up(
        lambda *_: None, lambda _: None
    )


def assert_all_is_known(taken: TakenUp, recording: Recording) -> None:
    whole = Incident(SETTINGS)
    for each in recording:
        if not each.outgoing:
            whole.handle(each.key, each.payload, each.log_time_ns)
    assert taken.incident.estimates == whole.estimates
    assert set(whole.estimates) == {"r1", "r2"}


def test_of_two_states_that_fail_a_third_serves(
    recording: Recording, gist: Gist, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = Place(recording.parts[0].path.stat().st_size, 1)
    bad = [kept(FailingIncident(SETTINGS)) for _ in range(2)]
    good = Incident(SETTINGS)
    taken = taken_up(recording, gist, iter([*bad, kept(good)]))
    assert taken.incident is good
    assert_all_is_known(taken, recording)
    assert capsys.readouterr().out.count("it is tried otherwise") == 2
    # Where nothing was recorded since, it is as late as the state says.
    at_the_end = kept(Incident(SETTINGS))._replace(place=whole)
    assert taken_up(recording, gist, iter([at_the_end])).last_ns == 7


def test_where_no_state_serves_it_goes_on_from_what_was_told_or_from_all(
    recording: Recording, gist: Gist, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr(taking_up, "SOON_HANDLED", 10)
    assert taken_up(recording, gist, iter([kept(FailingIncident(SETTINGS))])).begun_from == (
        "last_told"
    )
    monkeypatch.setattr(Incident, "begin_from", failing)
    taken = taken_up(recording, gist)
    assert (taken.begun_from, taken.words) == ("all", None)
    assert_all_is_known(taken, recording)
    assert noted(taken.remembered) == noted(gist.remembered())
    assert "nobody thought of that" in capsys.readouterr().out


def test_where_nothing_serves_it_begins_and_what_stands_still_stands(
    recording: Recording, gist: Gist, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr(taking_up, "resume", failing)
    taken = taken_up(recording, gist)
    assert taken.begun_from == "nothing"
    assert taken.words is not None
    assert "could not go on" in taken.words
    assert "by=what is rare" not in (said := capsys.readouterr().out)
    assert "all that is recorded" in said
    incident = taken.incident
    assert [alert.kind for alert in incident.alerts.values()] == ["mayday"]
    assert incident.orders.of("r1")
    assert noted(taken.remembered) == noted(gist.remembered())
    # Who walks on is seen from their next stride.
    now_ns = taken.last_ns + NS_PER_S
    for number in range(WALKED, WALKED + 6):
        incident.handle(key("increment"), stride(number), now_ns + number * NS_PER_S)
    assert "r1" in incident.estimates
    monkeypatch.setattr(Gist, "last_told", failing)
    taken = taken_up(recording, gist)
    assert (taken.begun_from, taken.remembered.journals) == ("nothing", {})
