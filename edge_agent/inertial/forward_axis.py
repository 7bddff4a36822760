"""Which way a vehicle faces, as vibration tells it: a phone lies any way round.

On the road a body pitches more, and faster, than it rolls: the level direction about which it
shakes most is across the vehicle. Which of the two ways along is forward, heave tells: the seats
and the dashboard lie before the axis that a body pitches about, so that they rise as the nose does.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

AXIS_SD_RAD = math.radians(5.0)
"""Of the axis over a few seconds."""

SMOOTHED_S = 0.06
SETTLED_S = 2.0
"""Heave and pitch of the body on its springs are slower than the first, faster than the second."""


class ForwardAxis(NamedTuple):
    """``heading_rad`` of the forward direction in the axes given.

    ``clearness`` is the ratio, 1 or more, of how strongly it shakes about the axis across to how
    strongly about the one along: near 1 they may be mistaken for each other.
    """

    heading_rad: float
    clearness: float


def forward_axes(
    period_s: float, north_rad_s: Array, east_rad_s: Array, down_m_s2: Array
) -> tuple[ForwardAxis, ForwardAxis]:
    """Return the forward direction by some seconds of level rates and vertical specific force.

    All (n,), evenly ``period_s`` apart, about and along axes that turn with the vehicle. The first
    is the likelier, the second is what it is if the two axes were mistaken for each other; its
    clearness is the inverse.
    """
    shaking = np.cov(np.diff(north_rad_s), np.diff(east_rad_s))
    strengths, axes = np.linalg.eigh(shaking)
    weaker, stronger = np.sqrt(np.maximum(strengths, 1e-12)).tolist()
    clearness = stronger / weaker
    heave_m_s2 = _swing(down_m_s2, period_s)
    rates_rad_s = np.column_stack((north_rad_s, east_rad_s))
    return (
        ForwardAxis(_forward(axes[:, 1], heave_m_s2, period_s, rates_rad_s), clearness),
        ForwardAxis(_forward(axes[:, 0], heave_m_s2, period_s, rates_rad_s), 1.0 / clearness),
    )


def _forward(across: Array, heave_m_s2: Array, period_s: float, rates_rad_s: Array) -> float:
    """Return the heading of forward, of the two at right angles to the level axis ``across``."""
    pitch_rad_s = _swing(rates_rad_s @ across, period_s)
    # Nose up is a turn about the right-hand axis; rising reads more upwards, which is −down.
    sign = -math.copysign(1.0, float(np.mean(pitch_rad_s * heave_m_s2)))
    north, east = across.tolist()
    return math.atan2(-sign * north, sign * east)


def _swing(signal: Array, period_s: float) -> Array:
    """Return ``signal`` (n,) between the two spans, by moving means."""
    return _moving_mean(signal, round(SMOOTHED_S / period_s)) - _moving_mean(
        signal, round(SETTLED_S / period_s)
    )


def _moving_mean(signal: Array, count: int) -> Array:
    count = max(1, min(count, len(signal)))
    kernel = np.ones(count)
    return np.convolve(signal, kernel, "same") / np.convolve(np.ones(len(signal)), kernel, "same")
