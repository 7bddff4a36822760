"""Which way is up for a sensor on the trunk: the gyro tells from moment to moment, gravity in time.

Over some steps the trunk gains no speed, and the mean of specific force points up, whatever it
measures: its size is not used. Turning about the vertical is the gyro's alone.
"""

from __future__ import annotations

import math

from edge_agent.inertial.rest_bias import RestBias
from shared.maths.rotations import (
    IDENTITY,
    UP,
    Quaternion,
    Vector3,
    from_rotation_vector,
    multiply,
    normalise,
    rotate,
    shortest,
)

LEVEL_TIME_S = 3.0
"""Over how long gravity is believed: several steps, for a braking trunk reads a slope."""

WEAKEST_GRAVITY_M_S2 = 4.0
"""Less than this tells no direction."""


class TrunkAttitude:
    """Attitude in a level frame whose north is arbitrary, but fixed."""

    def __init__(self) -> None:
        self.nav_from_sensor: Quaternion = IDENTITY
        self.gravity_m_s2 = 0.0
        """Mean of specific force along the vertical: what this sensor reads of gravity."""
        self.bias = RestBias()
        self._since_s = 0.0

    @property
    def level(self) -> bool:
        """Whether any force has told which way is up."""
        return self._since_s > 0.0

    def step(self, force_m_s2: Vector3, rate_rad_s: Vector3, period_s: float) -> Vector3:
        """Take in what was read over ``period_s``; return the force in the level frame."""
        size_m_s2 = math.hypot(*force_m_s2)
        if not self.level:
            if size_m_s2 < WEAKEST_GRAVITY_M_S2:
                return (0.0, 0.0, 0.0)
            self.nav_from_sensor = shortest(force_m_s2, UP)
            self.gravity_m_s2 = size_m_s2
        else:
            self._turn(rate_rad_s, period_s)
        self.bias.add(rate_rad_s, size_m_s2, period_s)
        self._since_s += period_s
        level_m_s2 = rotate(self.nav_from_sensor, force_m_s2)
        # The shorter it is known, the less is known of it: a mean over all there was at first.
        share = period_s / min(self._since_s, LEVEL_TIME_S)
        self.gravity_m_s2 += share * (-level_m_s2[2] - self.gravity_m_s2)
        if size_m_s2 >= WEAKEST_GRAVITY_M_S2:
            self._lean(level_m_s2, share / size_m_s2)
        return level_m_s2

    def _turn(self, rate_rad_s: Vector3, period_s: float) -> None:
        x, y, z = rate_rad_s
        ox, oy, oz = self.bias.bias_rad_s
        turned = from_rotation_vector(
            ((x - ox) * period_s, (y - oy) * period_s, (z - oz) * period_s)
        )
        self.nav_from_sensor = multiply(self.nav_from_sensor, turned)

    def _lean(self, level_m_s2: Vector3, share: float) -> None:
        """Turn by a share of the small angle from the force to the vertical."""
        north, east, _ = level_m_s2
        leaned = from_rotation_vector((-share * east, share * north, 0.0))
        self.nav_from_sensor = normalise(multiply(leaned, self.nav_from_sensor))
