"""Whether a gyroscope turns as gravity does in the same sensor's axes (pure).

Over a second or two the mean of specific force is gravity, by some degrees, for whoever walks or
drives: from one second to the next it moves in the sensor's axes by what the gyroscope has turned.
It does not where the two have different axes (a browser's alpha, beta and gamma are z, x and y),
nor where rates are in °/s. On the recordings of people and the drive with its slips they part by
11° at most (root mean square of ten seconds), with axes exchanged by 25 to 53° at a belt and 40°
in a hand that turns about; with rates in degrees by 55° or more. A boot is no such place.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from shared.maths.rotations import (
    Vector3,
    angle_between_rad,
    from_rotation_vector,
    inverse,
    rotate,
)
from shared.messages import ImuSample
from shared.units import NS_PER_S

SECONDS = 10
MOST_RAD = math.radians(20.0)
LONGEST_STEP_S = 0.2
"""Nobody knows how a sensor turned between samples that are further apart."""

FEWEST = 8
WEAKEST_M_S2 = 3.0


class GyroAgreement:
    """Takes samples a second at a time, in order; tells whether the last ten seconds contradict."""

    def __init__(self) -> None:
        self._off_rad2: deque[float] = deque(maxlen=SECONDS)
        self._before: tuple[Vector3, Vector3] | None = None
        self._last_ns: int | None = None

    @property
    def contradicts(self) -> bool:
        """Whether forces and rates part by more than ``MOST_RAD``."""
        return math.sqrt(math.fsum(self._off_rad2) / SECONDS) > MOST_RAD

    def take(self, samples: Sequence[ImuSample]) -> None:
        """Take in the samples of a second; what is no reading, or late, breaks it off."""
        times_ns = [one.time_ns for one in samples]
        readings = np.array([(*one.force_m_s2, *one.rate_rad_s) for one in samples]).reshape(-1, 6)
        first_ns = times_ns[0] if self._last_ns is None else self._last_ns
        apart_s = np.diff([first_ns, *times_ns]) / NS_PER_S
        self._last_ns = times_ns[-1]
        before, self._before = self._before, None
        whole = np.isfinite(readings).all() and apart_s.min() >= 0.0 and len(samples) >= FEWEST
        if not whole or apart_s.max() > LONGEST_STEP_S:
            return
        turned_rad = readings[:, 3:] * apart_s[:, None]
        half = len(samples) // 2
        first, second = _vector(turned_rad[:half].sum(axis=0)), turned_rad[half:].sum(axis=0)
        force_m_s2 = _vector(readings[:, :3].mean(axis=0))
        if math.hypot(*force_m_s2) < WEAKEST_M_S2:
            return
        if before is not None:
            self._off_rad2.append(_off_rad(*before, first, force_m_s2) ** 2)
        self._before = force_m_s2, _vector(second)


def _off_rad(before_m_s2: Vector3, left: Vector3, right: Vector3, after_m_s2: Vector3) -> float:
    """Return the angle from where a force ought to have gone to where it went.

    ``left`` and ``right`` are the turns from the middle of its second to the end, and on to the
    middle of the next.
    """
    turn = from_rotation_vector((left[0] + right[0], left[1] + right[1], left[2] + right[2]))
    return angle_between_rad(rotate(inverse(turn), before_m_s2), after_m_s2)


def _vector(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Vector3:
    x, y, z = values.tolist()
    return (x, y, z)
