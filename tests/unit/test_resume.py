"""An incident taken up again after a kill goes on as if nothing had been."""

from __future__ import annotations

from pathlib import Path
from typing import Self

import pytest

from command_post.incident import Incident, IncidentSettings
from command_post.recorder.file import RecordingFile
from command_post.recorder.recording import RecordedIncident
from command_post.replay import replay
from command_post.resuming.resume import Resumed, resume
from shared.codec import encode
from shared.gate import Gate, JournalRun
from shared.mcap_reader import read_recording
from shared.messages import DapInstallation, OdometryIncrement, RssiPeak, TrackStart
from shared.seal import sealed
from shared.topics import Key
from shared.units import NS_PER_S
from tests.benchmarks.crowd import crowd
from tests.benchmarks.test_team_speed import role_of, topic_of

SETTINGS = IncidentSettings(incident="fire")
RUN = b"\x01" * 8
Heard = tuple[int, str, bytes]


@pytest.fixture(scope="module")
def heard() -> list[Heard]:
    """What three responders and their DAPs say in a minute, each journalled; and raw readings."""
    found: list[Heard] = []
    numbers: dict[str, int] = {}
    for node_id, message in crowd(1, 3, 1.0, 1.0, 3):
        key = str(Key("fire", role_of(message), node_id, topic_of(message)))
        number = numbers[node_id] = numbers.get(node_id, 0) + 1
        payload = sealed(encode(message), RUN, number)
        found.append((message.event_time_ns + NS_PER_S // 20, key, payload))
    assert {type(each) for _, each in crowd(1, 3, 1.0, 1.0, 3)} == {
        TrackStart, OdometryIncrement, RssiPeak, DapInstallation,
    }  # fmt: skip
    return sorted(found)


class Kept:
    """A post's record, gate and incident, as they are when it is at work."""

    def __init__(self, path: Path) -> None:
        self.file = RecordingFile(path, SETTINGS.as_metadata(), resume=True)
        self.incident, self.gate = Incident(SETTINGS), Gate()
        self.resumed: Resumed | None = None
        if self.file.is_resumed:
            recording = read_recording(self.file.part)
            self.resumed = resume(recording, self.incident, self.gate.recall)
            for time_ns, key, payload in self.resumed.unrecorded:
                self.file.put(key, payload, time_ns, outgoing=True)
        self.recorded = RecordedIncident(self.incident, self.file)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Kill it."""
        self.file.abandon()

    def hear(self, heard: list[Heard]) -> int:
        """Take in what the gate lets in, and say how much that was; be awake when more is due."""
        count = 0
        for time_ns, key, payload in heard:
            while (due_ns := self.incident.due_ns) is not None and due_ns < time_ns:
                self.recorded.pass_time(due_ns)
            if self.gate.admit(key, payload) is None:
                self.recorded.handle(key, payload, time_ns)
                count += 1
        return count


def test_killed_anywhere_it_goes_on_to_the_bit(tmp_path: Path, heard: list[Heard]) -> None:
    path = tmp_path / "a.mcap"
    for at in range(0, len(heard), 40):
        with Kept(path) as post:
            assert post.resumed is None or not post.resumed.differing
            # What was handled before and was not yet on the disk is heard again.
            post.hear(heard[: at + 40])
            post.file.sync()
            post.hear(heard[at + 40 : at + 50])
    with Kept(path) as last:
        assert last.hear(heard) == 0
        last.recorded.finish(heard[-1][0])
        last.file.finish()
    received = [each for each in read_recording(path) if not each.outgoing]
    assert [(each.key, each.payload) for each in received] == [each[1:] for each in heard]
    report = replay(path, Incident(SETTINGS))
    assert report.identical, report
    assert report.equal > 100
    assert report.reading.complete


def test_what_was_made_of_the_last_message_and_not_recorded_is_said_now(
    tmp_path: Path, heard: list[Heard]
) -> None:
    file = RecordingFile(tmp_path / "a.mcap", SETTINGS.as_metadata())
    incident = Incident(SETTINGS)
    for time_ns, key, payload in heard:
        file.put(key, payload, time_ns)
        made = incident.handle(key, payload, time_ns)
        if len(made) > 1 and time_ns > heard[100][0]:
            break
        for each in made:
            file.put(each.key, each.payload, time_ns, outgoing=True)
    # Of what came of the last message, one is on the disk.
    file.put(made[0].key, made[0].payload, time_ns, outgoing=True)
    file.sync()
    file.abandon()
    resumed = resume(read_recording(file.part), Incident(SETTINGS), lambda *_: None)
    assert [each[1:] for each in resumed.unrecorded] == [tuple(each) for each in made[1:]]
    assert resumed.differing == 0


def test_the_gate_knows_what_has_come(tmp_path: Path, heard: list[Heard]) -> None:
    path = tmp_path / "a.mcap"
    with Kept(path) as post:
        post.hear(heard[:50] + heard[55:90])
        post.file.sync()
        post.hear(heard[90:])
    with Kept(path) as again:
        numbers = again.gate.journal(JournalRun("responder", "r0-0", RUN))
        assert numbers is not None
        assert 10 < numbers.highest < 60
        assert again.gate.missing()
        assert again.gate.turned.total() == 0
        assert again.hear(heard) == len(heard) - 85


def test_the_daps_places_are_known_to_be_said_again(tmp_path: Path, heard: list[Heard]) -> None:
    with Kept(tmp_path / "a.mcap") as post:
        post.hear(heard)
        post.file.sync()
    with Kept(tmp_path / "a.mcap") as again:
        places = again.incident.dap_places
    assert places == post.incident.dap_places
    assert len(places) == len(post.incident.daps) > 1
    assert all(each.key.endswith("/dap_place") for each in places.values())


def test_what_is_made_otherwise_now_is_counted(tmp_path: Path, heard: list[Heard]) -> None:
    with Kept(tmp_path / "a.mcap") as post:
        post.hear(heard)
        post.file.put("clew/v1/fire/post/post/track", b"?", heard[-1][0], outgoing=True)
        post.file.sync()
    with Kept(tmp_path / "a.mcap") as again:
        assert again.resumed is not None
        assert again.resumed.differing == 1
