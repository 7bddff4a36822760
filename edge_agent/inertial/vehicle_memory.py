"""The last seconds of a vehicle's motion, as its tracker remembers them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

REMEMBERED_S = 5.0
"""The echo of the road is sought in it, and at walking pace comes after four seconds."""


class Moment(NamedTuple):
    """What is remembered of a sample, in the vehicle's own level axes.

    Rates are 0 while the sensor ``slips``: they are not the vehicle's.
    """

    time_s: float
    lasted_s: float
    travelled_m: float
    roll_rad_s: float
    pitch_rad_s: float
    yaw_rad_s: float
    forward_m_s2: float
    right_m_s2: float
    down_m_s2: float
    slips: bool


class Mean(NamedTuple):
    """Of some moments in which the sensor lay still."""

    forward_m_s2: float
    right_m_s2: float
    down_m_s2: float
    yaw_rad_s: float


@dataclass
class Memory:
    """Moments in order of time. Plain state."""

    moments: list[Moment] = field(default_factory=list)

    def forget(self, now_s: float) -> None:
        """Drop what is older than ``REMEMBERED_S``."""
        keep_s = now_s - REMEMBERED_S
        first = next((row for row, one in enumerate(self.moments) if one.time_s >= keep_s), 0)
        del self.moments[:first]

    def after(self, begin_s: float, end_s: float = math.inf) -> Sequence[Moment]:
        """Return the moments after ``begin_s`` and before ``end_s``."""
        first = len(self.moments)
        while first > 0 and self.moments[first - 1].time_s > begin_s:
            first -= 1
        return [one for one in self.moments[first:] if one.time_s < end_s]

    def columns(self, begin_s: float = -math.inf) -> Array:
        """Return the moments after ``begin_s`` as rows (n, 10), in the order of their fields."""
        return np.array(self.after(begin_s), dtype=np.float64).reshape(-1, len(Moment._fields))

    @property
    def slipped_s(self) -> float:
        """When the sensor last slipped, as far as is remembered."""
        return max((one.time_s for one in self.moments if one.slips), default=-math.inf)

    def turn_round(self) -> None:
        """Take what was ahead to be behind."""
        self.moments = [
            one._replace(
                travelled_m=-one.travelled_m,
                roll_rad_s=-one.roll_rad_s,
                pitch_rad_s=-one.pitch_rad_s,
                forward_m_s2=-one.forward_m_s2,
                right_m_s2=-one.right_m_s2,
            )
            for one in self.moments
        ]

    def mend(self, error_m_s: float, ratio_per_s: float) -> None:
        """Correct the way by the error of speed at its end, which grew by ``ratio_per_s`` of it."""
        now_s = self.moments[-1].time_s
        self.moments = [
            one._replace(travelled_m=one.travelled_m + error_m_s * _weight(one, now_s, ratio_per_s))
            for one in self.moments
        ]


def mean_of(moments: Sequence[Moment]) -> Mean | None:
    """Return the mean of those ``moments`` in which the sensor lay still; ``None`` without any."""
    still = [one for one in moments if not one.slips]
    if not still:
        return None
    return Mean(
        sum(one.forward_m_s2 for one in still) / len(still),
        sum(one.right_m_s2 for one in still) / len(still),
        sum(one.down_m_s2 for one in still) / len(still),
        sum(one.yaw_rad_s for one in still) / len(still),
    )


def _weight(moment: Moment, now_s: float, ratio_per_s: float) -> float:
    since_s = moment.time_s - now_s
    return since_s + 0.5 * ratio_per_s * since_s * since_s
