"""Recordings as a reader has them that shares no code with us: Rerun's, written in Rust."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from command_post.recorder.file import RecordingFile
from command_post.recorder.mirror import Mirror
from command_post.recorder.parts import Rotation
from command_post.recorder.salvage import salvage
from shared.mcap_reader import read_recording
from shared.recording_parts import parts_of
from shared.units import NS_PER_S
from tests.gateways.test_foxglove import ORIGIN
from tests.unit.test_recording_set import ABOUT, in_parts

RERUN = shutil.which("rerun", path=f"{Path(sys.executable).parent}:{os.environ.get('PATH', '')}")
pytestmark = pytest.mark.skipif(
    RERUN is None, reason="no rerun in this environment: pip install 'clew[readers]'"
)

LONG = Rotation(1 << 40, 10**6 * NS_PER_S)
LOOKS = ("frame", "location", "scene")
TOPIC = re.compile(r"(?P<status>\w+) +\d+ +\d+ +(?P<topic>\S+)")


def rerun(what: str, path: Path) -> subprocess.CompletedProcess[str]:
    assert RERUN is not None
    # What it notes of its user goes with the test.
    own = {**os.environ, "HOME": str(path.parent), "XDG_CONFIG_HOME": str(path.parent)}
    return subprocess.run(
        [RERUN, "mcap", what, str(path)], capture_output=True, text=True, check=False, env=own,
        timeout=60,
    )  # fmt: skip


def checked(path: Path) -> dict[str, str]:
    """Return what it finds of each topic; it must find the file whole."""
    found = rerun("check", path)
    assert found.returncode == 0, found.stderr
    return {each["topic"]: each["status"] for each in TOPIC.finditer(found.stdout)}


def messages_in(path: Path) -> int:
    told = re.search(r"Messages +(\d+)", rerun("info", path).stdout)
    assert told is not None
    return int(told[1])


@pytest.fixture
def fresh(tmp_path: Path) -> Path:
    return in_parts(tmp_path / "a.mcap", LONG, Mirror(ORIGIN))


def is_as_we_read_it(path: Path) -> bool:
    recording = read_recording(path)
    count = sum(1 for _ in recording)
    return messages_in(path) == count + recording.report.derived_count


def test_a_fresh_recording_is_whole(fresh: Path) -> None:
    topics = checked(fresh)
    drawn = {name for name in topics if name.startswith("/")}
    assert drawn == {
        "/map",
        *(f"/responders/{who}/{what}" for who in ("r1", "r2") for what in LOOKS),
    }
    assert {topics[name] for name in drawn} == {"ok"}
    assert any(name.endswith("/increment") for name in topics)
    assert is_as_we_read_it(fresh)


def test_one_that_was_broken_off_is_not_and_salvaged_it_is(fresh: Path, tmp_path: Path) -> None:
    broken, new = tmp_path / "broken.mcap", tmp_path / "new.mcap"
    broken.write_bytes(fresh.read_bytes()[: fresh.stat().st_size // 2])
    assert rerun("check", broken).returncode != 0
    salvage(broken, new, Mirror(ORIGIN))
    assert "ok" in checked(new).values()
    assert is_as_we_read_it(new)


def test_one_that_was_gone_on_with_after_a_kill_is_whole(fresh: Path, tmp_path: Path) -> None:
    path, part = tmp_path / "b.mcap", tmp_path / "b.mcap.part"
    part.write_bytes(fresh.read_bytes()[: fresh.stat().st_size // 2])
    everything, kept = (list(read_recording(each)) for each in (fresh, part))
    file = RecordingFile(path, ABOUT, resume=True, mirror=Mirror(ORIGIN))
    for each in everything[len(kept) :]:
        file.put(each.key, each.payload, each.log_time_ns, outgoing=each.outgoing)
    file.finish()
    assert file.is_resumed
    assert 0 < len(kept) < len(everything)
    assert "ok" in checked(path).values()
    assert is_as_we_read_it(path)


def test_each_part_is_whole_by_itself(tmp_path: Path) -> None:
    parts = parts_of(in_parts(tmp_path / "a.mcap", mirror=Mirror(None)))
    assert len(parts) > 3
    for part in parts:
        topics = checked(part.path)
        assert topics["/responders/r1/scene"] == "ok"
