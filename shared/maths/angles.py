"""Angles on the circle."""

from __future__ import annotations

import math


def wrap_rad(angle_rad: float) -> float:
    """Return the same direction in [-π, π)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi
