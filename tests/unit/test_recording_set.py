"""A recording in parts is one recording, whatever happens where a part ends and the next begins."""

from __future__ import annotations

import errno
import itertools
import os
import shutil
from pathlib import Path

import pytest
from mcap.reader import make_reader

from command_post.recorder.file import RecorderError, RecordingFile
from command_post.recorder.mirror import Mirror
from command_post.recorder.parts import RecordingSet, Rotation
from command_post.recorder.recording import SYNC_PERIOD_NS, RecordedIncident, Recorder
from command_post.recorder.salvage import salvage
from command_post.recorder.verification import verify_recording
from command_post.replay import replay
from shared.mcap_index import IndexedRecording
from shared.mcap_reader import RecordedMessage, RecordingError, read_recording
from shared.recording_parts import files_of, part_path, parts_of
from shared.units import NS_PER_S
from tests.faults.torn import TornRotation
from tests.traffic import START_NS, STRIDE_NS, Sent, Tally, key_of, traffic
from tests.waiting import wait_for

ABOUT = {"incident": "test"}
NEVER_NS = 10**18
SMALL = Rotation(8_000, NEVER_NS)
SENT = list(traffic(60))


def in_parts(path: Path, rotation: Rotation = SMALL, mirror: Mirror | None = None) -> Path:
    """Record what an incident hears and makes of it, synced with every message; end it."""
    file = RecordingSet(path, ABOUT, mirror=mirror, rotation=rotation)
    incident = RecordedIncident(Tally(), file)
    for now_ns, key, payload in SENT:
        incident.handle(key, payload, now_ns)
        file.sync()
        file.rotate_if_due()
    incident.finish(now_ns)
    file.finish()
    return path


def in_one(path: Path) -> list[RecordedMessage]:
    return list(read_recording(in_parts(path, Rotation(1 << 40, NEVER_NS))))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> list[RecordedMessage]:
    return in_one(tmp_path_factory.mktemp("whole") / "a.mcap")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return in_parts(tmp_path_factory.mktemp("parts") / "a.mcap", mirror=Mirror(None))


@pytest.fixture
def parts(made: Path, tmp_path: Path) -> list[Path]:
    shutil.copytree(made.parent, tmp_path, dirs_exist_ok=True)
    return [each.path for each in parts_of(tmp_path / made.name)]


def test_its_parts_are_read_as_one_and_each_by_itself(
    made: Path, whole: list[RecordedMessage]
) -> None:
    names = [each.path.name for each in parts_of(made)]
    assert names[:2] == ["a.mcap", "a.part002.mcap"]
    assert len(names) > 3
    for path in (made, made.parent):
        recording = read_recording(path)
        assert list(recording) == whole
        assert recording.report.complete
        assert replay(path, Tally()).identical
        assert verify_recording(path).whole
    counts = []
    for part in parts_of(made):
        with part.path.open("rb") as stream:
            seen = list(make_reader(stream, validate_crcs=True).iter_messages())
        counts.append(sum("derived" not in channel.metadata for _, channel, _ in seen))
        assert any("derived" in channel.metadata for _, channel, _ in seen)
    assert sum(counts) == len(whole)
    assert min(counts) > 0
    with IndexedRecording([each.path for each in parts_of(made)]) as indexed:
        assert sum(1 for _ in indexed.located(indexed.series)) == len(whole)
        assert not indexed.gone.continued


def test_a_part_lasts_no_longer_than_it_may(tmp_path: Path) -> None:
    path = in_parts(tmp_path / "a.mcap", Rotation(1 << 40, 10 * NS_PER_S))
    spans_s = [
        (times[-1] - times[0]) / NS_PER_S
        for times in (
            [m.log_time_ns for m in RecordingOf(part)] for part in files_of(path).values()
        )
    ]
    assert len(spans_s) == 6
    assert max(spans_s) < 10.0 + STRIDE_NS / NS_PER_S


class RecordingOf:
    """The messages of one part alone."""

    def __init__(self, path: Path) -> None:
        self._path = path.with_name(f"alone-{path.name.replace('.part', '-')}")
        shutil.copyfile(path, self._path)

    def __iter__(self) -> itertools.chain[RecordedMessage]:
        return itertools.chain(read_recording(self._path))


def test_a_missing_part_is_told_and_the_others_are_read(
    parts: list[Path], whole: list[RecordedMessage]
) -> None:
    parts[1].unlink()
    recording = read_recording(parts[0])
    found = list(recording)
    remaining = iter(whole)
    assert all(message in remaining for message in found)
    assert 0 < len(found) < len(whole)
    assert "part 2 is missing" in str(recording.report)
    assert not verify_recording(parts[0]).whole


def test_without_its_last_part_it_is_not_finished(parts: list[Path]) -> None:
    parts[-1].unlink()
    recording = read_recording(parts[0])
    assert list(recording)
    assert not recording.report.finished


