"""Velocity of the trunk as published: integrated, high-passed at 0.5 Hz, zero at each stop.

"Gait information and pedestrian localisation with a 3-axis accelerometer". The filter's order is
not told; here it is of the first, causal. Whatever its order, it takes the mean out with the drift:
of a walk at even speed what is left is how speed swings about that mean within each step.
"""

from __future__ import annotations

import math

CUTOFF_HZ = 0.5
_TIME_S = 1.0 / (2.0 * math.pi * CUTOFF_HZ)


class HighPassedVelocity:
    """Velocity along one axis."""

    def __init__(self) -> None:
        self.velocity_m_s = 0.0
        """What the filter leaves of it."""

    def step(self, acceleration_m_s2: float, period_s: float) -> float:
        """Take in the acceleration over ``period_s``; return the velocity at its end."""
        gained_m_s = acceleration_m_s2 * period_s
        kept = _TIME_S / (_TIME_S + period_s)
        self.velocity_m_s = kept * (self.velocity_m_s + gained_m_s)
        return self.velocity_m_s

    def stop(self) -> None:
        """Take the velocity to be zero: the trunk stands (ZUPT)."""
        self.velocity_m_s = 0.0
