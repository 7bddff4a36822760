"""Speed of a vehicle by its own inertia: an error-state Kalman filter, and what may correct it.

Attitude is carried by the gyroscope, never taken from the accelerometer of the moment: that is what
compensates slopes, gentle changes of attitude, and braking taken for a slope. What is left to find
are nine errors, each slow: of speed, of the level (two), of the gyroscope's zero (three), of the
wheelbase, of how late its echo is, and of which way is forward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.maths.rotations import (
    Quaternion,
    Vector3,
    from_rotation_vector,
    multiply,
    normalise,
    rotate,
    to_matrix,
)

Array: TypeAlias = NDArray[np.float64]

GRAVITY_M_S2 = 9.80665
SPEEDS_M_S = (-15.0, 75.0)
"""No vehicle reverses, or goes, faster."""

SPEED, TILT_NORTH, TILT_EAST, BIAS, WHEELBASE, LATE, FORWARD = 0, 1, 2, 3, 6, 7, 8
"""Where the errors stand in the state: the gyroscope's zero takes three places."""

STATES = 9

ACCELERATION_NOISE_M_S_SQRT_S = 0.15
"""Of speed: what an accelerometer on a trembling mounting adds."""

TILT_NOISE_RAD_SQRT_S = 1e-4
BIAS_NOISE_RAD_S_SQRT_S = 1e-6
FORWARD_NOISE_RAD_SQRT_S = math.radians(0.1)


class Uncertainty(NamedTuple):
    """Standard deviations of what is not known at the start."""

    speed_m_s: float
    tilt_rad: float
    bias_rad_s: float = math.radians(0.15)
    wheelbase_m: float = 0.12
    late_s: float = 0.008
    forward_rad: float = math.radians(4.0)


class Motion(NamedTuple):
    """What a sample says in the car's own level axes: forward, right, down.

    ``acceleration_m_s2`` is free of gravity, ``rate_rad_s`` of the gyroscope's zero.
    """

    acceleration_m_s2: Vector3
    rate_rad_s: Vector3


