"""The recorder never makes anyone wait, loses a second at most, and says what it lost."""

from __future__ import annotations

import errno
import itertools
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from command_post.recorder.file import RecordingFile
from command_post.recorder.recording import SYNC_PERIOD_NS, Recorder
from shared.mcap_reader import read_recording
from tests.traffic import traffic

PATIENCE_S = 30.0


def wait_until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline_s


def hurried() -> Callable[[], int]:
    """Return a clock on which every look finds the next sync due."""
    seconds = itertools.count()
    return lambda: next(seconds) * SYNC_PERIOD_NS


class Gate:
    """Stands before the file: the recorder's thread waits there until it is opened."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.reached = threading.Event()
        self.opened = threading.Event()
        put = RecordingFile.put

        def put_when_open(
            file: RecordingFile, key: str, payload: bytes, time_ns: int, *, outgoing: bool = False
        ) -> None:
            self.reached.set()
            assert self.opened.wait(PATIENCE_S)
            put(file, key, payload, time_ns, outgoing=outgoing)

        monkeypatch.setattr(RecordingFile, "put", put_when_open)


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> Iterator[Gate]:
    gate = Gate(monkeypatch)
    yield gate
    gate.opened.set()


def test_all_that_is_put_is_in_the_finished_file(tmp_path: Path) -> None:
    sent = list(traffic(300))
    with Recorder(tmp_path / "a.mcap", {"incident": "test"}) as recorder:
        for time_ns, key, payload in sent:
            recorder.put(key, payload, time_ns)
    recording = read_recording(tmp_path / "a.mcap")
    assert [(m.log_time_ns, m.key, m.payload) for m in recording] == sent
    assert recording.report.complete
    assert recorder.status() == (0, len(sent), 0, None)
    assert recorder.close() == recorder.status()


def test_after_an_error_it_is_left_to_be_gone_on_with(tmp_path: Path) -> None:
    sent = list(traffic(5))
    recorder = Recorder(tmp_path / "a.mcap", {})
    for time_ns, key, payload in sent:
        recorder.put(key, payload, time_ns)
    recorder.__exit__(LookupError, LookupError(), None)
    assert not (tmp_path / "a.mcap").exists()
    with Recorder(tmp_path / "a.mcap", {}, resume=True) as recorder:
        assert recorder.unfinished is not None
        assert len(list(read_recording(recorder.unfinished))) == len(sent)


def test_messages_over_the_bound_are_dropped_counted_and_told(tmp_path: Path, gate: Gate) -> None:
    recorder = Recorder(tmp_path / "a.mcap", {}, queue_messages=5)
    recorder.put("key", b"0", 0)
    assert gate.reached.wait(PATIENCE_S)
    for number in range(1, 20):
        recorder.put("key", b"%d" % number, number)
    assert recorder.status() == (5, 0, 14, None)
    gate.opened.set()
    assert recorder.close() == (0, 6, 14, None)
    recording = read_recording(tmp_path / "a.mcap")
    assert [message.payload for message in recording] == [b"0", b"1", b"2", b"3", b"4", b"5"]
    assert recording.report.dropped_count == 14


def test_the_queue_is_bounded_in_bytes_too(tmp_path: Path, gate: Gate) -> None:
    recorder = Recorder(tmp_path / "a.mcap", {}, queue_bytes=1000)
    recorder.put("key", b"first", 0)
    assert gate.reached.wait(PATIENCE_S)
    for size in (600, 600, 400, 1):
        recorder.put("key", bytes(size), 0)
    assert recorder.status() == (2, 0, 2, None)
    gate.opened.set()
    recorder.close()
    assert [len(m.payload) for m in read_recording(tmp_path / "a.mcap")] == [5, 600, 400]


def test_drops_are_told_in_an_unfinished_recording_too(tmp_path: Path, gate: Gate) -> None:
    recorder = Recorder(tmp_path / "a.mcap", {}, queue_messages=1, monotonic_ns=hurried())
    recorder.put("key", b"0", 0)
    assert gate.reached.wait(PATIENCE_S)
    recorder.put("key", b"1", 0)
    recorder.put("key", b"2", 0)
    gate.opened.set()
    wait_until(lambda: recorder.status().written >= 1)
    recorder.put("key", b"after", 0)
    wait_until(lambda: recorder.status().written >= 2)
    unfinished = read_recording(tmp_path / "a.mcap.part")
    assert [message.payload for message in unfinished][:1] == [b"0"]
    assert unfinished.report.dropped_count >= 1
    recorder.close()


def test_when_the_disk_fails_the_program_goes_on_and_the_record_so_far_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = Recorder(tmp_path / "a.mcap", {}, monotonic_ns=hurried())
    recorder.put("key", b"safe", 0)
    synced = read_recording(tmp_path / "a.mcap.part")
    wait_until(lambda: [message.payload for message in synced] == [b"safe"])

    def fail(_: RecordingFile) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(RecordingFile, "sync", fail)
    recorder.put("key", b"too much", 0)
    wait_until(lambda: recorder.status().fault is not None)
    recorder.put("key", b"later", 0)
    status = recorder.close()
    assert "No space left on device" in (status.fault or "")
    assert "a.mcap" in (status.fault or "")
    assert status.dropped == 2
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.mcap.part"]
    assert next(m.payload for m in read_recording(tmp_path / "a.mcap.part")) == b"safe"


class FailingDisk:
    """The sync of every file fails while ``why`` is set."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.why: int | None = None
        self.failures = 0
        sync = RecordingFile.sync

        def sync_or_fail(file: RecordingFile) -> None:
            if self.why is not None:
                self.failures += 1
                raise OSError(self.why, os.strerror(self.why))
            sync(file)

        monkeypatch.setattr(RecordingFile, "sync", sync_or_fail)


