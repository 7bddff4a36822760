"""Time is handed in: the programs read it from a ``Clock``, never from the operating system."""

from __future__ import annotations

import time
from typing import Protocol

from shared.units import NS_PER_S


class Clock(Protocol):
    """Says what time it is, and how long to wait in real seconds until it is later."""

    def now_ns(self) -> int:
        """Nanoseconds since 1970-01-01 UTC."""

    def real_seconds_until(self, time_ns: int) -> float:
        """Real seconds from now until ``now_ns()`` reads ``time_ns``; negative if it is past."""


class SystemClock:
    """The machine's own clock."""

    def now_ns(self) -> int:
        """Nanoseconds since 1970-01-01 UTC."""
        return time.time_ns()

    def real_seconds_until(self, time_ns: int) -> float:
        """Real seconds until the machine's clock reads ``time_ns``."""
        return (time_ns - time.time_ns()) / NS_PER_S


class ScaledClock:
    """Reads ``start_ns`` when the machine's clock does, and runs ``speed`` times as fast since."""

    def __init__(self, start_ns: int, speed: float) -> None:
        if not 0.0 < speed <= 1e4:
            raise ValueError(f"speed {speed}: give one above 0, up to 10,000")
        self._start_ns = start_ns
        self._speed = speed

    def now_ns(self) -> int:
        """Nanoseconds since 1970-01-01 UTC, on the scaled time line."""
        return self._start_ns + round((time.time_ns() - self._start_ns) * self._speed)

    def real_seconds_until(self, time_ns: int) -> float:
        """Real seconds until this clock reads ``time_ns``."""
        return (time_ns - self.now_ns()) / NS_PER_S / self._speed


class ManualClock:
    """Stands still until it is set: the clock of replay and of tests."""

    def __init__(self, now_ns: int = 0) -> None:
        self._now_ns = now_ns

    def now_ns(self) -> int:
        """Return the nanoseconds it was last set to."""
        return self._now_ns

    def real_seconds_until(self, time_ns: int) -> float:  # noqa: ARG002
        """Nothing is ever waited for."""
        return 0.0

    def set_ns(self, now_ns: int) -> None:
        """Make it ``now_ns``."""
        self._now_ns = now_ns
