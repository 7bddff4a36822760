"""The demo as its user has it: every node a process, stopped, killed and starved."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from command_post.commands.scoring import read_evidence
from command_post.incident import Incident, IncidentSettings
from command_post.replay import replay
from shared.mcap_reader import RecordingError, read_recording
from shared.process import ExitCode
from tests.waiting import wait_for

CORRIDOR = "corridor"
DEMO_DEADLINE_S = 120.0


def demo_arguments(output: Path, scenario: str, speed: float) -> list[str]:
    command = [sys.executable, "-m", "command_post", "demo", "--json"]
    return [*command, "--scenario", scenario, "--speed", str(speed), "--output", str(output)]


@contextmanager
def running_demo(output: Path, speed: float) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(
        demo_arguments(output, CORRIDOR, speed),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def children_of(pid: int) -> dict[str, int]:
    """Return the running children by the name they were given."""
    found = {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdecimal():
            continue
        try:
            status = (entry / "stat").read_text().rpartition(")")[2].split()
            words = (entry / "cmdline").read_bytes().decode().split("\0")
        except OSError:
            continue
        if int(status[1]) == pid and status[0] != "Z" and "--id" in words:
            found[words[words.index("--id") + 1]] = int(entry.name)
    return found


def alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def begun(output: Path) -> bool:
    """Say whether the recording has begun to hold estimates."""
    try:
        recording = read_recording(output / "corridor.mcap.part")
        return any(message.key.endswith("/track") for message in recording)
    except RecordingError:
        return False


linux = pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc to see processes")


def test_a_scenario_runs_to_its_score(tmp_path: Path) -> None:
    ended = subprocess.run(
        demo_arguments(tmp_path, CORRIDOR, 10.0),
        capture_output=True, check=False, timeout=DEMO_DEADLINE_S,
    )  # fmt: skip
    assert ended.returncode == ExitCode.OK, ended.stderr.decode()
    score = json.loads(ended.stdout)
    assert set(score["responders"]) == {"r1", "r2"}
    assert set(score["dap"]["each_m"]) == {"dap2"}
    assert score["live"]["pair"] is not None
    assert score["coverage95_pct"] is not None
    assert json.loads((tmp_path / "corridor.score.json").read_bytes()) == score
    assert (tmp_path / "corridor.png").read_bytes().startswith(b"\x89PNG")
    recording = tmp_path / "corridor.mcap"
    settings = IncidentSettings.from_metadata(read_recording(recording).metadata)
    report = replay(recording, Incident(settings))
    assert report.reading.complete
    assert report.identical, str(report)
    # A post that is behind tells less often: a slow machine's a third of what a fast one's does.
    assert report.equal > 10


@linux
def test_stopped_midway_it_leaves_a_recording_and_no_process(tmp_path: Path) -> None:
    with running_demo(tmp_path, speed=2.0) as process:
        wait_for(lambda: begun(tmp_path), "estimates in the recording", DEMO_DEADLINE_S)
        children = children_of(process.pid)
        assert set(children) == {"post", "dap1", "dap2", "r1", "r2"}
        process.send_signal(signal.SIGINT)
        assert process.wait(20.0) == ExitCode.INTERRUPTED
    assert not any(map(alive, children.values()))
    recording = read_recording(tmp_path / "corridor.mcap")
    assert list(recording)
    assert recording.report.complete


@linux
def test_killed_it_takes_its_nodes_along(tmp_path: Path) -> None:
    with running_demo(tmp_path, speed=1.0) as process:
        wait_for(lambda: begun(tmp_path), "estimates in the recording", DEMO_DEADLINE_S)
        children = children_of(process.pid)
        process.kill()
        for name, pid in children.items():
            wait_for(lambda pid=pid: not alive(pid), f"the end of {name}")  # type: ignore[misc]
    assert list(read_recording(tmp_path / "corridor.mcap"))


@linux
def test_it_goes_on_without_a_responder_who_was_killed(tmp_path: Path) -> None:
    with running_demo(tmp_path, speed=4.0) as process:
        wait_for(lambda: begun(tmp_path), "estimates in the recording", DEMO_DEADLINE_S)
        os.kill(children_of(process.pid)["r1"], signal.SIGKILL)
        out, err = process.communicate(timeout=DEMO_DEADLINE_S)
    assert process.returncode == ExitCode.OK, err.decode()
    assert b"r1 was killed by SIGKILL" in err
    assert json.loads(out)["responders"]["r2"]["live"] is not None
    assert "r1" in read_evidence(tmp_path / "corridor.mcap").tracks("live")


@linux
def test_without_its_post_it_gives_up_and_says_where_to_look(tmp_path: Path) -> None:
    with running_demo(tmp_path, speed=1.0) as process:
        wait_for(lambda: begun(tmp_path), "estimates in the recording", DEMO_DEADLINE_S)
        children = children_of(process.pid)
        os.kill(children["post"], signal.SIGKILL)
        _, err = process.communicate(timeout=DEMO_DEADLINE_S)
    assert process.returncode == ExitCode.FAILURE
    assert b"post was killed by SIGKILL; its log: " in err
    assert f"recording: {tmp_path / 'corridor.mcap.part'}\n".encode() in err
    assert not any(map(alive, children.values()))
    assert list(read_recording(tmp_path / "corridor.mcap.part"))


def test_a_scenario_that_is_not_there_is_said(tmp_path: Path) -> None:
    ended = subprocess.run(
        demo_arguments(tmp_path / "new", "no_such", 1.0), capture_output=True, check=False
    )
    assert ended.returncode == ExitCode.USAGE
    assert b"not packaged" in ended.stderr
    assert not (tmp_path / "new").exists()