@dataclass
class VehicleFilter:
    """State, and its covariance. Plain: a copy goes on alike.

    ``level_from_sensor`` is the attitude in a level frame whose north is where the vehicle headed
    at first, ``heading_rad`` the vehicle's heading there. While the sensor slips it turns alone,
    and the heading is held.
    """

    level_from_sensor: Quaternion
    heading_rad: float
    speed_m_s: float
    wheelbase_m: float
    late_s: float
    uncertainty: Uncertainty
    bias_rad_s: Vector3 = (0.0, 0.0, 0.0)
    covariance: Array = field(init=False)
    _unpredicted_s: float = 0.0

    def __post_init__(self) -> None:
        sd = self.uncertainty
        tilt_rad, bias_rad_s = sd.tilt_rad, sd.bias_rad_s
        self.covariance = np.diag(
            np.square(
                [sd.speed_m_s, tilt_rad, tilt_rad, bias_rad_s, bias_rad_s, bias_rad_s,
                 sd.wheelbase_m, sd.late_s, sd.forward_rad]
            )
        )  # fmt: skip

    @property
    def speed_sd_m_s(self) -> float:
        """How well speed is known."""
        return math.sqrt(max(0.0, float(self.covariance[SPEED, SPEED])))

    @property
    def forward_sd_rad(self) -> float:
        """How well it is known which way is forward."""
        return math.sqrt(max(0.0, float(self.covariance[FORWARD, FORWARD])))

    @property
    def tilt_sd_rad(self) -> float:
        """How well the level is known, in the direction in which it is known worse."""
        return math.sqrt(max(0.0, *np.diag(self.covariance)[TILT_NORTH : TILT_EAST + 1].tolist()))

    def turn(self, rate_rad_s: Vector3, duration_s: float) -> None:
        """Carry the sensor's attitude on, at the mean rate read over ``duration_s``."""
        x, y, z = self._unbiased(rate_rad_s)
        turned = from_rotation_vector((x * duration_s, y * duration_s, z * duration_s))
        self.level_from_sensor = normalise(multiply(self.level_from_sensor, turned))

    def read(self, force_m_s2: Vector3, rate_rad_s: Vector3) -> Motion:
        """Return what a sample says of the vehicle's motion, by the attitude of now."""
        north, east, down = rotate(self.level_from_sensor, force_m_s2)
        about_north, about_east, about_down = rotate(
            self.level_from_sensor, self._unbiased(rate_rad_s)
        )
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return Motion(
            (c * north + s * east, c * east - s * north, down + GRAVITY_M_S2),
            (c * about_north + s * about_east, c * about_east - s * about_north, about_down),
        )

    def in_level_axes(self, forward_right_down: Vector3) -> Vector3:
        """Return a vector of the vehicle's own level axes in those of the attitude."""
        forward, right, down = forward_right_down
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return (c * forward - s * right, s * forward + c * right, down)

    def go(self, forward_m_s2: float, turn_rad_s: float, duration_s: float) -> float:
        """Carry speed and heading on; return the way made (m)."""
        before_m_s = self.speed_m_s
        speed_m_s = before_m_s + forward_m_s2 * duration_s
        self.speed_m_s = min(max(speed_m_s, SPEEDS_M_S[0]), SPEEDS_M_S[1])
        self.heading_rad += turn_rad_s * duration_s
        self._unpredicted_s += duration_s
        return 0.5 * (before_m_s + self.speed_m_s) * duration_s

    def turn_round(self) -> None:
        """Take what was ahead to be behind: the vehicle goes as it did, but forward."""
        self.heading_rad += math.pi
        self.speed_m_s = -self.speed_m_s
        self.covariance[SPEED, :] *= -1.0
        self.covariance[:, SPEED] *= -1.0

    def predict(self, lateral_m_s2: float) -> None:
        """Carry the covariance on over all that went since the last time.

        ``lateral_m_s2`` was the mean acceleration to the right, which a forward direction that is
        off takes for forward.
        """
        lasted_s, self._unpredicted_s = self._unpredicted_s, 0.0
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        level_from_sensor = np.array(to_matrix(self.level_from_sensor))
        step = np.eye(STATES)
        step[SPEED, TILT_NORTH] = GRAVITY_M_S2 * s * lasted_s
        step[SPEED, TILT_EAST] = -GRAVITY_M_S2 * c * lasted_s
        step[SPEED, FORWARD] = lateral_m_s2 * lasted_s
        step[TILT_NORTH : TILT_EAST + 1, BIAS:WHEELBASE] = -level_from_sensor[:2] * lasted_s
        step[SPEED, BIAS:WHEELBASE] = (
            0.5 * step[SPEED, TILT_NORTH : TILT_EAST + 1] @ step[1:3, BIAS:WHEELBASE]
        )
        self.covariance = step @ self.covariance @ step.T
        rows = range(STATES)
        self.covariance[rows, rows] += NOISE_DENSITY * lasted_s

    def doubt(self, *, speed: float = 0.0, tilt: float = 0.0, forward: float = 0.0) -> None:
        """Add variances: of ``speed`` (m²/s²), of ``tilt`` and ``forward`` (rad²)."""
        for place, variance in (
            (SPEED, speed), (TILT_NORTH, tilt), (TILT_EAST, tilt), (FORWARD, forward)
        ):  # fmt: skip
            self.covariance[place, place] += variance

    def measure(self, error: float, slope: Array, variance: float) -> None:
        """Correct by ``error``, which is ``slope`` @ state errors + noise of ``variance``."""
        tied = self.covariance @ slope
        gain = tied / (float(slope @ tied) + variance)
        self._correct(gain * error)
        self.covariance -= np.outer(gain, tied)

    def replace_along(self, slope: Array, mean: float, variance: float) -> None:
        """Correct so that ``slope`` @ state errors has this mean and variance, as found outside.

        What is found may be anything: a mixture that a grid weighed, for one.
        """
        tied = self.covariance @ slope
        before = float(slope @ tied)
        gain = tied / before
        self._correct(gain * mean)
        self.covariance -= np.outer(gain, gain) * (before - min(variance, before))

    def along(self) -> Array:
        """Return the slope of forward acceleration by the state's errors."""
        slope = np.zeros(STATES)
        slope[TILT_NORTH] = GRAVITY_M_S2 * math.sin(self.heading_rad)
        slope[TILT_EAST] = -GRAVITY_M_S2 * math.cos(self.heading_rad)
        return slope

    def across(self) -> Array:
        """Return the slope of acceleration to the right by the state's errors."""
        slope = np.zeros(STATES)
        slope[TILT_NORTH] = GRAVITY_M_S2 * math.cos(self.heading_rad)
        slope[TILT_EAST] = GRAVITY_M_S2 * math.sin(self.heading_rad)
        return slope

    def _unbiased(self, rate_rad_s: Vector3) -> Vector3:
        x, y, z = rate_rad_s
        bx, by, bz = self.bias_rad_s
        return (x - bx, y - by, z - bz)

    def _correct(self, errors: Array) -> None:
        speed, north, east, bx, by, bz, wheelbase, late, forward = errors.tolist()
        self.speed_m_s = min(max(self.speed_m_s + speed, SPEEDS_M_S[0]), SPEEDS_M_S[1])
        tilt = from_rotation_vector((north, east, 0.0))
        self.level_from_sensor = normalise(multiply(tilt, self.level_from_sensor))
        x, y, z = self.bias_rad_s
        self.bias_rad_s = (x + bx, y + by, z + bz)
        self.wheelbase_m += wheelbase
        self.late_s += late
        self.heading_rad += forward


NOISE_DENSITY: Array = np.square(
    [ACCELERATION_NOISE_M_S_SQRT_S, TILT_NOISE_RAD_SQRT_S, TILT_NOISE_RAD_SQRT_S,
     *[BIAS_NOISE_RAD_S_SQRT_S] * 3, 0.0, 0.0, FORWARD_NOISE_RAD_SQRT_S]
)  # fmt: skip
