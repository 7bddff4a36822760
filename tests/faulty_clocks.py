"""Clocks as they are in the field: set wrong, drifting, and stepping while they run."""

from __future__ import annotations

from collections.abc import Callable

from shared.clock import steady_ns
from shared.units import NS_PER_S


class FaultyClock:
    """Another clock's reading, ``wrong_by_ns`` ahead and ``drift`` (seconds a second) faster.

    It is read from ``read_ns``, and was off by ``wrong_by_ns`` alone when it was made.
    """

    def __init__(
        self, wrong_by_ns: int, drift: float = 0.0, read_ns: Callable[[], int] = steady_ns
    ) -> None:
        self._read_ns = read_ns
        self._begun_ns = read_ns()
        self._drift = drift
        self.wrong_by_ns = wrong_by_ns

    def now_ns(self) -> int:
        """Return what it reads."""
        return self.at_ns(self._read_ns())

    def at_ns(self, true_ns: int) -> int:
        """Return what it reads when the other clock reads ``true_ns``."""
        return true_ns + self.wrong_by_ns + round(self._drift * (true_ns - self._begun_ns))

    def real_seconds_until(self, time_ns: int) -> float:
        """Real seconds until it reads ``time_ns``."""
        return (time_ns - self.now_ns()) / NS_PER_S
