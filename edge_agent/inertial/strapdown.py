"""Which way up the boot is, and which way it faces: attitude from the gyro, tilt from gravity."""

from __future__ import annotations

import math

from shared.maths.rotations import (
    IDENTITY,
    UP,
    Quaternion,
    Vector3,
    about_down,
    from_rotation_vector,
    heading_of,
    multiply,
    normalise,
    rotate,
    shortest,
)

GRAVITY_TIME_S = 0.2
"""Over how long gravity is averaged in a stance: longer than the ringing of a heel strike."""

WEAKEST_GRAVITY_M_S2 = 4.0
"""Less than this, held still, is a broken accelerometer: tilt is not taken from it."""


class Strapdown:
    """Attitude of the boot in the level frame, carried by the gyro and levelled in stances.

    The paper expresses a swing in the body frame at its start, and takes the specific force of
    that one sample, f_ib, as gravity. Two departures: the frame in which a swing starts is levelled
    by f_ib, so that swings add up in one north-east-down frame; and f_ib is averaged over the last
    ``GRAVITY_TIME_S`` of the stance, since a single sample carries the sensor's noise and the
    boot's trembling into the tilt of the whole swing.
    """

    def __init__(self) -> None:
        self.nav_from_body: Quaternion = IDENTITY
        self.gravity_m_s2 = 0.0
        """Magnitude of f_ib; it points up, by construction of the frame. 0 until levelled."""
        self._stance_s = 0.0

    def turn(self, rate_rad_s: Vector3, duration_s: float) -> None:
        """Carry attitude on by ``duration_s`` at the mean rate over it (body frame)."""
        x, y, z = rate_rad_s
        turned = from_rotation_vector((x * duration_s, y * duration_s, z * duration_s))
        self.nav_from_body = normalise(multiply(self.nav_from_body, turned))

    def begin_stance(self) -> None:
        """Let the gravity of the stance before count no more."""
        self._stance_s = 0.0

    def level(self, force_m_s2: Vector3, duration_s: float) -> None:
        """Average gravity over a stance's samples, this one ``duration_s`` long, and level by it.

        The smallest turn that levels is made, so heading stays.
        """
        lasted_s = self._stance_s + duration_s
        averaged_s = min(lasted_s, GRAVITY_TIME_S)
        weight = duration_s / averaged_s if duration_s < averaged_s else 1.0
        north, east, down = rotate(self.nav_from_body, force_m_s2)
        mean = (
            weight * north,
            weight * east,
            weight * down - (1.0 - weight) * self.gravity_m_s2,
        )
        gravity_m_s2 = math.hypot(*mean)
        if gravity_m_s2 < WEAKEST_GRAVITY_M_S2:
            return
        self._stance_s = lasted_s
        self.gravity_m_s2 = gravity_m_s2
        self.nav_from_body = multiply(shortest(mean, UP), self.nav_from_body)

    def face(self, heading_rad: float) -> None:
        """Turn about the vertical until the boot faces ``heading_rad``."""
        turn = about_down(heading_rad - heading_of(self.nav_from_body))
        self.nav_from_body = multiply(turn, self.nav_from_body)
