"""Waiting in tests: for a condition, never for a time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

DEADLINE_S = 60.0
"""Far beyond what a loaded machine needs: it is reached only by a failing test."""


def wait_for(condition: Callable[[], object], what: str, deadline_s: float = DEADLINE_S) -> None:
    """Return as soon as ``condition()`` holds; fail, naming ``what``, if it never does."""
    end_s = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < end_s, f"waited {deadline_s} s in vain for {what}"
        time.sleep(0.005)


def let_last(seconds: float) -> None:
    """Let a fault last, for what it does shows in time only; then wait for a condition."""
    threading.Event().wait(seconds)