@pytest.mark.parametrize("why", [errno.ENOSPC, errno.EROFS, errno.EIO])
def test_once_the_disk_recovers_nothing_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, why: int
) -> None:
    disk = FailingDisk(monkeypatch)
    sent = list(traffic(30))
    recorder = Recorder(tmp_path / "a.mcap", {}, retry_s=0.01, monotonic_ns=hurried())
    for time_ns, key, payload in sent[:30]:
        recorder.put(key, payload, time_ns)
    wait_until(lambda: recorder.safe == 30)
    disk.why = why
    for time_ns, key, payload in sent[30:60]:
        recorder.put(key, payload, time_ns)
    wait_until(lambda: disk.failures > 3)
    status = recorder.status()
    assert os.strerror(why) in (status.fault or "")
    assert (status.dropped, recorder.safe, recorder.taken) == (0, 30, 60)
    assert not recorder.has_room
    disk.why = None
    wait_until(lambda: recorder.safe == 60)
    wait_until(lambda: recorder.status().fault is None)
    assert recorder.has_room
    for time_ns, key, payload in sent[60:]:
        recorder.put(key, payload, time_ns)
    assert recorder.close() == (0, len(sent), 0, None)
    assert recorder.safe == len(sent)
    recording = read_recording(tmp_path / "a.mcap")
    assert [(m.log_time_ns, m.key, m.payload) for m in recording] == sent
    assert recording.report.complete


def _is_safe(recorder: Recorder, count: int) -> bool:
    return recorder.safe == count


@pytest.mark.parametrize("elsewhere", [False, True], ids=["removed", "moved"])
def test_a_recording_that_is_removed_while_in_use_is_written_anew(
    tmp_path: Path, elsewhere: bool
) -> None:
    sent = list(traffic(30))
    part = tmp_path / "a.mcap.part"
    with Recorder(tmp_path / "a.mcap", {}, monotonic_ns=hurried()) as recorder:
        for number, (time_ns, key, payload) in enumerate(sent):
            if number in {20, 50}:
                wait_until(partial(_is_safe, recorder, number))
                part.rename(tmp_path / "b") if elsewhere else part.unlink()
            recorder.put(key, payload, time_ns)
        wait_until(lambda: recorder.safe == len(sent))
        assert [m[2] for m in sent] == [m.payload for m in read_recording(part)]
        part.unlink()
    recording = read_recording(tmp_path / "a.mcap")
    assert [(m.log_time_ns, m.key, m.payload) for m in recording] == sent
    assert recording.report.complete


def _cut(part: Path, left_bytes: int) -> None:
    os.truncate(part, left_bytes)


def _overwrite(part: Path, from_bytes: int) -> None:
    with part.open("r+b") as file:
        file.seek(from_bytes)
        file.write(bytes(part.stat().st_size - from_bytes))


@pytest.mark.parametrize("harm", [_cut, _overwrite])
@pytest.mark.parametrize("at_bytes", [0, 600])
def test_a_recording_that_somebody_cuts_is_begun_anew_and_says_what_is_gone(
    tmp_path: Path, harm: Callable[[Path, int], None], at_bytes: int
) -> None:
    sent = list(traffic(30))
    part = tmp_path / "a.mcap.part"
    recorder = Recorder(tmp_path / "a.mcap", {"of": "it"}, retry_s=0.01, monotonic_ns=hurried())
    for number, (time_ns, key, payload) in enumerate(sent):
        if number == 20:
            wait_until(partial(_is_safe, recorder, number))
            harm(part, at_bytes)
        recorder.put(key, payload, time_ns)
    wait_until(lambda: recorder.safe == len(sent))
    assert recorder.begun_anew == 1
    assert recorder.close().fault is None
    recording = read_recording(tmp_path / "a.mcap")
    assert [(m.log_time_ns, m.key, m.payload) for m in recording] == sent[20:]
    assert recording.report.dropped_count == 20
    assert recording.metadata["of"] == "it"
    assert (tmp_path / "a.mcap.part.cut").exists()