def test_a_later_part_is_read_from_there_on(
    parts: list[Path], whole: list[RecordedMessage]
) -> None:
    recording = read_recording(parts[2])
    found = list(recording)
    assert found == whole[-len(found) :]
    assert "what is before it was not read" in str(recording.report)


def test_a_changed_byte_in_any_part_is_told(parts: list[Path]) -> None:
    data = bytearray(parts[1].read_bytes())
    data[len(data) // 2] ^= 1
    parts[1].write_bytes(data)
    told = verify_recording(parts[0])
    assert not told.whole
    assert [each.follows for each in told.files] == [True, True, False, *[True] * (len(parts) - 3)]


def test_salvage_makes_one_of_it(
    parts: list[Path], whole: list[RecordedMessage], tmp_path: Path
) -> None:
    (tmp_path / "new").mkdir()
    salvage(tmp_path, tmp_path / "new" / "b.mcap")
    assert list(read_recording(tmp_path / "new")) == whole


def test_a_folder_of_several_recordings_is_refused(parts: list[Path]) -> None:
    shutil.copyfile(parts[0], parts[0].with_name("b.mcap"))
    with pytest.raises(RecordingError, match=r"several recordings \(a.mcap, b.mcap\)"):
        read_recording(parts[0].parent)


def test_cut_anywhere_where_one_part_follows_another_nothing_synced_is_lost(
    tmp_path: Path,
) -> None:
    torn = TornRotation(tmp_path)
    found = torn.wrong(torn.on_disk(23))
    assert found["cuts"] > 50
    assert found["lost"] == found["not whole"] == 0


def test_it_is_gone_on_with_by_the_recorder(tmp_path: Path, whole: list[RecordedMessage]) -> None:
    seconds = itertools.count()
    for first in range(0, len(SENT), 50):
        recorder = Recorder(
            tmp_path / "a.mcap", ABOUT, resume=True, rotation=SMALL,
            monotonic_ns=lambda: next(seconds) * SYNC_PERIOD_NS,
        )  # fmt: skip
        for now_ns, key, payload in SENT[first : first + 50]:
            recorder.put(key, payload, now_ns)
        if first + 50 < len(SENT):
            recorder.__exit__(LookupError, LookupError(), None)
    recorder.close()
    recording = read_recording(tmp_path)
    assert [Sent(m.log_time_ns, m.key, m.payload) for m in recording] == SENT
    assert recording.report.complete
    assert len(recording.parts) > 2
    assert verify_recording(tmp_path).whole


@pytest.mark.parametrize("what", ["finish", "__init__", "mark_continued"])
def test_a_disk_that_fails_between_two_parts_costs_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    failures = 3
    original = getattr(RecordingFile, what)
    seconds = itertools.count()
    recorder = Recorder(
        tmp_path / "a.mcap", ABOUT, rotation=SMALL, retry_s=0.01,
        monotonic_ns=lambda: next(seconds) * SYNC_PERIOD_NS,
    )  # fmt: skip

    def fail_at_first(file: RecordingFile, *arguments: object, **more: object) -> object:
        nonlocal failures
        failures -= 1
        if failures >= 0:
            full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            if what == "__init__":
                raise RecorderError("full") from full
            raise full
        return original(file, *arguments, **more)

    monkeypatch.setattr(RecordingFile, what, fail_at_first)
    for now_ns, key, payload in SENT:
        recorder.put(key, payload, now_ns)
    wait_for(lambda: failures < 0 and recorder.status().fault is None, "the disk")
    wait_for(lambda: recorder.safe == len(SENT), "all to be written")
    recorder.close()
    recording = read_recording(tmp_path / "a.mcap")
    assert [Sent(m.log_time_ns, m.key, m.payload) for m in recording] == SENT
    assert recording.report.complete
    assert verify_recording(tmp_path / "a.mcap").whole


def test_what_was_dropped_is_told_in_every_part_since(tmp_path: Path) -> None:
    file = RecordingSet(tmp_path / "a.mcap", ABOUT, rotation=Rotation(1, NEVER_NS))
    file.mark_dropped(3)
    for number in range(3):
        file.put(key_of("responder", "r1", "beat"), b"-", START_NS + number)
        file.sync()
        file.rotate_if_due()
    file.abandon()
    again = RecordingSet(tmp_path / "a.mcap", ABOUT, resume=True)
    assert (again.number, again.dropped_before, again.is_resumed) == (4, 3, True)
    again.finish()
    recording = read_recording(tmp_path)
    assert len(list(recording)) == 3
    assert recording.report.dropped_count == 3


def test_parts_are_not_written_over(made: Path, tmp_path: Path, parts: list[Path]) -> None:
    with pytest.raises(RecorderError, match="is there already"):
        RecordingSet(parts[0], ABOUT)
    with pytest.raises(RecorderError, match="is there already"):
        RecordingSet(parts[0], ABOUT, resume=True)
    with pytest.raises(RecorderError, match="a name for a later part"):
        RecordingSet(part_path(tmp_path / "b.mcap", 2), ABOUT)
