"""Whatever happens to the bytes of a recording, its whole chunks come back, and nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from command_post.recorder.file import RecordingFile
from shared.mcap_reader import RecordedMessage, Recording, RecordingError, read_recording
from tests.traffic import traffic

CHUNKS = 4
MAGIC = b"\x89MCAP0\r\n"


class Sample:
    """A recording of four chunks, finished or not."""

    def __init__(self, path: Path, *, finished: bool) -> None:
        file = RecordingFile(path, {"incident": "test"})
        part = path.with_name(f"{path.name}.part")
        sent = list(traffic(12))
        self.sizes = [(part.stat().st_size, 0)]
        for number, (time_ns, key, payload) in enumerate(sent, 1):
            file.put(key, payload, time_ns)
            if number % -(-len(sent) // CHUNKS) == 0 or number == len(sent):
                file.sync()
                self.sizes.append((part.stat().st_size, number))
        if finished:
            file.finish()
        else:
            file.abandon()
        self.data = (path if finished else part).read_bytes()
        self.messages = list(read_recording(path if finished else part))


@pytest.fixture(scope="module", params=[True, False], ids=["finished", "unfinished"])
def sample(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Sample:
    folder = tmp_path_factory.mktemp("recording")
    return Sample(folder / "a.mcap", finished=request.param)


@contextmanager
def recording_of(data: bytes) -> Iterator[Recording]:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.mcap"
        path.write_bytes(data)
        yield read_recording(path)


def without_one_chunk(sample: Sample) -> list[list[RecordedMessage]]:
    counts = [count for _, count in sample.sizes]
    return [sample.messages[:first] + sample.messages[last:] for first, last in pairwise(counts)]


@given(choice=st.data())
def test_a_recording_cut_anywhere_gives_all_whole_chunks(
    sample: Sample, choice: st.DataObject
) -> None:
    size = choice.draw(st.integers(len(MAGIC), len(sample.data) - 1))
    with recording_of(sample.data[:size]) as recording:
        found = list(recording)
    whole = max(count for synced, count in sample.sizes if synced <= max(size, sample.sizes[0][0]))
    assert found == sample.messages[: len(found)]
    assert len(found) >= whole
    assert not recording.report.complete


@given(choice=st.data())
def test_a_changed_byte_costs_one_chunk_at_most_and_is_told(
    sample: Sample, choice: st.DataObject
) -> None:
    position = choice.draw(st.integers(len(MAGIC), len(sample.data) - 1))
    flip = choice.draw(st.integers(1, 255))
    data = bytearray(sample.data)
    data[position] ^= flip
    with recording_of(bytes(data)) as recording:
        found = list(recording)
    assert found == sample.messages or found in without_one_chunk(sample)
    if found != sample.messages:
        assert not recording.report.complete


@given(junk=st.binary(min_size=1, max_size=300), choice=st.data())
def test_junk_written_over_a_recording_makes_no_messages(
    sample: Sample, junk: bytes, choice: st.DataObject
) -> None:
    position = choice.draw(st.integers(len(MAGIC), len(sample.data) - 1))
    data = bytearray(sample.data)
    data[position : position + len(junk)] = junk
    with recording_of(bytes(data)) as recording:
        found = list(recording)
    remaining = iter(sample.messages)
    assert all(message in remaining for message in found)


@given(st.binary(max_size=200).filter(lambda junk: not junk.startswith(MAGIC)))
def test_arbitrary_bytes_are_refused(junk: bytes) -> None:
    with pytest.raises(RecordingError, match=r"a\.mcap: "), recording_of(junk):
        pass


@given(st.binary(max_size=200))
def test_arbitrary_bytes_after_the_magic_are_reported(junk: bytes) -> None:
    with recording_of(MAGIC + junk) as recording:
        assert list(recording) == []
    assert not recording.report.complete


@given(choice=st.data())
def test_one_cut_anywhere_is_gone_on_with_behind_all_its_whole_chunks(
    sample: Sample, choice: st.DataObject
) -> None:
    """Most cuts are tried where the last chunk is, with its indexes and the file's ending."""
    last_chunk_at = sample.sizes[-2][0]
    size = choice.draw(
        st.integers(0, len(sample.data) - 1) | st.integers(last_chunk_at, len(sample.data) - 1)
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.mcap"
        path.with_name("a.mcap.part").write_bytes(sample.data[:size])
        file = RecordingFile(path, {"incident": "test"}, resume=True)
        for time_ns, key, payload in traffic(3):
            file.put(key, payload, time_ns)
        file.finish()
        recording = read_recording(path)
        found = list(recording)
        with path.open("rb") as stream:
            indexed = list(make_reader(stream, validate_crcs=True).iter_messages())
    kept = found[: -len(list(traffic(3)))]
    whole = max([count for synced, count in sample.sizes if synced <= size], default=0)
    assert kept == sample.messages[: len(kept)]
    assert len(kept) >= whole
    assert recording.report.complete
    assert len(indexed) == len(found)


def test_a_power_cut_at_every_byte_of_the_last_chunk_takes_no_more_than_that_chunk(
    sample: Sample, tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    part = tmp_path / "a.mcap.part"
    (last_chunk_at, whole), (end, count) = sample.sizes[-2:]
    kept_counts = []
    for size in range(last_chunk_at, end + 1):
        part.write_bytes(sample.data[:size])
        RecordingFile(path, {"incident": "test"}, resume=True).abandon()
        kept = list(read_recording(part))
        assert kept == sample.messages[: len(kept)]
        kept_counts.append(len(kept))
    assert set(kept_counts) == {whole, count}
    assert kept_counts == sorted(kept_counts)
