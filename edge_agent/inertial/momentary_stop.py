"""Moments at which a unit on the belt stands: the last samples hardly differ.

"Gait information and pedestrian localisation with a 3-axis accelerometer": a momentary stop is
where the standard deviation of the present and the last ten samples is at most 0.04 g on all three
axes. Stopped for over a second it is at rest, and the mean of what is read is gravity as the unit
now hangs: one that was turned on its belt is right again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from shared.maths.rotations import Vector3

STANDARD_GRAVITY_M_S2 = 9.80665
WINDOW = 11
STILL_SD_M_S2 = 0.04 * STANDARD_GRAVITY_M_S2
REST_S = 1.0


class MomentaryStop:
    """Whether the unit stands, and what it reads at rest."""

    def __init__(self) -> None:
        self.stopped = False
        self.gravity_m_s2: Vector3 | None = None
        """Mean specific force of the last rest, in the sensor's axes; ``None`` before the first."""
        self._window: deque[Vector3] = deque(maxlen=WINDOW)
        self._lasted_s = 0.0
        self._count = 0
        self._sum = (0.0, 0.0, 0.0)

    def step(self, force_m_s2: Vector3, period_s: float) -> None:
        """Take in the next force, ``period_s`` after the one before."""
        self._window.append(force_m_s2)
        columns = zip(*self._window, strict=True)
        self.stopped = len(self._window) == WINDOW and all(
            _variance(column) <= STILL_SD_M_S2**2 for column in columns
        )
        if not self.stopped:
            self._lasted_s, self._count, self._sum = 0.0, 0, (0.0, 0.0, 0.0)
            return
        self._lasted_s += period_s
        self._count += 1
        x, y, z = (total + axis for total, axis in zip(self._sum, force_m_s2, strict=True))
        self._sum = (x, y, z)
        if self._lasted_s > REST_S:
            self.gravity_m_s2 = (x / self._count, y / self._count, z / self._count)


def _variance(values: Iterable[float]) -> float:
    values = tuple(values)
    mean = sum(values) / len(values)
    return sum((value - mean) ** 2 for value in values) / len(values)
