"""Roll, pitch and yaw by an extended Kalman filter: gyro as process, gravity as measurement.

As in "A study on smartphone indoor navigation technology using extended Kalman filter". Nothing
measures yaw: it is what the process makes of it.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.maths.angles import wrap_rad
from shared.maths.rotations import Vector3

Array: TypeAlias = NDArray[np.float64]

STEEPEST_RAD = math.radians(89.0)
"""Euler's kinematics end at a pitch of 90°; a pitch is held short of it."""


class EkfSettings(NamedTuple):
    """Noise: of the rates (rad/s/√Hz), and of gravity's direction while a walker shakes it."""

    rate_rad_sqrt_s: float = 0.01
    tilt_rad: float = 0.5


def euler_rates(roll_rad: float, pitch_rad: float, rate_rad_s: Vector3) -> Array:
    """Return how fast roll, pitch and yaw change, W(φ, θ)·(p, q, r), in rad/s."""
    p, q, r = rate_rad_s
    sin_roll, cos_roll = math.sin(roll_rad), math.cos(roll_rad)
    turning = q * sin_roll + r * cos_roll
    return np.array(
        [
            p + turning * math.tan(pitch_rad),
            q * cos_roll - r * sin_roll,
            turning / math.cos(pitch_rad),
        ]
    )


def euler_rates_jacobian(roll_rad: float, pitch_rad: float, rate_rad_s: Vector3) -> Array:
    """Return the derivatives (3, 3) of :func:`euler_rates` by roll, pitch and yaw."""
    _, q, r = rate_rad_s
    sin_roll, cos_roll = math.sin(roll_rad), math.cos(roll_rad)
    turning, across = q * sin_roll + r * cos_roll, q * cos_roll - r * sin_roll
    tan, secant = math.tan(pitch_rad), 1.0 / math.cos(pitch_rad)
    return np.array(
        [
            [across * tan, turning * secant**2, 0.0],
            [-turning, 0.0, 0.0],
            [across * secant, turning * secant * tan, 0.0],
        ]
    )


def tilt_of(force_m_s2: Vector3) -> tuple[float, float]:
    """Return the roll and pitch at which a sensor at rest reads ``force_m_s2``.

    At rest force is (g·sin θ, −g·cos θ·sin φ, −g·cos θ·cos φ), forward, right and down.
    """
    fx, fy, fz = force_m_s2
    return math.atan2(-fy, -fz), math.atan2(fx, math.hypot(fy, fz))


class AttitudeEkf:
    """State (roll, pitch, yaw) in rad and its covariance; yaw is 0 at the first sample."""

    def __init__(self, force_m_s2: Vector3, settings: EkfSettings | None = None) -> None:
        self._settings = settings or EkfSettings()
        roll_rad, pitch_rad = tilt_of(force_m_s2)
        self.state_rad = np.array([roll_rad, _held(pitch_rad), 0.0])
        self.covariance = np.diag([self._settings.tilt_rad**2] * 2 + [0.0])

    @property
    def yaw_rad(self) -> float:
        """Yaw, from where it was at first."""
        return float(self.state_rad[2])

    def predict(self, rate_rad_s: Vector3, duration_s: float) -> None:
        """Carry the state on by ``duration_s`` at a steady rate (sensor axes)."""
        roll_rad, pitch_rad, _ = self.state_rad.tolist()
        turned = self.state_rad + duration_s * euler_rates(roll_rad, pitch_rad, rate_rad_s)
        slope = np.eye(3) + duration_s * euler_rates_jacobian(roll_rad, pitch_rad, rate_rad_s)
        noise = self._settings.rate_rad_sqrt_s**2 * duration_s * np.eye(3)
        self.covariance = slope @ self.covariance @ slope.T + noise
        self._set(turned)

    def correct(self, force_m_s2: Vector3) -> None:
        """Weigh in the roll and pitch that ``force_m_s2`` would have at rest."""
        measured = tilt_of(force_m_s2)
        off = [wrap_rad(m - s) for m, s in zip(measured, self.state_rad[:2].tolist(), strict=True)]
        noise = self._settings.tilt_rad**2 * np.eye(2)
        gain = np.linalg.solve(self.covariance[:2, :2] + noise, self.covariance[:2]).T
        self.covariance = self.covariance - gain @ self.covariance[:2]
        self.covariance = 0.5 * (self.covariance + self.covariance.T)
        self._set(self.state_rad + gain @ np.array(off))

    def _set(self, state_rad: Array) -> None:
        roll_rad, pitch_rad, yaw_rad = state_rad.tolist()
        self.state_rad = np.array([wrap_rad(roll_rad), _held(pitch_rad), wrap_rad(yaw_rad)])


def _held(pitch_rad: float) -> float:
    return max(-STEEPEST_RAD, min(STEEPEST_RAD, pitch_rad))
