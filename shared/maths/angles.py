"""Angles on the circle."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

HALF_PI = math.pi / 2.0

Angle = TypeVar("Angle", float, NDArray[np.float64])


def wrap_rad(angle_rad: float) -> float:
    """Return the same direction in [-π, π)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def nearest_right_angle_rad(angle_rad: Angle) -> Angle:
    """Return the whole multiple of a right angle that is nearest: what is left is within ±45°."""
    return HALF_PI * ((angle_rad / HALF_PI + 0.5) // 1.0)
