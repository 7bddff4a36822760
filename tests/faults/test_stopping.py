"""SIGTERM ends every program within two seconds, whatever it is about."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from command_post.fusion.methods import prepare_fusion
from command_post.fusion.settings import FusionSettings
from shared.process import ExitCode
from tests.bus.relay import Relay
from tests.bus.test_zenoh import free_endpoint, port_of
from tests.waiting import wait_for

SOON_S = 4.0
"""Two seconds, and as much again for a loaded machine."""

AGENT = ("edge_agent", "run", "--id", "r1", "--source", "simulated:corridor", "--insecure")
DAP = ("dap_node", "run", "--id", "dap1", "--source", "simulated:four_daps", "--insecure")
NOBODY_ANSWERS, OPEN = "no router answers", "session open"


class Program:
    """A program at work, and what it has logged so far."""

    def __init__(self, process: subprocess.Popen[bytes], log: Path) -> None:
        self.process = process
        self._log = log

    def says(self, words: str) -> None:
        """Wait until it has logged ``words``."""
        wait_for(lambda: words in self.log, f"{words!r} in its log", 60.0)

    @property
    def log(self) -> str:
        """All that it has logged."""
        return self._log.read_text()

    def stop(self) -> int:
        """Ask it to stop; return its exit code, which is to come soon."""
        self.process.send_signal(signal.SIGTERM)
        code = self.process.wait(SOON_S)
        assert "Traceback" not in self.log
        return code


@contextmanager
def program(folder: Path, *command: str, **environment: str) -> Iterator[Program]:
    path = folder / f"{command[0]}.log"
    with (
        path.open("wb") as log,
        subprocess.Popen(
            [sys.executable, "-m", *command],
            stdin=subprocess.PIPE,
            stderr=log,
            env={**os.environ, **environment},
        ) as process,
    ):
        try:
            yield Program(process, path)
        finally:
            process.kill()


def post(folder: Path, endpoint: str) -> tuple[str, ...]:
    record = str(folder / "fire.mcap")
    return ("command_post", "run", "--insecure", "--record", record, "--listen", endpoint)


@pytest.fixture
def silent() -> Iterator[str]:
    """Endpoint that takes connections and says nothing, as a hung router does."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"tcp/127.0.0.1:{server.getsockname()[1]}"


@pytest.mark.parametrize(("command", "state"), [(AGENT, NOBODY_ANSWERS), (DAP, OPEN)])
def test_while_nobody_is_there(tmp_path: Path, command: tuple[str, ...], state: str) -> None:
    with program(tmp_path, *command, "--connect", free_endpoint()) as one:
        one.says(state)
        assert one.stop() == 0


@pytest.mark.parametrize("command", [AGENT, DAP])
def test_while_a_router_hangs(tmp_path: Path, silent: str, command: tuple[str, ...]) -> None:
    with program(tmp_path, *command, "--connect", silent) as one:
        one.says(NOBODY_ANSWERS if command == AGENT else OPEN)
        assert one.stop() == 0


@pytest.mark.parametrize(
    ("command", "state"),
    [
        (AGENT, "building machine code"),
        (("command_post", "run", "--insecure"), "getting the fusion ready"),
        (("command_post", "prepare"), "getting the fusion ready"),
    ],
)
def test_while_machine_code_is_built(tmp_path: Path, command: tuple[str, ...], state: str) -> None:
    if command[1] == "run" and command[0] == "command_post":
        command = (*command, "--record", str(tmp_path / "fire.mcap"))
    with program(tmp_path, *command, NUMBA_CACHE_DIR=str(tmp_path / "cache")) as one:
        one.says(state)
        # Some of it is built, so that it is amid the rest.
        wait_for(lambda: list((tmp_path / "cache").rglob("*.nb*")), "machine code", 90.0)
        assert one.stop() == -signal.SIGTERM


@pytest.mark.parametrize("command", [AGENT, DAP])
def test_over_a_half_open_link(tmp_path: Path, command: tuple[str, ...]) -> None:
    prepare_fusion(FusionSettings())
    endpoint = free_endpoint()
    with program(tmp_path, *post(tmp_path, endpoint)) as served:
        served.says(OPEN)
        with Relay(port_of(endpoint)) as relay:
            dialled = f"tcp/127.0.0.1:{relay.port}"
            with program(tmp_path, *command, "--connect", dialled) as one:
                one.says(OPEN)
                served.says("a node comes")
                relay.stall()
                assert one.stop() == 0
        assert served.stop() == 0


def test_a_post_amid_a_flood(tmp_path: Path) -> None:
    prepare_fusion(FusionSettings())
    endpoint = free_endpoint()
    with program(tmp_path, *post(tmp_path, endpoint), "--incident", "fire") as served:
        served.says(OPEN)
        with program(tmp_path, "tests.faults.flooder", endpoint, "fire", "mad", "60"):
            served.says("floods")
            assert served.stop() == 0
    assert (tmp_path / "fire.mcap").exists(), "the recording is finished"


def talker(folder: Path, endpoint: str) -> tuple[str, ...]:
    return ("tests.faults.talker", endpoint, "fire", "r1", str(folder / "journal"), "200")


def test_a_post_that_asks_for_what_it_missed_over_a_dead_link(tmp_path: Path) -> None:
    prepare_fusion(FusionSettings())
    with program(tmp_path, *talker(tmp_path, free_endpoint())) as unheard:
        wait_for((tmp_path / "journal").exists, "strides that nobody hears")
        assert unheard.stop() == 0
    endpoint = free_endpoint()
    with program(tmp_path, *post(tmp_path, endpoint), "--incident", "fire") as served:
        served.says(OPEN)
        with Relay(port_of(endpoint)) as relay:
            dialled = f"tcp/127.0.0.1:{relay.port}"
            with program(tmp_path, *talker(tmp_path, dialled)) as talking:
                served.says("a node comes")
                relay.stall()
                assert served.stop() == 0
                assert talking.stop() == 0


@pytest.mark.parametrize("package", ["command_post", "dap_node", "edge_agent"])
def test_broken_off_while_it_is_loaded_it_ends_without_a_word(package: str) -> None:
    with subprocess.Popen(
        [sys.executable, "-X", "importtime", "-m", package, "--help"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stderr is not None
        next(line for line in process.stderr if "rich" in line)
        process.send_signal(signal.SIGINT)
        said = process.stderr.read()
        # Once it is loaded, it exits by itself.
        assert process.wait(SOON_S) in (-signal.SIGINT, ExitCode.INTERRUPTED)
    assert "Traceback" not in said
