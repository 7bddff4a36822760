"""The gyro's bias: what it reads while the boot stands still.

The paper leaves the bias to the sensor. Uncorrected it turns the whole path, by up to half a degree
a second for the sensors measured, so its mean is taken whenever the boot is still for a second:
shorter averages are worse than none, for in a walking stance the boot rolls.
"""

from __future__ import annotations

import math

from shared.maths.rotations import Vector3

STILL_S = 1.0
STILL_SD_RAD_S = math.radians(1.0)
"""Standing, a gyro scatters by 0.1 to 0.9 °/s; a boot in use by far more."""

LARGEST_BIAS_RAD_S = math.radians(3.0)
"""A steady rate beyond this is a boot that turns, not a bias."""

REMEMBERED = 10
"""Of how many still seconds the bias is the mean, at most: it wanders with temperature."""


class GyroBias:
    """Mean rate over the still seconds of stances."""

    def __init__(self) -> None:
        self.bias_rad_s: Vector3 = (0.0, 0.0, 0.0)
        self.known = False
        self._taken = 0
        self.interrupt()

    def interrupt(self) -> None:
        """Begin a new second: the boot has moved."""
        self._count = 0
        self._lasted_s = 0.0
        self._sum = [0.0, 0.0, 0.0]
        self._sum_of_squares = [0.0, 0.0, 0.0]

    def add(self, rate_rad_s: Vector3, duration_s: float) -> None:
        """Take in one raw rate of a stance, ``duration_s`` after the one before."""
        self._count += 1
        self._lasted_s += duration_s
        for axis, rate in enumerate(rate_rad_s):
            self._sum[axis] += rate
            self._sum_of_squares[axis] += rate * rate
        if self._lasted_s >= STILL_S:
            self._finish()
            self.interrupt()

    def _finish(self) -> None:
        means = [total / self._count for total in self._sum]
        variances = [
            square / self._count - mean * mean
            for square, mean in zip(self._sum_of_squares, means, strict=True)
        ]
        if max(variances) > STILL_SD_RAD_S**2 or max(map(abs, means)) > LARGEST_BIAS_RAD_S:
            return
        self._taken = min(self._taken + 1, REMEMBERED)
        x, y, z = (
            old + (mean - old) / self._taken
            for old, mean in zip(self.bias_rad_s, means, strict=True)
        )
        self.bias_rad_s = (x, y, z)
        self.known = True
