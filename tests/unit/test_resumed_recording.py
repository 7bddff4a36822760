"""A recording that was broken off is gone on with, and ends like any other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from mcap.reader import make_reader

from command_post.recorder.file import RecorderError, RecordingFile
from command_post.recorder.layout import ending_of, whole_part
from shared.mcap_reader import RecordedMessage, read_recording
from tests.traffic import Sent, traffic

ABOUT = {"incident": "test"}
SENT = list(traffic(20))
FIRST, SECOND = SENT[:30], SENT[30:]


def put(file: RecordingFile, sent: Sequence[Sent]) -> None:
    for time_ns, key, payload in sent:
        file.put(key, payload, time_ns, outgoing=time_ns % 2 == 1)


def broken_off(path: Path, sent: Sequence[Sent] = FIRST) -> Path:
    """Leave an unfinished recording in two chunks; return where it is."""
    file = RecordingFile(path, ABOUT)
    put(file, sent[:20])
    file.sync()
    put(file, sent[20:])
    file.sync()
    file.abandon()
    return file.part


def resumed(path: Path, sent: Sequence[Sent] = SECOND) -> list[RecordedMessage]:
    """Go on with the recording at ``path``, finish it, and return what is in it."""
    file = RecordingFile(path, ABOUT, resume=True)
    file.mark_resumed(7)
    put(file, sent)
    file.finish()
    return list(read_recording(path))


def as_sent(messages: Sequence[RecordedMessage]) -> list[Sent]:
    return [Sent(each.log_time_ns, each.key, each.payload) for each in messages]


def test_it_holds_what_was_before_and_what_came_after(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    part = broken_off(path)
    assert as_sent(resumed(path)) == SENT
    assert not part.exists()
    recording = read_recording(path)
    assert [each.outgoing for each in recording] == [sent[0] % 2 == 1 for sent in SENT]
    assert recording.report.complete
    assert recording.report.resumed_count == 1
    assert "1 times broken off" in str(recording.report)


def test_standard_tools_find_all_of_it_by_its_index(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    broken_off(path)
    resumed(path)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        found = [message.data for _, _, message in reader.iter_messages(log_time_order=False)]
        topics = {key for _, key, _ in SENT}
        of_each = [len(list(reader.iter_messages(topics=[topic]))) for topic in sorted(topics)]
    assert found == [payload for _, _, payload in SENT]
    assert summary.statistics.message_count == len(SENT) == sum(of_each)
    assert {channel.topic for channel in summary.channels.values()} == topics
    assert len(summary.chunk_indexes) == summary.statistics.chunk_count == 3
    assert [each.name for each in summary.metadata_indexes].count("clew.resumed") == 1


def test_its_ending_is_what_the_library_writes(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    file = RecordingFile(path, ABOUT)
    put(file, SENT)
    file.mark_end(9)
    file.sync()
    unfinished = file.part.read_bytes()
    made = ending_of(file.part, whole_part(file.part).declared)
    file.finish()
    assert path.read_bytes() == unfinished + made


def test_an_empty_one_ends_as_the_library_ends_it(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    file = RecordingFile(path, ABOUT)
    made = file.part.read_bytes() + ending_of(file.part, whole_part(file.part).declared)
    file.finish()
    assert path.read_bytes() == made


def test_it_can_be_broken_off_again_and_again(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    for at in range(0, len(SENT), 7):
        file = RecordingFile(path, ABOUT, resume=True)
        put(file, SENT[at : at + 7])
        file.sync()
        file.abandon()
    assert as_sent(resumed(path, [])) == SENT
    assert len({each.key for each in read_recording(path)}) == len({key for _, key, _ in SENT})


@pytest.mark.parametrize("left", [b"", b"\x89MC", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n\x01\x20"])
def test_one_that_had_not_begun_is_begun(tmp_path: Path, left: bytes) -> None:
    path = tmp_path / "a.mcap"
    path.with_name("a.mcap.part").write_bytes(left)
    file = RecordingFile(path, ABOUT, resume=True)
    assert not file.is_resumed
    put(file, SENT)
    file.finish()
    assert as_sent(list(read_recording(path))) == SENT
    assert read_recording(path).metadata["incident"] == "test"


def test_a_finished_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    RecordingFile(path, ABOUT).finish()
    with pytest.raises(RecorderError, match="is there already; give the recording another name"):
        RecordingFile(path, ABOUT, resume=True)


def test_one_of_something_else_is_refused_and_left_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    part = broken_off(path)
    before = part.read_bytes()
    with pytest.raises(
        RecorderError, match="was begun with other settings: incident test, not another; move it"
    ):
        RecordingFile(path, {"incident": "another"}, resume=True)
    assert part.read_bytes() == before


def test_one_of_an_incident_that_was_ended_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    file = RecordingFile(path, ABOUT)
    put(file, FIRST)
    file.mark_end(9)
    file.sync()
    file.abandon()
    with pytest.raises(RecorderError, match="of an incident that was ended"):
        RecordingFile(path, ABOUT, resume=True)


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.with_name("a.mcap.part").write_bytes(b"anything else")
    with pytest.raises(RecorderError, match="is not an MCAP file"):
        RecordingFile(path, ABOUT, resume=True)


def test_what_had_been_dropped_before_stays_told(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    file = RecordingFile(path, ABOUT)
    put(file, FIRST)
    file.sync()
    file.mark_dropped(12)
    file.sync()
    file.abandon()
    file = RecordingFile(path, ABOUT, resume=True)
    assert file.dropped_before == 12
    file.finish()
    recording = read_recording(path)
    assert as_sent(list(recording)) == FIRST
    assert recording.report.dropped_count == 12


def test_damage_before_the_end_does_not_keep_it_from_being_gone_on_with(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    part = broken_off(path)
    data = bytearray(part.read_bytes())
    data[data.index(b"\x04\0\0\0zstd") + 40] ^= 0xFF
    part.write_bytes(bytes(data))
    assert as_sent(resumed(path)) == FIRST[20:] + SECOND
    assert not read_recording(path).report.complete


def test_after_a_fault_it_goes_on_behind_what_was_synced(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    file = RecordingFile(path, ABOUT)
    put(file, FIRST)
    file.sync()
    put(file, SECOND)
    with file.part.open("ab") as torn:
        torn.write(b"\x06 half a chunk")
    file.mend()
    put(file, SECOND)
    file.finish()
    recording = read_recording(path)
    assert as_sent(list(recording)) == SENT
    assert recording.report.complete
