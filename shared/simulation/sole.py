"""The boot's sole rolling on the ground: heel, flat, ball, toe, without slip.

In the foot's sagittal plane a convex sole is told by its support function h(θ), the height of
the sensor above the ground at pitch θ (toe up is positive). Rolling without slip then needs
nothing else: the contact lies −h'(θ) ahead of the sensor, and the sensor moves forward by
−∫h dθ (velocity is angular rate times the arm from the contact).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Array: TypeAlias = NDArray[np.float64]

PITCH_LIMITS_RAD = (-math.radians(140.0), math.radians(80.0))
KNOT_RAD = math.radians(0.5)
SWING_ROUNDING_M = 0.12
"""In the air a foot does not pivot about heel or ball: the same support function, far rounder."""


@dataclass(frozen=True)
class Sole:
    """Where the sensor sits on the boot: above the sole, ahead of the heel, behind the ball.

    ``rounding_m`` rounds heel and ball off, so that the contact wanders instead of jumping.
    """

    height_m: float
    to_heel_m: float
    to_ball_m: float
    rounding_m: float = 0.03

    def sensor_height_m(self, pitch_rad: Array, rounding_m: float) -> Array:
        """Support function: height of the sensor above the ground."""
        span_m = self.to_heel_m + self.to_ball_m
        sine = np.sin(pitch_rad)
        lever = 0.5 * (self.to_heel_m - self.to_ball_m) * sine
        rocker = 0.5 * np.sqrt((span_m * sine) ** 2 + rounding_m**2)
        return np.asarray(self.height_m * np.cos(pitch_rad) + lever + rocker)

    def rolling(self) -> CubicSpline[np.float64]:
        """Spline from pitch (rad) to the sensor's place over the ground, in metres.

        Its values are how far the sensor has rolled ahead of its place when flat, its height while
        the sole touches the ground, and its height while the foot swings free, clear of it.
        """
        count = round((PITCH_LIMITS_RAD[1] - PITCH_LIMITS_RAD[0]) / KNOT_RAD)
        pitch_rad = np.linspace(*PITCH_LIMITS_RAD, count)
        height = CubicSpline(pitch_rad, self.sensor_height_m(pitch_rad, self.rounding_m))
        free_m = self.sensor_height_m(pitch_rad, SWING_ROUNDING_M)
        rolled = height.antiderivative()
        ahead_m = rolled(0.0) - rolled(pitch_rad)
        return CubicSpline(pitch_rad, np.column_stack([ahead_m, height(pitch_rad), free_m]))
