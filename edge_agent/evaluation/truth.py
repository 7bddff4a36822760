"""Where the boot really was: at the instants when it really stood.

Errors are taken at true stances, never at detected ones, so that no detector is favoured: one that
misses a stance is held to account for it, and one that invents a stance gains nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class Height:
    """``down_m`` (n,) of the boot at ``time_s`` (n,), on the recording's clock."""

    time_s: Array
    down_m: Array


@dataclass(frozen=True)
class Speed:
    """``speed_m_s`` (n,) of the boot at ``time_s`` (n,); NaN while motion capture had lost it."""

    time_s: Array
    speed_m_s: Array


@dataclass(frozen=True)
class Truth:
    """True stances: ``time_s`` (k,) rising, ``position_m`` (k, 2) north and east.

    North is wherever the truth's frame has it; only rigid alignment compares. ``height`` and
    ``speed`` where they are known, ``speed`` only of a path measured evenly. ``taped_m`` is the
    length of the course as it was laid out with a tape, where it was.
    """

    time_s: Array
    position_m: Array
    height: Height | None = None
    speed: Speed | None = None
    taped_m: float | None = None

    @property
    def stride_lengths_m(self) -> Array:
        """Level distance (k - 1,) from each stance to the next."""
        north_m, east_m = np.diff(self.position_m, axis=0).T
        lengths_m: Array = np.hypot(north_m, east_m)
        return lengths_m

    @property
    def length_m(self) -> float:
        """Length of the path, stance to stance."""
        return float(self.stride_lengths_m.sum())

    @property
    def mean_speed_m_s(self) -> float:
        """Path length over the time from the first to the last stance; 0 if no time passes."""
        if len(self.time_s) < 2 or not self.time_s[-1] > self.time_s[0]:
            return 0.0
        return self.length_m / float(self.time_s[-1] - self.time_s[0])


def truth_of_stances(time_s: Array, position_m: Array, taped_m: float | None = None) -> Truth:
    """Return the truth of stances known one by one, ``position_m`` (k, 2) or (k, 3) NED."""
    height = Height(time_s, position_m[:, 2]) if position_m.shape[1] == 3 else None
    return Truth(time_s, position_m[:, :2], height, taped_m=taped_m)
