"""The processes a launcher starts: each with a log of its own, none left behind.

A child's standard input is a pipe that the launcher never writes to. When the launcher ends, even
by kill -9, the pipe closes and the child stops (``shared.process.stop_with_parent``).
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Self

STOP_GRACE_S = 4.0


class Ended(NamedTuple):
    """A child that has ended by itself, and how."""

    name: str
    exit_code: int

    def __str__(self) -> str:
        """Say who ended, and of what: of a signal where one killed it."""
        if self.exit_code >= 0:
            return f"{self.name} ended with exit code {self.exit_code}"
        try:
            return f"{self.name} was killed by {signal.Signals(-self.exit_code).name}"
        except ValueError:
            return f"{self.name} was killed by signal {-self.exit_code}"


class Children:
    """Processes of our own programs, stopped in the reverse of the order they were started."""

    def __init__(self, log_directory: Path, grace_s: float = STOP_GRACE_S) -> None:
        """``grace_s``: how long a child that is asked to stop may take before it is killed."""
        self._log_directory = log_directory
        self._grace_s = grace_s
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(
        self, name: str, module: str, arguments: Sequence[str], *, shows: bool = False
    ) -> None:
        """Start ``python -m module arguments``; its standard error goes to ``{name}.log``.

        A child that ``shows`` something keeps the launcher's standard output.
        """
        self._log_directory.mkdir(parents=True, exist_ok=True)
        with self.log(name).open("wb") as log:
            self._processes[name] = subprocess.Popen(  # noqa: S603
                [sys.executable, "-m", module, *arguments],
                stdin=subprocess.PIPE,
                stdout=None if shows else log,
                stderr=log,
                start_new_session=True,
            )

    def names(self) -> list[str]:
        """Names of all that were started."""
        return list(self._processes)

    def running(self) -> list[str]:
        """Names of those that still run."""
        return [name for name, process in self._processes.items() if process.poll() is None]

    def failed(self) -> list[Ended]:
        """Those that have ended with an exit code other than 0."""
        return [
            Ended(name, process.returncode)
            for name, process in self._processes.items()
            if process.poll() not in (None, 0)
        ]

    def wait(self, name: str) -> int:
        """Wait until a child ends by itself; return its exit code."""
        return self._processes[name].wait()

    def log(self, name: str) -> Path:
        """Where a child's log is."""
        return self._log_directory / f"{name}.log"

    def stop(self, names: Sequence[str] | None = None) -> None:
        """Ask children to stop (all, the last started first), wait, and kill who does not."""
        chosen = list(reversed(self._processes)) if names is None else list(names)
        stopping = [self._processes[name] for name in chosen]
        for process in stopping:
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
        deadline = time.monotonic() + self._grace_s
        for process in stopping:
            try:
                process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            if process.stdin is not None:
                process.stdin.close()

    def __enter__(self) -> Self:
        """Return the (empty) set of children."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop all that still run."""
        self.stop()
