"""Out of reach of every post an agent works on, and what it found arrives later."""

from __future__ import annotations

import signal
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from command_post.fusion.methods import prepare_fusion
from command_post.fusion.settings import FusionSettings
from shared.mcap_reader import read_recording
from shared.process import ExitCode
from tests.bus.test_zenoh import free_endpoint
from tests.faults.hearing import strides_in
from tests.faults.test_killed_nodes import FIRE, running
from tests.waiting import wait_for

LONG_S = 60.0


@pytest.fixture(scope="module", autouse=True)
def _prepared() -> None:
    prepare_fusion(FusionSettings())


def strides_so_far(journal: Path) -> int:
    """Count the strides in a journal that somebody is writing."""
    if not journal.exists():
        return 0
    connection = sqlite3.connect(f"file:{journal}?mode=ro", uri=True)
    try:
        query = "SELECT count(*) FROM message WHERE key LIKE '%/increment'"
        return int(connection.execute(query).fetchone()[0])
    except sqlite3.OperationalError:  # it is just being made
        return 0
    finally:
        connection.close()


def walk(endpoint: str, journal: Path) -> tuple[str, ...]:
    return (
        "edge_agent", "run", "--id", "r1", "--incident", FIRE, "--insecure", "--connect", endpoint,
        "--journal", str(journal), "--source", "simulated:corridor", "--speed", "20",
    )  # fmt: skip


def test_a_walk_without_a_post_is_in_the_recording_of_one_that_comes_later(tmp_path: Path) -> None:
    endpoint, journal, recording = free_endpoint(), tmp_path / "r1", tmp_path / "fire.mcap"
    with running(*walk(endpoint, journal)) as agent:
        wait_for(lambda: strides_so_far(journal) >= 5, "strides", LONG_S)
        assert agent.poll() is None
        with running("command_post", "run", "--incident", FIRE, "--insecure", "--listen", endpoint,
                     "--record", str(recording)) as post:  # fmt: skip
            # It goes when a post has all of it safe.
            assert agent.wait(LONG_S) == ExitCode.OK
            post.send_signal(signal.SIGTERM)
            assert post.wait(LONG_S) == ExitCode.OK
    said = strides_in(journal)
    came = [one.payload for one in read_recording(recording) if one.key.endswith("/increment")]
    assert set(came) == said
    assert len(came) == len(said) >= 5


def test_a_journal_that_is_in_use_is_refused_in_plain_words(tmp_path: Path) -> None:
    endpoint, journal = free_endpoint(), tmp_path / "r1"
    with running(*walk(endpoint, journal)):
        wait_for(lambda: strides_so_far(journal) >= 1, "the first to be at work", LONG_S)
        second = subprocess.run(
            [sys.executable, "-m", *walk(endpoint, journal)], capture_output=True, check=False
        )
    assert second.returncode == ExitCode.USAGE
    assert b"another process has it" in second.stderr