def test_what_found_no_room_while_the_disk_failed_is_counted_and_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = FailingDisk(monkeypatch)
    recorder = Recorder(
        tmp_path / "a.mcap", {}, retry_s=0.01, queue_messages=4, monotonic_ns=hurried()
    )
    disk.why = errno.ENOSPC
    recorder.put("key", b"0", 0)
    wait_until(lambda: disk.failures > 1)
    taken = [recorder.put("key", b"%d" % number, number) for number in range(1, 20)]
    disk.why = None
    wait_until(lambda: recorder.status().fault is None)
    assert recorder.put("key", b"after", 99)
    recorder.close()
    recording = read_recording(tmp_path / "a.mcap")
    kept = [b"%d" % number for number, is_kept in enumerate([True, *taken]) if is_kept]
    assert [message.payload for message in recording] == [*kept, b"after"]
    assert recording.report.dropped_count == taken.count(False) >= 15


def test_it_says_what_is_safe_and_never_too_much(tmp_path: Path, gate: Gate) -> None:
    recorder = Recorder(tmp_path / "a.mcap", {}, monotonic_ns=hurried())
    recorder.put("key", b"0", 0)
    recorder.put("key", b"1", 0)
    assert (recorder.taken, recorder.safe) == (2, 0)
    gate.opened.set()
    wait_until(lambda: recorder.safe == 2)
    assert len(list(read_recording(tmp_path / "a.mcap.part"))) == 2
    recorder.close()


KILLED = """
import sys
from pathlib import Path
from command_post.recorder.recording import Recorder
from command_post.recorder.file import RecordingFile
from command_post.recorder.parts import Rotation

clock_ns = 0
put = RecordingFile.put

def put_and_tick(*arguments, **more):
    global clock_ns
    put(*arguments, **more)
    clock_ns += 100_000_000

RecordingFile.put = put_and_tick
parts = Rotation(1, 10**18) if sys.argv[2] == "parts" else None
recorder = Recorder(
    Path(sys.argv[1]), {"incident": "test"}, monotonic_ns=lambda: clock_ns, rotation=parts
)
for number in range(55):
    recorder.put("some/key", b"%d" % number, number * 100_000_000)
while recorder.status().written < 55:
    pass
print("ready", flush=True)
sys.stdin.read()
"""


@pytest.mark.parametrize(("files", "count"), [("one", 1), ("parts", 6)])
def test_a_kill_costs_the_last_second_at_most(tmp_path: Path, files: str, count: int) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", KILLED, str(tmp_path / "a.mcap"), files],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as recording:
        assert recording.stdout is not None
        assert recording.stdout.readline() == b"ready\n"
        recording.kill()
    found = read_recording(tmp_path)
    assert len(found.parts) == count
    assert found.metadata["incident"] == "test"
    assert [message.payload for message in found] == [b"%d" % number for number in range(50)]
    assert not found.report.finished


FULL = """
import resource, sys
from pathlib import Path
from command_post.recorder.recording import Recorder

seconds = iter(range(10_000))
recorder = Recorder(Path(sys.argv[1]), {}, monotonic_ns=lambda: next(seconds) * 10**9)
resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))
noise = Path("/dev/urandom").open("rb")
while recorder.status().fault is None:
    recorder.put("some/key", noise.read(1000), 5)
written = recorder.status().written
for number in range(10):
    recorder.put("some/key", b"lost", 6)
status = recorder.close()
print(status.fault, written, status.dropped >= 10, sep="|")
"""


def test_a_file_that_may_not_grow_stops_the_record_and_nothing_else(tmp_path: Path) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", FULL, str(tmp_path / "a.mcap")],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    fault, written, dropped = ended.stdout.strip().splitlines()[-1].split("|")
    assert "recording has stopped: [Errno 27] File too large" in fault
    assert dropped == "True"
    found = read_recording(tmp_path / "a.mcap.part")
    kept = [message.payload for message in found]
    assert 20 <= len(kept) <= int(written)
    assert {len(payload) for payload in kept} == {1000}
