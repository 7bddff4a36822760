"""How far from a DAP somebody really was, and when they passed it (pure)."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

PASS_M = 1.5
"""Who comes within this passes the DAP, if nothing else is said."""

PASS_MARGIN_S = 1.0
"""What is told so long before or after a pass still belongs to it."""

NEAREST_M = 0.1
"""All the time within this of the least range of a pass is its nearest."""


class Pass(NamedTuple):
    """A pass: when it began and ended, and from when to when it was nearest (s)."""

    begin_s: float
    end_s: float
    nearest_from_s: float
    nearest_to_s: float

    def holds(self, time_s: Array) -> NDArray[np.bool_]:
        """Return which of ``time_s`` (n,) belong to it."""
        return (time_s >= self.begin_s - PASS_MARGIN_S) & (time_s <= self.end_s + PASS_MARGIN_S)

    def off_s(self, time_s: float) -> float:
        """Return how much later than at its nearest ``time_s`` is; negative if earlier."""
        return time_s - min(max(time_s, self.nearest_from_s), self.nearest_to_s)


class TrueRange(NamedTuple):
    """Range ``range_m`` (n,) between a DAP and somebody at ``time_s`` (n,), ascending."""

    time_s: Array
    range_m: Array

    def at(self, time_s: Array) -> Array:
        """Return the range (m,) at ``time_s`` (m,), held beyond the ends."""
        return np.interp(time_s, self.time_s, self.range_m)

    def passes(self, within_m: float) -> list[Pass]:
        """Return the passes, which are the times within ``within_m`` of the DAP."""
        close = np.concatenate([[False], self.range_m < within_m, [False]])
        begins = np.flatnonzero(close[1:] & ~close[:-1])
        ends = np.flatnonzero(close[:-1] & ~close[1:])
        return [self._pass(slice(begin, end)) for begin, end in zip(begins, ends, strict=True)]

    def _pass(self, lasts: slice) -> Pass:
        range_m, time_s = self.range_m[lasts], self.time_s[lasts]
        nearest_s = time_s[range_m <= range_m.min() + NEAREST_M]
        moments_s = (time_s[0], time_s[-1], nearest_s[0], nearest_s[-1])
        return Pass(*(float(moment_s) for moment_s in moments_s))
