"""Waiting in tests: for a condition, never for a time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

DEADLINE_S = 60.0
"""Far beyond what a loaded machine needs: it is reached only by a failing test."""

SOON_S = 0.005
SELDOM_S = 1.0
REST = 20.0
"""It is looked again after this many times as long as it takes to look: whoever is waited for needs
the machine more than who waits."""


def wait_for(condition: Callable[[], object], what: str, deadline_s: float = DEADLINE_S) -> None:
    """Return as soon as ``condition()`` holds; fail, naming ``what``, if it never does."""
    end_s = time.monotonic() + deadline_s
    began_s = time.thread_time()
    while not condition():
        assert time.monotonic() < end_s, f"waited {deadline_s} s in vain for {what}"
        looked_s = time.thread_time() - began_s
        time.sleep(min(max(REST * looked_s, SOON_S), SELDOM_S))
        began_s = time.thread_time()


def let_last(seconds: float) -> None:
    """Let a fault last, for what it does shows in time only; then wait for a condition."""
    threading.Event().wait(seconds)
