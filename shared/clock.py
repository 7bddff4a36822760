"""Time is handed in: the programs read it from a ``Clock``, never from the operating system.

The machine's own clock may be set while a program runs: by a network, by hand, by a router that
knows no better. What is dated must not jump with it, so it is looked at once in a process, and
carried on by the count of nanoseconds since the machine was started, which nobody sets.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from shared.units import NS_PER_S


class Clock(Protocol):
    """Says what time it is, and how long to wait in real seconds until it is later."""

    def now_ns(self) -> int:
        """Nanoseconds since 1970-01-01 UTC."""

    def real_seconds_until(self, time_ns: int) -> float:
        """Real seconds from now until ``now_ns()`` reads ``time_ns``; negative if it is past."""


def steady_ns() -> int:
    """Return the nanoseconds since the machine was started, sleep included where it tells that."""
    if hasattr(time, "CLOCK_BOOTTIME"):
        return time.clock_gettime_ns(time.CLOCK_BOOTTIME)
    return time.monotonic_ns()


LOOKS = 5


def base_ns(read_ns: Callable[[], int], steady_ns: Callable[[], int]) -> int:
    """Return what a clock read when the machine was started.

    The two counts cannot be read at once, and a busy machine may stop the process between them for
    milliseconds: of several looks the quickest counts.
    """
    looks = []
    for _ in range(LOOKS):
        before_ns = steady_ns()
        now_ns = read_ns()
        after_ns = steady_ns()
        looks.append((after_ns - before_ns, now_ns - (before_ns + after_ns) // 2))
    return min(looks)[1]


_BASE_NS = base_ns(time.time_ns, steady_ns)


class SystemClock:
    """The machine's clock as this process found it, carried on steadily.

    ``base_ns`` is what it read when the machine was started; another base may be given, and
    another count of nanoseconds.
    """

    def __init__(
        self, base_ns: int | None = None, steady_ns: Callable[[], int] = steady_ns
    ) -> None:
        self.base_ns = _BASE_NS if base_ns is None else base_ns
        self._steady_ns = steady_ns

    def now_ns(self) -> int:
        """Nanoseconds since 1970-01-01 UTC."""
        return self.base_ns + self._steady_ns()

    def real_seconds_until(self, time_ns: int) -> float:
        """Real seconds until this clock reads ``time_ns``."""
        return (time_ns - self.now_ns()) / NS_PER_S


class ScaledClock:
    """Reads ``start_ns`` when ``clock`` does, and runs ``speed`` times as fast since."""

    def __init__(self, start_ns: int, speed: float, clock: Clock | None = None) -> None:
        if not 0.0 < speed <= 1e4:
            raise ValueError(f"speed {speed}: give one above 0, up to 10,000")
        self._start_ns = start_ns
        self._speed = speed
        self._clock = clock or SystemClock()

    def now_ns(self) -> int:
        """Nanoseconds since 1970-01-01 UTC, on the scaled time line."""
        return self.scaled_ns(self._clock.now_ns())

    def scaled_ns(self, time_ns: int) -> int:
        """Return what it reads when ``clock`` reads ``time_ns``."""
        return self._start_ns + round((time_ns - self._start_ns) * self._speed)

    def real_seconds_until(self, time_ns: int) -> float:
        """Real seconds until this clock reads ``time_ns``."""
        return (time_ns - self.now_ns()) / NS_PER_S / self._speed


class PacedClock:
    """The clock that a node dates by: ``own``, until an exercise's start sets it another pace.

    ``pace`` is how many times as fast as real it runs. Any thread may read it.
    """

    def __init__(self, own: Clock) -> None:
        self._own = own
        self._reading: tuple[Clock, float] = (own, 1.0)

    @property
    def pace(self) -> float:
        """How many times as fast as real it runs."""
        return self._reading[1]

    def run_from(self, start_ns: int, pace: float) -> None:
        """Run ``pace`` times as fast, from when ``own`` reads ``start_ns``."""
        self._reading = (ScaledClock(start_ns, pace, self._own), pace)

    def now_ns(self) -> int:
        """Nanoseconds since 1970-01-01 UTC, or of the exercise's time line."""
        return self._reading[0].now_ns()

    def paced_ns(self, own_ns: int) -> int:
        """Return what it reads, at the pace of now, when ``own`` reads ``own_ns``."""
        clock = self._reading[0]
        return clock.scaled_ns(own_ns) if isinstance(clock, ScaledClock) else own_ns

    def real_seconds_until(self, time_ns: int) -> float:
        """Real seconds until this clock reads ``time_ns``."""
        return self._reading[0].real_seconds_until(time_ns)


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
