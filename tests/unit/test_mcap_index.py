"""A recording read here and there gives what reading it through gives, and says what is damaged."""

from __future__ import annotations

from pathlib import Path

import pytest

from command_post.recorder.file import RecordingFile
from shared.mcap_index import IndexedRecording, Series
from shared.mcap_reader import RecordedMessage, RecordingError, read_recording
from shared.mcap_records import is_finished, mapped
from tests.conftest import CHECKOUT

PATH = CHECKOUT / "recordings" / "four_daps.mcap"


def without_index(tmp_path: Path) -> Path:
    """Return a recording that was broken off before its index."""
    part = tmp_path / "broken_off.mcap.part"
    content = PATH.read_bytes()
    part.write_bytes(content[: int(len(content) * 0.98)])
    with mapped(part) as data:
        assert not is_finished(data)
    return part


@pytest.mark.parametrize("broken_off", [False, True])
def test_all_messages_of_a_key_are_found_in_their_order(tmp_path: Path, broken_off: bool) -> None:
    path = without_index(tmp_path) if broken_off else PATH
    read = list(read_recording(path))
    with IndexedRecording([path]) as indexed:
        assert {each.key for each in indexed.series} == {each.key for each in read}
        tracks = [each for each in indexed.series if each.key.endswith("/track")]
        located = [message for message, _ in indexed.located(tracks)]
        assert located == [each for each in read if each.key.endswith("/track")]
        assert [message for message, _ in indexed.located(indexed.series)] == read
        assert (indexed.start_ns, indexed.finished) == (read[0].log_time_ns, not broken_off)
        assert indexed.damages == []


def test_the_newest_of_a_key_is_found_at_any_time() -> None:
    read = list(read_recording(PATH))
    with IndexedRecording([PATH]) as indexed:
        for series in indexed.series:
            of_key = [each for each in read if (each.key, each.outgoing) == series]
            assert indexed.first_ns(series) == of_key[0].log_time_ns
            assert indexed.newest(series, of_key[0].log_time_ns - 1) is None
            for at in (of_key[0], of_key[len(of_key) // 2], of_key[-1]):
                assert _newest(indexed, series, at.log_time_ns) == _last(of_key, at.log_time_ns)
                assert indexed.newest_ns(series, at.log_time_ns) == at.log_time_ns
        assert indexed.newest(Series("of/nobody", outgoing=False), read[-1].log_time_ns) is None


def test_a_located_message_is_found_again() -> None:
    with IndexedRecording([PATH]) as indexed:
        for message, spot in indexed.located(indexed.series[:3]):
            assert indexed.payload(spot) == message.payload


def test_a_damaged_chunk_is_passed_over_and_told(tmp_path: Path) -> None:
    content = bytearray(PATH.read_bytes())
    content[content.find(b"zstd") + 500] ^= 0xFF
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content)
    read = list(read_recording(path))
    with IndexedRecording([path]) as indexed:
        assert [message for message, _ in indexed.located(indexed.series)] == read
        assert len(indexed.damages) == len({each.offset_bytes for each in indexed.damages}) == 1


def test_an_index_that_is_damaged_is_done_without(tmp_path: Path) -> None:
    content = bytearray(PATH.read_bytes())
    content[-200] ^= 0xFF
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content)
    with IndexedRecording([path]) as indexed, IndexedRecording([PATH]) as whole:
        assert [one for one, _ in indexed.located(indexed.series)] == [
            one for one, _ in whole.located(whole.series)
        ]


def test_files_of_one_incident_are_read_as_one(tmp_path: Path) -> None:
    read = list(read_recording(PATH))
    half = len(read) // 2
    paths = [tmp_path / "a.mcap", tmp_path / "b.mcap"]
    for path, part in zip(paths, (read[:half], read[half:]), strict=True):
        file = RecordingFile(path, {"incident_settings": "{}"})
        for each in part:
            file.put(each.key, each.payload, each.log_time_ns, outgoing=each.outgoing)
        file.finish()
    with IndexedRecording(paths) as indexed:
        assert [one for one, _ in indexed.located(indexed.series)] == read
        assert indexed.end_ns == read[-1].log_time_ns


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("no MCAP")
    with pytest.raises(RecordingError, match="not an MCAP file"):
        IndexedRecording([path])


def _newest(indexed: IndexedRecording, series: Series, at_ns: int) -> RecordedMessage | None:
    found = indexed.newest(series, at_ns)
    return None if found is None else found[0]


def _last(messages: list[RecordedMessage], at_ns: int) -> RecordedMessage:
    return [each for each in messages if each.log_time_ns <= at_ns][-1]
