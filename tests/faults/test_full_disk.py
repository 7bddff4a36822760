"""A disk that is really full: the post goes on, says so, and has all on it once there is room."""

from __future__ import annotations

import random
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from command_post.recorder.recording import Recorder
from shared.mcap_reader import read_recording
from tests.faults.small_disk import small_disk, why_no_disk
from tests.waiting import wait_for

DISK_BYTES = 1 << 20
NO_DISK = why_no_disk()


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    if NO_DISK is not None:
        pytest.skip(NO_DISK)
    with small_disk(tmp_path, DISK_BYTES):
        yield tmp_path


def noise(count: int) -> list[bytes]:
    """Return messages of a kilobyte each that cannot be packed."""
    chance = random.Random(3)  # noqa: S311
    return [chance.randbytes(1000) for _ in range(count)]


def test_what_came_while_the_disk_was_full_is_on_it_afterwards(disk: Path) -> None:
    ballast = disk / "ballast"
    ballast.write_bytes(bytes(DISK_BYTES * 3 // 4))
    sent = noise(600)
    with Recorder(disk / "a.mcap", {}, retry_s=0.05) as recorder:
        for number, payload in enumerate(sent[:500]):
            assert recorder.put("some/key", payload, number)
        wait_for(lambda: recorder.status().fault, "the disk to be full", 60.0)
        assert "No space left on device" in str(recorder.status().fault)
        assert recorder.safe < 500
        ballast.unlink()
        wait_for(lambda: recorder.status().fault is None, "the disk to be used again", 60.0)
        for number, payload in enumerate(sent[500:], 500):
            assert recorder.put("some/key", payload, number)
    assert recorder.status() == (0, 600, 0, None)
    recording = read_recording(disk / "a.mcap")
    assert [message.payload for message in recording] == sent
    assert recording.report.complete


def test_a_disk_that_stays_full_leaves_a_recording_that_is_gone_on_with(disk: Path) -> None:
    sent = noise(1500)
    with Recorder(disk / "a.mcap", {}, retry_s=0.05) as recorder:
        for number, payload in enumerate(sent):
            assert recorder.put("some/key", payload, number)
        wait_for(lambda: recorder.status().fault, "the disk to be full", 60.0)
        safe = recorder.safe
    status = recorder.status()
    assert status.fault is not None
    assert status.dropped == 1500 - status.written > 0
    part = disk / "a.mcap.part"
    found = [message.payload for message in read_recording(part)]
    assert found == sent[: len(found)]
    assert len(found) >= safe
    # With more room the next post goes on with it.
    subprocess.run(["mount", "-o", f"remount,size={8 * DISK_BYTES}", str(disk)], check=True)
    with Recorder(disk / "a.mcap", {}, resume=True) as recorder:
        assert recorder.unfinished == part
        for number, payload in enumerate(sent[len(found) :], len(found)):
            assert recorder.put("some/key", payload, number)
    assert [message.payload for message in read_recording(disk / "a.mcap")] == sent


def test_a_disk_that_can_only_be_read_is_refused_in_clear_words(disk: Path) -> None:
    subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
    with pytest.raises(RuntimeError, match=r"cannot be written \(Read-only file system\)"):
        Recorder(disk / "a.mcap", {})
