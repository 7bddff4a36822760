"""Exercises without a network, broken off: nothing of them is left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from shared.process import ExitCode
from tests.waiting import DEADLINE_S, wait_for

pytestmark = pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs /proc to see processes")

MONTE_CARLO = ("montecarlo", "--scenario", "corridor", "--runs", "20", "--workers", "2")
REHEARSE = ("rehearse", "course", "--output", "course.mcap")


@contextmanager
def at_work(folder: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run ``command-post`` in ``folder``, temporary files too, until nodes write their logs."""
    temporary = folder / "temporary"
    temporary.mkdir()
    with (folder / "said").open("wb") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "command_post", *arguments],
            cwd=folder,
            env={**os.environ, "TMPDIR": str(temporary)},
            stderr=said,
            # As from a terminal, whose Ctrl-C goes to the whole group.
            start_new_session=True,
        )
    try:
        wait_for(lambda: list(temporary.rglob("*.part")), "a wire log to begin")
        yield process
    finally:
        process.kill()
        process.wait()
        for pid in at_work_in(folder):
            os.kill(pid, signal.SIGKILL)


def at_work_in(folder: Path) -> list[int]:
    """Return the processes that work in ``folder``."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                if (entry / "cwd").readlink() == folder:
                    found.append(int(entry.name))
            except OSError:
                continue
    return found


@pytest.mark.parametrize("arguments", [MONTE_CARLO, REHEARSE], ids=["montecarlo", "rehearse"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stopped_by_a_signal_it_leaves_nothing(
    tmp_path: Path, arguments: tuple[str, ...], number: signal.Signals
) -> None:
    with at_work(tmp_path, *arguments) as process:
        if number == signal.SIGINT:
            os.killpg(process.pid, number)
        else:
            process.send_signal(number)
        assert process.wait(DEADLINE_S) == ExitCode.INTERRUPTED
        assert at_work_in(tmp_path) == []
    assert "Traceback" not in (tmp_path / "said").read_text()
    assert {path.name for path in tmp_path.rglob("*")} == {"said", "temporary"}


def test_killed_it_takes_all_its_processes_along(tmp_path: Path) -> None:
    with at_work(tmp_path, *MONTE_CARLO) as process:
        process.kill()
        process.wait()
        wait_for(lambda: not at_work_in(tmp_path), "the end of all its processes")
