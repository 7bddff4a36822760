"""What is rare in a recording is cheap to read: by its index, of the bytes of its own chunks."""

from __future__ import annotations

from pathlib import Path

from command_post.recorder.mirror import Mirror
from tests.benchmarks.long_recording import ORIGIN, read_alerts, record


def test_alerts_are_read_without_what_is_between_them(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    record(path, responders=12, minutes=3.2, mirror=Mirror(ORIGIN))
    rare = read_alerts(path)
    size = path.stat().st_size
    assert rare.alerts == 3
    assert rare.read_bytes - rare.index_bytes < size / 30
    assert rare.read_bytes < size / 4
