"""What is kept of the post's state is as good as handling all again, or is not used at all."""

from __future__ import annotations

import ast
import pickle
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import msgspec
import pytest
import zstandard

import command_post
from command_post.desks.announcer import Outgoing
from command_post.incident import Incident, IncidentSettings
from command_post.recorder.parts import Rotation
from command_post.recorder.recording import RecordedIncident, Recorder
from command_post.resuming import checkpoint
from command_post.resuming.beside import sha256_hex
from command_post.resuming.checkpoint import Checkpoints, Kept, State, checkpoint_path, kept_states
from command_post.resuming.resume import resume
from shared.codec import encode
from shared.gate import Gate, JournalRun
from shared.mcap_reader import read_recording
from shared.seal import sealed
from shared.topics import Key
from shared.units import NS_PER_S
from tests.benchmarks.crowd import crowd
from tests.benchmarks.test_team_speed import role_of, topic_of
from tests.waiting import wait_for

SETTINGS = IncidentSettings(incident="fire")
RUN = b"\x01" * 8


class Heard:
    """Some responders' messages, sealed or not."""

    def __init__(self, responders: int, minutes: float) -> None:
        self.messages = []
        for number, (node_id, message) in enumerate(crowd(1, responders, minutes, 1.0, 3), 1):
            key = str(Key("fire", role_of(message), node_id, topic_of(message)))
            payload = encode(message)
            if number % 50 == 0:
                payload = sealed(payload, RUN, number)
            self.messages.append((message.event_time_ns + NS_PER_S // 20, key, payload))


class World:
    """A post's record and state; ``hear`` hands on so many messages."""

    def __init__(self, path: Path, heard: Heard, rotation: Rotation | None = None) -> None:
        self.path = path
        self.recorder = Recorder(path, SETTINGS.as_metadata(), resume=True, rotation=rotation)
        self.incident, self.gate = Incident(SETTINGS), Gate()
        self.recorded = RecordedIncident(self.incident, self.recorder)
        self.kept_at = checkpoint_path(path)
        self.checkpoints = Checkpoints(self.kept_at, self.recorder)
        self._heard = iter(heard.messages)

    def hear(self, count: int) -> list[Outgoing]:
        """Handle the next messages."""
        made: list[Outgoing] = []
        for (time_ns, key, payload), _ in zip(self._heard, range(count), strict=False):
            self.gate.admit(key, payload)
            made += [
                Outgoing(*each) for each in map(_pair, self.recorded.handle(key, payload, time_ns))
            ]
        return made

    def keep(self) -> None:
        """Keep the state, and wait until that is done."""
        self.kept_at.unlink(missing_ok=True)
        self.checkpoints.keep(State(self.incident, self.gate.remembered(), None, 7))
        wait_for(self.kept_at.exists, "the state on the disk")

    def all_is_safe(self) -> None:
        """Wait until all is on the disk."""
        wait_for(lambda: self.recorder.safe == self.recorder.taken, "the disk")

    def loaded(self) -> Kept | None:
        """Return what is kept."""
        return next(kept_states(self.kept_at, self.recorder.part, SETTINGS), None)


def _pair(each: object) -> tuple[str, bytes]:
    assert isinstance(each, Outgoing)
    return each.key, each.payload


@pytest.fixture(scope="module")
def heard() -> Heard:
    return Heard(3, 1.0)


@pytest.fixture
def world(tmp_path: Path, heard: Heard) -> Iterator[World]:
    world = World(tmp_path / "a.mcap", heard)
    yield world
    world.recorder.close()


def is_later(recorder: Recorder, number: int) -> bool:
    return recorder.part_number > number


def test_it_is_of_a_part_that_was_ended_since(tmp_path: Path, heard: Heard) -> None:
    world = World(tmp_path / "a.mcap", heard, Rotation(1, NS_PER_S))
    for _ in range(2):
        world.hear(20)
        world.keep()
        number = world.recorder.part_number
        world.hear(20)
        world.all_is_safe()
        wait_for(partial(is_later, world.recorder, number), "another part")
    kept = world.loaded()
    assert kept is not None
    assert 1 < kept.place.part < world.recorder.part_number
    since = read_recording(world.path).since(*kept.place)
    resumed = resume(since, kept.state.incident, Gate().recall)
    assert (resumed.handled, resumed.differing) == (20, 0)
    assert kept.state.incident.estimates == world.incident.estimates
    world.recorder.close()


@pytest.mark.parametrize("responders", [3, 20], ids=["one crew", "a crowd"])
def test_taken_up_from_it_all_goes_on_to_the_bit(tmp_path: Path, responders: int) -> None:
    heard = Heard(responders, 0.7)
    world = World(tmp_path / "a.mcap", heard)
    half = len(heard.messages) // 2
    world.hear(half)
    world.keep()
    world.hear(half // 4)
    world.all_is_safe()
    kept = world.loaded()
    assert kept is not None
    assert kept.state.last_ns == 7
    incident, gate = kept.state.incident, Gate()
    gate.remember(kept.state.remembered)
    resumed = resume(read_recording(world.recorder.part).since(*kept.place), incident, gate.recall)
    assert resumed.handled == half // 4
    assert resumed.differing == 0
    assert incident.estimates == world.incident.estimates
    journal = next(iter(world.gate.journals()))[0]
    assert isinstance(journal, JournalRun)
    assert gate.missing() == world.gate.missing() != []
    # What comes then, a word about long ago among it, makes the same of both.
    late = heard.messages[3]
    last_ns = heard.messages[-1][0]
    for came_ns, key, payload in [*heard.messages[half + half // 4 :], late]:
        time_ns = last_ns if payload == late[2] else came_ns
        now, then = (each.handle(key, payload, time_ns) for each in (incident, world.incident))
        assert now == then
    assert incident.finish(last_ns) == world.incident.finish(last_ns)
    world.recorder.close()


def test_it_is_due_when_there_is_much_to_do_again_and_not_too_often(world: World) -> None:
    world.hear(10)
    assert not world.checkpoints.is_due
    world.checkpoints.work(checkpoint.WORTH_S - 0.1)
    assert not world.checkpoints.is_due
    world.checkpoints.work(0.2)
    assert world.checkpoints.is_due
    world.keep()
    assert not world.checkpoints.is_due
    wait_for(lambda: world.checkpoints.work(1.0) or world.checkpoints.is_due, "the next one")


def test_when_it_takes_long_it_is_done_rarely_and_not_never(
    world: World, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    world.hear(10)
    monkeypatch.setattr(checkpoint, "MOST_HALT_S", 1e-9)
    world.keep()
    world.checkpoints.work(1e6)
    assert not world.checkpoints.is_due
    assert "kept rarely" in capsys.readouterr().out
    # As if it had not taken so long after all.
    monkeypatch.setattr(checkpoint, "MOST_HALT_S", 1.0)
    wait_for(lambda: world.checkpoints.is_due, "the next one")


def test_without_one_nothing_is_wrong(world: World, capsys: pytest.CaptureFixture[str]) -> None:
    assert world.loaded() is None
    assert capsys.readouterr().out == ""


def changed(path: Path, **changes: object) -> None:
    told = msgspec.msgpack.decode(path.read_bytes())
    path.write_bytes(msgspec.msgpack.encode({**told, **changes}))


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"software": "older"}, "other software"),
        ({"content": b"else"}, "damaged"),
        ({"tail_sha256": "0"}, "another recording"),
        ({"position_bytes": 10**9}, "another recording"),
        ({"position_bytes": "x"}, "Expected `int`"),
    ],
)
def test_one_that_does_not_fit_is_passed_over(
    world: World, changes: dict[str, object], why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    world.hear(40)
    world.keep()
    assert world.loaded() is not None
    changed(world.kept_at, **changes)
    assert world.loaded() is None
    assert why in capsys.readouterr().out


def test_where_the_last_is_damaged_the_one_before_it_serves(world: World) -> None:
    world.hear(20)
    world.keep()
    world.hear(20)
    world.checkpoints.keep(State(world.incident, world.gate.remembered(), None, 8))
    wait_for(lambda: (kept := world.loaded()) and kept.state.last_ns == 8, "the second state")
    for damaged in (b"", b"\xff" * 1000):
        world.kept_at.write_bytes(damaged)
        kept = world.loaded()
        assert kept is not None
        assert kept.state.last_ns == 7


def test_no_state_is_made_by_what_may_change_aside() -> None:
    """What an incident imports, and all that that imports."""
    found, todo = set[str](), ["command_post.incident", "shared.gate", "shared.bus.interface"]
    folder = Path(command_post.__path__[0]).parent
    while todo:
        module = todo.pop()
        path = folder.joinpath(*module.split(".")).with_suffix(".py")
        if module in found or not path.exists():
            continue
        found.add(module)
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module is not None:
                todo += [node.module, *(f"{node.module}.{each.name}" for each in node.names)]
            elif isinstance(node, ast.Import):
                todo += [each.name for each in node.names]
    assert len(found) > 50
    assert {module for module in found if module.split(".")[1] in checkpoint.ASIDE} == set()


def test_every_broken_off_file_is_passed_over(world: World) -> None:
    world.hear(40)
    world.keep()
    data = world.kept_at.read_bytes()
    for size in range(0, len(data), max(len(data) // 50, 1)):
        world.kept_at.write_bytes(data[:size])
        assert world.loaded() is None


def test_one_of_other_settings_is_passed_over(world: World) -> None:
    world.hear(40)
    world.keep()
    other = IncidentSettings(incident="mill")
    assert not list(kept_states(world.kept_at, world.recorder.part, other))


class Harmful:
    """What would call anything when it is unpickled."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return print, ("harm",)


def test_nothing_is_called_that_a_state_has_not(
    world: World, capsys: pytest.CaptureFixture[str]
) -> None:
    world.hear(10)
    state = zstandard.compress(pickle.dumps(Harmful()))
    world.keep()
    changed(world.kept_at, content=state, content_sha256=sha256_hex(state))
    assert world.loaded() is None
    said = capsys.readouterr().out
    assert "builtins.print is nothing that a state has" in said
    assert "harm\n" not in said
