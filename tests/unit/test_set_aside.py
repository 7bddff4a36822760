"""A fault of the post's own stops nobody: what it is met with is put aside, counted and told."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from command_post.desks.announcer import Outgoing
from command_post.desks.command_desk import CommandDesk
from command_post.fusion.mishaps import Mishaps
from command_post.fusion.settings import FusionSettings
from command_post.fusion.team import assembly, culprits, solving
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.team_tracker import TeamTracker
from command_post.going_on import GoingOn, Guests
from command_post.incident import Incident, IncidentSettings
from command_post.nodes.senders import Senders
from command_post.recorder.parts import RecordingSet
from command_post.recorder.recorded import Outgoing as Made
from command_post.recorder.recording import RecordedIncident
from command_post.replay import replay
from command_post.roster import Roster
from shared.codec import encode
from shared.messages import Alert, LocalPosition, Mayday, PositionFix
from shared.topics import Key
from shared.units import NS_PER_S
from tests.benchmarks.crowd import START_NS, Said, crowd
from tests.benchmarks.test_team_speed import role_of, topic_of
from tests.unit.test_incident import decoded

TEAM = TeamSettings(commit_s=10.0)
SETTINGS = IncidentSettings(fusion=FusionSettings(team=TEAM))
POISON_NS = START_NS + 24 * NS_PER_S
FAR = LocalPosition(north_m=50.0, east_m=9.0, down_m=0.0, covariance_m2=(0.1, 0.0, 0.1))


def poison(time_ns: int = POISON_NS) -> PositionFix:
    return PositionFix(
        event_time_ns=time_ns, sequence=0, responder_id="r0-0", source="commander", position=FAR
    )


def with_poison(said: list[Said]) -> list[Said]:
    return sorted([*said, Said("r0-0", poison())], key=lambda each: each.message.event_time_ns)


def told(incident: Incident | RecordedIncident, said: list[Said]) -> list[Made]:
    made: list[Made] = []
    for node_id, message in said:
        key = Key("exercise", role_of(message), node_id, topic_of(message))
        now_ns = message.event_time_ns + NS_PER_S // 50
        made += incident.handle(str(key), encode(message), now_ns)
    return made


@pytest.fixture(scope="module")
def said() -> list[Said]:
    return list(crowd([2], 0, 1.2, 1.0, seed=4))


def failing_of_the_fix(*arguments: Any, **_: Any) -> None:
    raise ZeroDivisionError("of the fix")


def unable_to_assemble(make: Callable[..., Any]) -> Callable[..., Any]:
    """Return a way of assembling equations that fails with the poisonous word in the log."""

    def assemble(log: TeamLog, until_ns: int, *rest: Any) -> Any:
        for own in log.responders.values():
            if any(fix.time_ns == POISON_NS <= until_ns for fix in own.fixes):
                raise FloatingPointError("nobody thought of that")
        return make(log, until_ns, *rest)

    return assemble


def test_a_message_that_cannot_be_fused_is_put_aside_and_named(
    said: list[Said], monkeypatch: pytest.MonkeyPatch
) -> None:
    without = Incident(SETTINGS)
    monkeypatch.setattr(TeamTracker, "fix", failing_of_the_fix)
    incident = Incident(SETTINGS)
    made = told(incident, with_poison(said))
    assert made == told(without, said)
    assert incident.refusals == {("failed_ZeroDivisionError", "r0-0"): 1}
    assert incident.refused == 0
    now_ns = said[-1].message.event_time_ns
    (words,) = incident.faults("responder", "r0-0", now_ns)
    assert "fix, fusing it: ZeroDivisionError" in words
    (notice,) = (each for each in incident.take_notices() if each.trace)
    assert "failing_of_the_fix" in notice.trace
    assert incident.faults("responder", "r0-0", now_ns + 3600 * NS_PER_S) == []


def test_a_replay_and_a_state_taken_up_put_the_same_aside(
    said: list[Said], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(solving, "assemble", unable_to_assemble(assembly.assemble))
    path = tmp_path / "a.mcap"
    file = RecordingSet(path, SETTINGS.as_metadata())
    recorded = RecordedIncident(Incident(SETTINGS), file)
    made = told(recorded, with_poison(said))
    made += recorded.finish(START_NS + 90 * NS_PER_S)
    file.finish()
    report = replay(path, Incident(SETTINGS))
    assert report.identical, report
    assert report.equal == len(made)
    taken_up, heard = Incident(SETTINGS), with_poison(said)
    for number, each in enumerate(heard):
        told(taken_up, [each])
        if not number % 40:
            taken_up = pickle.loads(pickle.dumps(taken_up))  # noqa: S301
    assert taken_up.refusals[("failed_Unsolvable", "r0-0")] == 1


def test_of_what_a_commit_fails_that_alone_is_taken_out(
    said: list[Said], monkeypatch: pytest.MonkeyPatch
) -> None:
    without, incident = Incident(SETTINGS), Incident(SETTINGS)
    expected = told(without, said)
    monkeypatch.setattr(solving, "assemble", unable_to_assemble(assembly.assemble))
    made = told(incident, with_poison(said))
    assert made[-20:] == expected[-20:]
    assert incident.estimates == without.estimates
    (named,) = (each for each in incident.take_notices() if each.reason == "failed_Unsolvable")
    assert (named.node_id, named.detail) == (
        "r0-0",
        "where they are: nobody could be solved with it",
    )
    assert "put aside" in incident.faults("responder", "r0-0", said[-1].message.event_time_ns)[0]


def test_what_fails_whatever_is_left_out_leaves_the_log_as_it_was(
    said: list[Said], monkeypatch: pytest.MonkeyPatch
) -> None:
    incident, tries = Incident(SETTINGS), list[int]()
    told(incident, said[:60])

    def failing(_: TeamLog, until_ns: int, *__: Any) -> None:
        tries.append(until_ns)
        raise FloatingPointError("always")

    monkeypatch.setattr(solving, "assemble", failing)
    assert len(told(incident, said[60:])) > 50
    tracker = incident._tracker
    assert isinstance(tracker, TeamTracker)
    assert sum(len(own.moves) for own in tracker._log.responders.values()) > 100
    assert incident.remarks(said[-1].message.event_time_ns)
    # A tick each two seconds and a commit each ten, and nothing was searched through.
    assert len(tries) < 60


def test_several_at_once_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    log = TeamLog()
    for time_ns in range(10):
        log.add_fix(poison(time_ns))

    def make(until_ns: int) -> int:
        bad = {fix.time_ns for fix in log.of("r0-0").fixes} & {3, 7}
        if any(time_ns <= until_ns for time_ns in bad):
            raise ValueError
        return until_ns

    assert culprits.made_without(make, log, log, 4, 9) is None
    assert len(log.of("r0-0").fixes) == 10
    made = culprits.made_without(make, log, log, -1, 9)
    assert made is not None
    assert made[0] == 9
    assert [fix.time_ns for fix in log.of("r0-0").fixes] == [0, 1, 2, 4, 5, 6, 8, 9]
    assert [each.node_id for each in made[1]] == ["r0-0", "r0-0"]


def test_a_mayday_is_heard_though_its_sender_cannot_be_dated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Senders, "hear", failing_of_the_fix)
    incident = Incident(SETTINGS)
    mayday = Mayday(
        event_time_ns=START_NS, sequence=0, phase="called", called_ns=START_NS, reason="by hand",
    )  # fmt: skip
    made = told(incident, [Said("r0-0", mayday)])
    assert any(isinstance(decoded(each), Alert) for each in made if isinstance(each, Outgoing))
    assert incident.refusals == {("failed_ZeroDivisionError", "r0-0"): 1}


@pytest.mark.parametrize("stopping", [KeyboardInterrupt, MemoryError, SystemExit])
def test_what_is_no_fault_of_ours_goes_on_upwards(
    stopping: type[BaseException], monkeypatch: pytest.MonkeyPatch, said: list[Said]
) -> None:
    def stop(*_: Any, **__: Any) -> None:
        raise stopping

    monkeypatch.setattr(CommandDesk, "hear", stop)
    with pytest.raises(stopping):
        told(Incident(SETTINGS), said[:1])


class Failing:
    """A guest that cannot do anything."""

    def published(self, key_text: str, payload: bytes) -> None:
        """Fail."""
        raise ValueError(key_text, payload)

    def show(self, roster: Roster) -> None:
        """Fail."""
        raise ValueError(roster)

    def take_requests(self) -> list[tuple[str, bytes]]:
        """Fail."""
        raise KeyError("anything")


class Asking(Failing):
    """Another, who asks for something."""

    def take_requests(self) -> list[tuple[str, bytes]]:
        """Return what it asks for."""
        return [("a", b"b")]


def test_a_guest_that_fails_keeps_no_other_from_being_heard() -> None:
    going_on = GoingOn()
    guests = Guests([Failing(), Asking()], going_on)
    for _ in range(3):
        assert guests.take_requests() == [("a", b"b")]
    guests.published("a", b"")
    assert any("Failing failed 3 times" in each and "KeyError" in each for each in going_on.remarks)
    assert len(going_on.remarks) == 3


def test_a_thread_that_fails_is_begun_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("command_post.going_on.PAUSE_S", 0.0)
    times = list[int]()

    def run(stop: Event) -> None:
        times.append(1)
        if len(times) < 3:
            raise OSError
        stop.set()

    GoingOn().running("refilling", run, Event())
    assert len(times) == 3


def test_an_interrupt_amid_machine_code_is_no_mishap() -> None:
    mishaps = Mishaps()
    inner = SystemError("_numba_unpickle returned a result with an exception set")
    inner.__cause__ = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt), mishaps.survived("solving"):
        raise SystemError("CPUDispatcher returned a result with an exception set") from inner
    assert not mishaps
