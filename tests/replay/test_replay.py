"""What was recorded, handled once more, makes the same to the bit; and where not, it is told."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from command_post.fusion.time_line import TimeLineSettings
from command_post.incident import Incident, IncidentSettings
from command_post.recorder.file import RecordingFile
from command_post.recorder.recording import RecordedIncident, Recorder
from command_post.replay import replay
from shared.mcap_reader import RecordedMessage, RecordingError, read_recording
from tests.stride_world import exercise
from tests.traffic import START_NS, Sent, Tally, key_of, traffic

TRACK = key_of("post", "post", "track")
STRIDES = 20


def held(path: Path, *, finish: bool = True, incident: Tally | None = None) -> Path:
    """Record an incident; without ``finish``, as far as a kill would leave it."""
    file = RecordingFile(path, {})
    recorded = RecordedIncident(incident or Tally(), file)
    now_ns = 0
    for now_ns, key, payload in traffic(STRIDES):
        recorded.handle(key, payload, now_ns)
    if finish:
        recorded.finish(now_ns + 7)
        file.finish()
        return path
    file.sync()
    file.abandon()
    return path.with_name(f"{path.name}.part")


def test_a_replay_makes_the_same_to_the_bit(tmp_path: Path) -> None:
    report = replay(held(tmp_path / "a.mcap"), Tally())
    assert report.identical
    assert report.equal == STRIDES * 2 + 2
    assert report.handled == len(list(traffic(STRIDES)))
    assert report.first_difference is None
    assert "42 equal to the bit" in str(report)


def test_so_it_does_of_what_the_recorder_thread_wrote(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", {}) as recorder:
        recorded = RecordedIncident(Tally(), recorder)
        for now_ns, key, payload in traffic(STRIDES):
            recorded.handle(key, payload, now_ns)
        recorded.finish(now_ns)
    report = replay(tmp_path / "a.mcap", Tally())
    assert report.identical
    assert report.equal == STRIDES * 2 + 2


def test_what_is_handled_and_what_comes_of_it_stand_in_the_order_of_handling(
    tmp_path: Path,
) -> None:
    received: list[RecordedMessage] = []
    made: list[RecordedMessage] = []
    for message in read_recording(held(tmp_path / "a.mcap")):
        (made if message.outgoing else received).append(message)
        if message.key == TRACK and len(made) < STRIDES * 2:
            assert message.log_time_ns == received[-1].log_time_ns
    assert [Sent(m.log_time_ns, m.key, m.payload) for m in received] == list(traffic(STRIDES))
    assert {message.key for message in made} == {TRACK}


def test_another_setting_differs_and_the_first_difference_is_named(tmp_path: Path) -> None:
    report = replay(held(tmp_path / "a.mcap"), Tally(stride_scale=1.5))
    assert not report.identical
    assert report.different == STRIDES * 2 + 2
    assert report.equal == 0
    difference = report.first_difference
    assert difference is not None
    assert (difference.key, difference.number) == (TRACK, 0)
    assert str(difference).startswith(f"{TRACK} number 0: north_m was 0.7, is 1.0499999")


def test_the_last_bit_of_one_number_is_a_difference(tmp_path: Path) -> None:
    report = replay(held(tmp_path / "a.mcap"), Tally(stride_scale=1.0 + 2.0**-52))
    assert report.different > 0


class Silent(Tally):
    """Makes nothing of anything."""

    def handle(self, key: str, payload: bytes, now_ns: int) -> list[Sent]:
        """Say nothing."""
        super().handle(key, payload, now_ns)
        return []

    def finish(self, now_ns: int) -> list[Sent]:
        """Say nothing."""
        super().finish(now_ns)
        return []


def test_estimates_that_are_not_made_any_more_are_missing(tmp_path: Path) -> None:
    report = replay(held(tmp_path / "a.mcap"), Silent())
    assert (report.missing, report.extra, report.identical) == (STRIDES * 2 + 2, 0, False)
    assert str(report.first_difference) == f"{TRACK} number 0: not made now"


def test_estimates_that_were_not_made_then_are_extra(tmp_path: Path) -> None:
    report = replay(held(tmp_path / "a.mcap", incident=Silent()), Tally())
    assert (report.missing, report.extra, report.identical) == (0, STRIDES * 2 + 2, False)
    assert str(report.first_difference) == f"{TRACK} number 0: not made then"


def test_an_unfinished_recording_is_replayed_as_far_as_it_goes(tmp_path: Path) -> None:
    report = replay(held(tmp_path / "a.mcap", finish=False), Tally())
    assert report.identical
    assert report.equal == STRIDES * 2 - 1
    assert report.unconfirmed == 0
    assert "unfinished" in str(report)


def test_what_came_of_the_last_message_may_be_cut_off_with_the_recording(tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "a.mcap", {})
    incident = Tally()
    (first, second, third) = list(traffic(2))[:3]
    recorded = RecordedIncident(incident, file)
    recorded.handle(first.key, first.payload, first.log_time_ns)
    recorded.handle(second.key, second.payload, second.log_time_ns)
    file.put(third.key, third.payload, third.log_time_ns)
    file.sync()
    file.abandon()
    report = replay(tmp_path / "a.mcap.part", Tally())
    assert (report.equal, report.unconfirmed, report.identical) == (1, 1, True)


def test_what_was_made_while_nothing_was_heard_is_made_again(tmp_path: Path) -> None:
    settings = IncidentSettings(time_line=TimeLineSettings(hold_s=0.5))
    incident = Incident(settings)
    file = RecordingFile(tmp_path / "a.mcap", {})
    recorded = RecordedIncident(incident, file)
    idle = 0
    for now_ns, key, payload in exercise(3)[:300]:
        while incident.due_ns is not None and incident.due_ns < now_ns:
            idle += len(recorded.pass_time(incident.due_ns))
        recorded.handle(key, payload, now_ns)
    last: Sequence[object] = []
    while not last:
        assert incident.due_ns is not None
        last = recorded.pass_time(incident.due_ns)
    file.sync()
    file.abandon()
    report = replay(tmp_path / "a.mcap.part", Incident(settings))
    assert (report.identical, report.unconfirmed) == (True, 0)
    assert report.equal > idle > 100
    assert len(last) == 1


def test_garbage_is_handled_again_too(tmp_path: Path) -> None:
    seen: list[bytes] = []

    class Witness(Tally):
        def handle(self, key: str, payload: bytes, now_ns: int) -> list[Sent]:
            """Remember."""
            seen.append(payload)
            return super().handle(key, payload, now_ns)

    assert replay(held(tmp_path / "a.mcap"), Witness()).identical
    assert seen == [sent.payload for sent in traffic(STRIDES)]


def test_the_clock_reads_what_it_read_even_where_it_was_set_back(tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "a.mcap", {})
    recorded = RecordedIncident(Tally(), file)
    for number, sent in enumerate(traffic(STRIDES)):
        recorded.handle(sent.key, sent.payload, START_NS + (number % 7) * 1_000_000_000)
    file.finish()
    report = replay(tmp_path / "a.mcap", Tally())
    assert report.identical
    assert report.equal > 0


def test_drops_are_told_with_the_differences_they_make(tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "a.mcap", {})
    incident = Tally()
    for number, (now_ns, key, payload) in enumerate(traffic(STRIDES)):
        if number != 9:
            file.put(key, payload, now_ns)
        for made in incident.handle(key, payload, now_ns):
            file.put(made.key, made.payload, now_ns, outgoing=True)
    file.mark_dropped(1)
    file.finish()
    report = replay(tmp_path / "a.mcap", Tally())
    assert not report.identical
    assert "1 messages dropped by the recorder" in str(report)


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot be read"):
        replay(tmp_path / "a.mcap", Tally())
