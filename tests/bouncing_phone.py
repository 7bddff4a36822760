"""A phone that bounces once a step, worn any way round: what chest mounts are tested on."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from shared.maths.rotations import IDENTITY, Quaternion, rotate
from shared.messages import ImuSample, Vector3

GRAVITY_M_S2 = 9.81
TREMBLE_M_S2 = 1e-4
"""From sample to sample: no sensor reads the same for ever."""


class Phone(NamedTuple):
    """How it is carried: at rest for ``rest_s``, ``steps`` bounces, at rest again for a second.

    ``turn_rad_s`` is about the vertical, clockwise, while it bounces; ``bias_rad_s`` the gyro's.
    ``sensor_from_level`` turns from forward-right-down to its own axes.
    """

    steps: int
    cadence_hz: float = 2.0
    bounce_m_s2: float = 3.0
    turn_rad_s: float = 0.0
    rest_s: float = 2.0
    rate_hz: float = 100.0
    sensor_from_level: Quaternion = IDENTITY
    bias_rad_s: Vector3 = (0.0, 0.0, 0.0)

    def samples(self, begin_ns: int = 0) -> Iterator[ImuSample]:
        """Yield its samples from ``begin_ns`` on."""
        lasts_s = self.rest_s + self.steps / self.cadence_hz + 1.0
        for index in range(round(lasts_s * self.rate_hz)):
            time_s = index / self.rate_hz
            phase = (time_s - self.rest_s) * self.cadence_hz
            moves = 0.0 <= phase < self.steps
            bounce_m_s2 = self.bounce_m_s2 * math.sin(2.0 * math.pi * phase) if moves else 0.0
            tremble_m_s2 = TREMBLE_M_S2 * (index % 2)
            force_m_s2 = (0.0, 0.0, -GRAVITY_M_S2 - bounce_m_s2 - tremble_m_s2)
            rate_rad_s = (0.0, 0.0, self.turn_rad_s if moves else 0.0)
            x, y, z = rotate(self.sensor_from_level, rate_rad_s)
            bx, by, bz = self.bias_rad_s
            yield ImuSample(
                begin_ns + round(time_s * 1e9),
                rotate(self.sensor_from_level, force_m_s2),
                (x + bx, y + by, z + bz),
            )
