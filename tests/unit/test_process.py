"""Stopping, waiting and logging, in real processes where signals are concerned."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from shared.clock import ManualClock, ScaledClock, SystemClock
from shared.process import ExitCode, stop_with_parent, wait_until
from shared.units import NS_PER_S
from tests.waiting import DEADLINE_S, wait_for

OBEDIENT = """
import signal
from shared.process import ExitCode, stop_on_signals
# Whoever runs the tests by nohup ignores it, and so would this.
signal.signal(signal.SIGHUP, signal.SIG_DFL)
with stop_on_signals() as stop:
    print("ready", flush=True)
    stop.wait()
    print("closed", flush=True)
raise SystemExit(ExitCode.OK)
"""

OUTLIVING = """
import signal
from shared.process import stop_on_signals
signal.signal(signal.SIGHUP, signal.SIG_IGN)
with stop_on_signals() as stop:
    heeds_it = signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN
    print("not it" if heeds_it else "ready", flush=True)
    stop.wait()
    print("closed", flush=True)
"""

STUBBORN = """
import threading
from shared.process import stop_on_signals
with stop_on_signals():
    print("ready", flush=True)
    threading.Event().wait()
"""

UNHEEDING = """
import threading
from shared.process import interrupt_on_signals
interrupt_on_signals()
try:
    print("ready", flush=True)
    threading.Event().wait()
finally:
    print("given back", flush=True)
"""

IN_A_CALLBACK = """
import ctypes, os, signal, threading
from shared.process import interrupt_on_signals
interrupt_on_signals()
@ctypes.CFUNCTYPE(None)
def call_back():
    os.kill(os.getpid(), signal.SIGTERM)
try:
    print("ready", flush=True)
    call_back()
    threading.Event().wait()
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""

PARENT = """
import subprocess, sys
child = subprocess.Popen([sys.executable, "-c", sys.argv[1]], stdin=subprocess.PIPE)
child.wait()
"""

CHILD = """
import threading
from shared.process import stop_with_parent
stop = threading.Event()
stop_with_parent(stop)
print("ready", flush=True)
stop.wait()
print("closed", flush=True)
"""


@contextmanager
def running(program: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run ``program`` and wait until it says that it is ready."""
    command = [sys.executable, "-c", program, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_lets_the_program_close(number: signal.Signals) -> None:
    with running(OBEDIENT) as process:
        process.send_signal(number)
        output, _ = process.communicate(timeout=DEADLINE_S)
    assert (output, process.returncode) == ("closed\n", ExitCode.OK)


def test_a_program_that_is_to_outlive_its_terminal_does() -> None:
    with running(OUTLIVING) as process:
        process.terminate()
        output, _ = process.communicate(timeout=DEADLINE_S)
    assert output == "closed\n"


def test_a_second_signal_ends_a_program_that_does_not_close() -> None:
    with running(STUBBORN) as process:

        def ended() -> bool:
            process.send_signal(signal.SIGINT)
            return process.poll() is not None

        wait_for(ended, "the end of the program")
    assert process.returncode == ExitCode.INTERRUPTED


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_interrupts_what_heeds_none(number: signal.Signals) -> None:
    with running(UNHEEDING) as process:
        process.send_signal(number)
        output, _ = process.communicate(timeout=DEADLINE_S)
    assert output == "given back\n"
    assert process.returncode != ExitCode.OK


def test_an_interruption_that_is_lost_in_a_callback_from_c_comes_again() -> None:
    with running(IN_A_CALLBACK) as process:
        output, _ = process.communicate(timeout=DEADLINE_S)
    assert output == "interrupted\n"


def test_a_child_stops_when_its_launcher_is_killed() -> None:
    with running(PARENT, CHILD) as parent:
        parent.kill()
        # The child shares this pipe: it ends only when the child has ended too.
        output, _ = parent.communicate(timeout=DEADLINE_S)
    assert output == "closed\n"


def test_the_parents_bytes_do_not_stop_the_child() -> None:
    read_end, write_end = os.pipe()
    stop = threading.Event()
    stop_with_parent(stop, read_end)
    os.write(write_end, b"still here\n")
    assert not stop.is_set()
    os.close(write_end)
    assert stop.wait(DEADLINE_S)
    os.close(read_end)


def test_waiting_ends_at_the_time() -> None:
    clock = ScaledClock(SystemClock().now_ns(), speed=1000.0)
    until_ns = clock.now_ns() + 20 * NS_PER_S
    assert wait_until(clock, until_ns, threading.Event())
    assert clock.now_ns() >= until_ns
    assert wait_until(ManualClock(), 10**18, threading.Event())


def test_waiting_is_broken_off_by_stop() -> None:
    stop = threading.Event()
    reached: list[bool] = []
    clock = SystemClock()
    far_ns = clock.now_ns() + 3600 * NS_PER_S
    waiter = threading.Thread(target=lambda: reached.append(wait_until(clock, far_ns, stop)))
    waiter.start()
    stop.set()
    waiter.join(DEADLINE_S)
    assert reached == [False]


class JumpingClock(ManualClock):
    """An hour away from any time at first; set right after it is first asked."""

    def real_seconds_until(self, time_ns: int) -> float:
        """Return an hour, once."""
        before = self.now_ns()
        self.set_ns(time_ns)
        return 3600.0 if before < time_ns else 0.0


def test_waiting_notices_that_the_clock_was_set() -> None:
    assert wait_until(JumpingClock(), 1, threading.Event())


LOGGING = """
import logging, sys, structlog
from shared.process import configure_logging
configure_logging("info", json=sys.argv[1] == "json")
structlog.stdlib.get_logger("clew.test").info("session opened", node_id=sys.argv[2])
structlog.stdlib.get_logger("clew.test").debug("unheard")
logging.getLogger("elsewhere").warning("foreign %d", 3)
"""


def logged(form: str, node_id: str = "dap 1") -> list[str]:
    ran = subprocess.run(
        [sys.executable, "-c", LOGGING, form, node_id], capture_output=True, text=True, check=True
    )
    assert ran.stdout == ""
    return ran.stderr.splitlines()


def test_logs_are_key_value_lines_on_standard_error() -> None:
    own, foreign = logged("lines")
    assert 'level=info logger=clew.test event="session opened" node_id="dap 1"' in own
    assert 'level=warning logger=elsewhere event="foreign 3"' in foreign


def test_a_private_key_gets_into_no_log() -> None:
    pem = "-----BEGIN " + "PRIVATE KEY-----"
    (own, *_) = (json.loads(line) for line in logged("json", pem))
    assert own["node_id"] == "(a private key, withheld)"


@pytest.mark.parametrize("program", ["command_post", "dap_node", "edge_agent"])
def test_every_program_logs_as_it_is_told(program: str) -> None:
    asked = ["run", "--log", "json", "--log-level", "error", "--id", "no id!", "--insecure"]
    asked += {
        "command_post": [],
        "dap_node": ["--source", "hostapd:/nowhere"],
        "edge_agent": ["--source", "simulated:corridor"],
    }[program]
    ran = subprocess.run(
        [sys.executable, "-m", program, *asked], capture_output=True, text=True, check=False
    )
    assert ran.returncode == ExitCode.USAGE
    (line,) = ran.stderr.splitlines()
    said = json.loads(line)
    assert (said["level"], "no id!" in said["event"]) == ("error", True)


def test_logs_are_json_on_request() -> None:
    own, foreign = (json.loads(line) for line in logged("json"))
    assert own["event"] == "session opened"
    assert own["node_id"] == "dap 1"
    assert (foreign["event"], foreign["level"]) == ("foreign 3", "warning")
