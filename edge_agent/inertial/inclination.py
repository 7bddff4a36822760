"""Which way up a sensor is while its wearer walks: gravity is what shaking averages to.

The gyro turns; specific force is averaged in the frame it carries along, where the shaking of steps
cancels and turning does not, and what is left of it must point up. As in Laidig and Seel, "VQF:
Highly accurate IMU orientation estimation with bias estimation and magnetic disturbance rejection"
(2023), with a filter of first order.
"""

from __future__ import annotations

import math

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

AVERAGED_S = 3.0
"""Some five steps; longer, and what the gyro drifts meanwhile shows."""

WEAKEST_GRAVITY_M_S2 = 4.0
"""A mean of less is no gravity: tilt is not taken from it."""


class Inclination:
    """Attitude in a level frame whose heading is the gyro's. Plain state."""

    def __init__(self) -> None:
        self.nav_from_body: Quaternion = IDENTITY
        self.averaged_s = 0.0
        """Over how long force has been averaged, up to ``AVERAGED_S``."""
        self._up_m_s2: Vector3 = (0.0, 0.0, 0.0)

    def take(self, force_m_s2: Vector3, turned_rad: Vector3, duration_s: float) -> None:
        """Turn by a rotation vector (sensor axes) made over ``duration_s``, and level."""
        turned = multiply(self.nav_from_body, from_rotation_vector(turned_rad))
        self.nav_from_body = normalise(turned)
        self.averaged_s = min(self.averaged_s + duration_s, AVERAGED_S)
        weight = min(1.0, duration_s / self.averaged_s) if self.averaged_s > 0.0 else 1.0
        north, east, down = rotate(self.nav_from_body, force_m_s2)
        n, e, d = self._up_m_s2
        mean = (n + weight * (north - n), e + weight * (east - e), d + weight * (down - d))
        size_m_s2 = math.hypot(*mean)
        if size_m_s2 < WEAKEST_GRAVITY_M_S2:
            self._up_m_s2 = mean
            return
        # The smallest turn that levels: heading stays.
        self.nav_from_body = multiply(shortest(mean, UP), self.nav_from_body)
        self._up_m_s2 = (0.0, 0.0, -size_m_s2)
