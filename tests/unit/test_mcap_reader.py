"""Reading recordings that are whole, broken off or damaged, and files that are none."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import NamedTuple

import pytest

from command_post.recorder.file import RecordingFile
from shared.mcap_reader import RecordedMessage, RecordingError, read_recording
from tests.traffic import traffic


class Made(NamedTuple):
    """A recording in three chunks; ``synced`` are the sizes of file and contents after each."""

    path: Path
    messages: list[RecordedMessage]
    synced: list[tuple[int, int]]


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory: pytest.TempPathFactory) -> Made:
    path = tmp_path_factory.mktemp("recording") / "a.mcap"
    part = path.with_name("a.mcap.part")
    file = RecordingFile(path, {"incident": "test"})
    synced = []
    sent = list(traffic(15))
    for number, (time_ns, key, payload) in enumerate(sent, 1):
        file.put(key, payload, time_ns)
        if number % (len(sent) // 3) == 0:
            file.sync()
            synced.append((part.stat().st_size, number))
    file.abandon()
    return Made(part, list(read_recording(part)), synced)


@pytest.fixture
def copy(unfinished: Made, tmp_path: Path) -> Path:
    path = tmp_path / "copy.mcap"
    path.write_bytes(unfinished.path.read_bytes())
    return path


def chunk_starts(data: bytearray) -> list[int]:
    return [match.start() - 37 for match in re.finditer(rb"\x04\0\0\0zstd", data)]


def test_an_unfinished_recording_gives_all_that_was_synced(unfinished: Made) -> None:
    recording = read_recording(unfinished.path)
    assert len(list(recording)) == unfinished.synced[-1][1] == 39
    assert recording.metadata["incident"] == "test"
    assert not recording.report.finished
    assert not recording.report.complete
    assert recording.report.damages == []
    assert "unfinished" in str(recording.report)


def test_it_can_be_read_twice(unfinished: Made) -> None:
    recording = read_recording(unfinished.path)
    assert list(recording) == list(recording)
    assert recording.report.message_count == 39


def test_of_a_torn_last_chunk_it_says_what_was_lost(unfinished: Made, copy: Path) -> None:
    size, _ = unfinished.synced[1]
    torn_at = size + 40
    copy.write_bytes(copy.read_bytes()[:torn_at])
    recording = read_recording(copy)
    assert list(recording) == unfinished.messages[: unfinished.synced[1][1]]
    assert [(d.offset_bytes, d.length_bytes) for d in recording.report.damages] == [(size, 40)]
    assert f"40 bytes lost at {size}: broken off" in str(recording.report)


def test_zeros_at_the_end_as_after_a_power_cut_are_no_messages(
    unfinished: Made, copy: Path
) -> None:
    with copy.open("ab") as file:
        file.write(bytes(10_000))
    recording = read_recording(copy)
    assert list(recording) == unfinished.messages
    assert [damage.length_bytes for damage in recording.report.damages] == [10_000]


@pytest.mark.parametrize("chunk", [0, 1, 2])
@pytest.mark.parametrize("into_the_chunk", [0, 3, 30, 37, 60])
def test_a_damaged_chunk_costs_only_itself(
    unfinished: Made, copy: Path, chunk: int, into_the_chunk: int
) -> None:
    data = bytearray(copy.read_bytes())
    position = chunk_starts(data)[chunk] + into_the_chunk
    data[position : position + 8] = bytes(byte ^ 0xFF for byte in data[position : position + 8])
    copy.write_bytes(data)
    recording = read_recording(copy)
    first, last = ([0] + [count for _, count in unfinished.synced])[chunk : chunk + 2]
    assert list(recording) == unfinished.messages[:first] + unfinished.messages[last:]
    assert len(recording.report.damages) == 1
    assert not recording.report.complete


def test_a_hole_across_chunks_is_passed_over(unfinished: Made, copy: Path) -> None:
    data = bytearray(copy.read_bytes())
    first, second, third = chunk_starts(data)
    data[first + 100 : second + 100] = bytes(second - first)
    copy.write_bytes(data)
    recording = read_recording(copy)
    assert list(recording) == unfinished.messages[unfinished.synced[1][1] :]
    damages = recording.report.damages
    assert damages[0].offset_bytes == first
    assert sum(damage.length_bytes for damage in damages) == third - first


def test_a_finished_recording_knows_if_anything_was_altered(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    file = RecordingFile(path, {"particles": "4000"})
    file.put("some/key", b"payload", 5)
    file.finish()
    path.write_bytes(path.read_bytes().replace(b"4000", b"5000", 1))
    recording = read_recording(path)
    assert len(list(recording)) == 1
    assert "altered outside its messages, of which none is lost" in str(recording.report)
    assert "bytes lost" not in str(recording.report)
    assert not recording.report.complete


def test_drops_and_the_end_are_told(tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "a.mcap", {})
    file.put("some/key", b"payload", 5)
    file.mark_dropped(3)
    file.mark_dropped(7)
    file.mark_end(1234)
    file.finish()
    recording = read_recording(tmp_path / "a.mcap")
    assert len(list(recording)) == 1
    assert recording.report.dropped_count == 7
    assert recording.report.end_ns == 1234
    assert not recording.report.complete
    assert "7 messages dropped" in str(recording.report)


@pytest.mark.parametrize(
    ("contents", "complaint"),
    [
        (b"", "is empty"),
        (b"\x89MCAP", "is not an MCAP file"),
        (b"timestamp,x,y,z\n1,2,3,4\n", "is not an MCAP file"),
    ],
)
def test_what_is_no_recording_is_refused(tmp_path: Path, contents: bytes, complaint: str) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(contents)
    with pytest.raises(RecordingError, match=rf"a\.csv: {complaint}"):
        read_recording(path)


def test_what_is_not_there_or_no_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"a\.mcap: cannot be read \(No such file"):
        read_recording(tmp_path / "a.mcap")
    with pytest.raises(RecordingError, match=r"has no recording"):
        read_recording(tmp_path)


def test_metadata_of_another_program_is_no_reason_to_fail(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    file = RecordingFile(path, {})
    file.put("some/key", b"payload", 5)
    file.finish()
    name = b"\x0c\0\0\0clew.channel"
    assert name in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(b"\x02\0\0\0id", b"\x02\0\0\0ID", 1))
    recording = read_recording(path)
    assert len(list(recording)) == 1
    assert "was not written by Clew" in str(recording.report)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    path = tmp_path / "pipe.mcap"
    os.mkfifo(path)
    with pytest.raises(RecordingError, match="is a pipe"):
        read_recording(path)
