"""Somebody who sees that the post gets on with what it handles, and else ends it.

What handles nothing any more is of no use to anybody, and holds the recording: ended, it can be
started again, and puts aside what it stuck at twice. Kernels let others run meanwhile
(``shared.compiled``), so a thread can see it, and tell where it stuck.
"""

from __future__ import annotations

import faulthandler
import os
import sys
from collections.abc import Callable
from threading import Event

import structlog

from command_post.resuming.handling import Handling
from shared.process import ExitCode

TICK_S = 1.0
TOLD_TICKS = 5
MOST_TICKS = 60
"""What took longest took 1.3 s of a core (docs/faults.md); a machine may be very busy."""

PROVEN_TICKS = 5
"""A start that lasts so long beyond what was recorded gets on."""

_log = structlog.stdlib.get_logger(__name__)


class Watcher:
    """Counts how long one thing is handled: ticks of its own, so that a stopped process is let be.

    ``end`` ends the process.
    """

    def __init__(self, handling: Handling, end: Callable[[], object]) -> None:
        self._handling = handling
        self._end = end
        self._count = self._ticks = self._live_ticks = 0

    def run(self, stop: Event) -> None:
        """Look once a second until ``stop``."""
        while not stop.wait(TICK_S):
            self.look()

    def look(self) -> None:
        """Look once: to be called each ``TICK_S``."""
        self._live_ticks += self._handling.is_live
        if self._live_ticks == PROVEN_TICKS:
            self._handling.prove()
        what, count = self._handling.what, self._handling.count
        self._ticks = self._ticks + 1 if what and count == self._count else 0
        self._count = count
        if self._ticks >= TOLD_TICKS and self._ticks % TOLD_TICKS == 0:
            _log.error("the post does not get on", what=what, for_s=self._ticks * TICK_S)
        if self._ticks >= MOST_TICKS:
            _log.error("the post is ended, to be started again", what=what)
            self._end()


def end_at_once() -> None:
    """Say where every thread is, and end the process on the spot."""
    faulthandler.dump_traceback(sys.__stderr__ or 2)
    os._exit(ExitCode.FAILURE)
