"""The gist of a recording: what was recorded since it was kept is all that has to be read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from command_post.incident import Incident, IncidentSettings
from command_post.recorder.recording import RecordedIncident, Recorder
from command_post.resuming import gist as gists
from command_post.resuming.beside import before_path
from command_post.resuming.gist import Gist
from command_post.resuming.gist_keeper import EVERY_S, GistKeeper, gist_of, gist_path
from command_post.resuming.last_told import Recorded
from shared.codec import encode
from shared.gate_notes import noted
from shared.mcap_reader import RecordedMessage, Recording, read_recording
from shared.messages import Alert, AlertStage, Beat, Mayday, Order, OrderRequest
from shared.seal import sealed
from shared.topics import Key
from shared.units import NS_PER_S
from tests.unit.test_post import NOW_NS, key, start, stride
from tests.waiting import wait_for

RUN = b"\x01" * 8
SETTINGS = IncidentSettings(incident="fire", post_id="p")


class World:
    """A post's recorder and the keeper of its gist, who has a clock of his own."""

    def __init__(self, folder: Path) -> None:
        self.now_s = 0.0
        self.recorder = Recorder(folder / "a.mcap", SETTINGS.as_metadata(), resume=True)
        self.path = gist_path(folder / "a.mcap")
        self._incident = RecordedIncident(Incident(SETTINGS), self.recorder)
        self._number = 0
        GistKeeper(self.path, Gist(), self.recorder, lambda: self.now_s)

    def walk(self, strides: int) -> None:
        """Have two responders walk, and wait until that is on the disk."""
        for _ in range(strides):
            for name in ("r1", "r2"):
                first = self._number == 0
                self.hear(key("start" if first else "increment", node=name),
                          start() if first else stride(self._number))  # fmt: skip
            self._number += 1
        wait_for(lambda: self.recorder.safe == self.recorder.taken, "the disk")

    def hear(self, key_text: str, payload: bytes) -> None:
        """Handle a message of a journal; every tenth is missing from it."""
        self._heard = getattr(self, "_heard", 0) + 1
        number = self._heard + self._heard // 10
        now_ns = NOW_NS + self._heard * NS_PER_S
        self._incident.handle(key_text, sealed(payload, RUN, number), now_ns)

    def keep(self) -> None:
        """Have the gist kept with what comes next, and wait for it."""
        self.path.unlink(missing_ok=True)
        self.now_s += EVERY_S
        self.walk(1)
        wait_for(self.path.exists, "the gist")

    def recording(self) -> Recording:
        """Return what is on the disk."""
        return read_recording(self.recorder.part)


@pytest.fixture
def world(tmp_path: Path) -> Iterator[World]:
    world = World(tmp_path)
    yield world
    world.recorder.close()


def of_all(recording: Recording) -> Gist:
    gist = Gist()
    gist.read(recording)
    return gist


def assert_same(one: Gist, other: Gist) -> None:
    last, of_other = one.last_told(), other.last_told()
    assert last._replace(to_handle=[]) == of_other._replace(to_handle=[])
    assert plain(last.to_handle) == plain(of_other.to_handle)
    assert plain(one.told) == plain(other.told)
    assert noted(one.remembered()) == noted(other.remembered())


def plain(recorded: Sequence[Recorded]) -> list[tuple[int, str, bytes]]:
    return [(each.log_time_ns, each.key, each.payload) for each in recorded]


def test_only_what_was_recorded_since_is_read(
    world: World, capsys: pytest.CaptureFixture[str]
) -> None:
    world.hear(str(Key("fire", "responder", "r2", "mayday")), encode(Mayday(
        event_time_ns=NOW_NS, sequence=0, phase="called", called_ns=NOW_NS, reason="by hand",
    )))  # fmt: skip
    world.walk(70)
    world.keep()
    world.walk(3)
    recording, whole = world.recording(), of_all(world.recording())
    found = gist_of(world.path, recording)
    assert 6 <= recording.report.message_count < 40
    assert {alert.kind for alert in found.last_told().alerts} == {"mayday"}
    assert set(found.last_told().estimates) == {"r1", "r2"}
    assert len(found.last_told().to_handle) < 140
    assert noted(found.remembered()).journals[0].holes
    assert found.moves == whole.moves > 140
    assert_same(found, whole)
    assert_same(Gist.unpacked(whole.packed()), whole)
    assert capsys.readouterr().out == ""


def test_a_damaged_one_is_told_of_and_the_one_before_or_all_serves(
    world: World, capsys: pytest.CaptureFixture[str]
) -> None:
    world.walk(5)
    world.now_s += EVERY_S
    world.walk(5)
    wait_for(before_path(world.path).exists, "the second gist")
    wait_for(world.path.exists, "the second gist")
    whole = of_all(world.recording())
    data = world.path.read_bytes()
    for damaged in (b"", data[: len(data) // 2], data[:-3] + b"\0\0\0"):
        world.path.write_bytes(damaged)
        recording = world.recording()
        assert_same(gist_of(world.path, recording), whole)
        assert recording.report.message_count < whole_count(world)
        assert "of no use" in capsys.readouterr().out
    before_path(world.path).write_bytes(b"\xff" * 99)
    recording = world.recording()
    assert_same(gist_of(world.path, recording), whole)
    assert recording.report.message_count == whole_count(world)
    assert "all of it is read" in capsys.readouterr().out


def whole_count(world: World) -> int:
    return len(list(world.recording()))


def test_a_fault_while_it_is_taken_ends_neither_the_recording_nor_the_post(
    world: World, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Gist, "take", lambda *_: 1 // 0)
    world.walk(2)
    world.walk(2)
    assert world.recorder.status().fault is None
    assert capsys.readouterr().out.count("no gist of the recording is kept any more") == 1


def told(topic: str, message: Alert | Order) -> RecordedMessage:
    return RecordedMessage(1, 1, f"clew/v1/fire/post/p/{topic}", encode(message), outgoing=True)


def test_it_is_bounded_and_keeps_what_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gists, "MOST_OF_EACH", 20)
    monkeypatch.setattr(gists, "MOST_OF_A_KEY", 20)
    monkeypatch.setattr(gists, "MOST_KEYS", 30)
    gist = Gist()
    for number in range(100):
        stage: AlertStage = "raised" if number == 3 else "resolved"
        gist.take(told("alert", Alert(
            event_time_ns=1, sequence=number, number=number, kind="mayday", stage=stage,
            role="responder", node_id="r1", since_ns=1, words="", by=None, assigned_to=None,
        )))  # fmt: skip
        for node, topic, message in (
            ("c", "order_request", OrderRequest(
                event_time_ns=1, sequence=number, kind="evacuate", to=(), text="",
            )),
            (f"made-up-{number}", "beat", Beat(
                event_time_ns=1, sequence=0, run=RUN.hex(), last_number=0, kept_from=1,
                acknowledged=0,
            )),
        ):  # fmt: skip
            key_text = str(Key("fire", "post", node, topic))
            gist.take(RecordedMessage(70 * number * NS_PER_S, 1, key_text, encode(message), False))
        gist.take(RecordedMessage(1, 1, f"garbage-{number}", b"?", outgoing=False))
    last = gist.last_told()
    assert [each.number for each in last.alerts] == [3, *range(81, 100)]
    assert sum("order_request" in each.key for each in last.to_handle) == 20
    assert len({each.key for each in last.to_handle}) <= 31
    assert last.next_sequences == {"alert": 100}
