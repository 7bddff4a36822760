"""How wrong an increment may be: the covariance it is sent with.

A model, stated so that it can be checked against recordings with truth. Errors of one increment
are taken as independent of the next one's; what is common to all (scale, steady heading drift)
fusion carries as states of its own.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from edge_agent.inertial.linear_zupt import Stride

Covariance4: TypeAlias = tuple[
    float, float, float, float, float, float, float, float, float, float
]  # fmt: skip
"""Upper triangle, row by row, of (north, east, down, heading): m², m·rad, rad²."""

STILL_SD_M = 0.02
"""How far the foot rolls under a stance that is taken as still."""

SCALE_SD = 0.02
"""Of a stride's length: rolling at its ends that the linear calibration does not see."""

GAP_SPEED_M_S = 1.0
"""How wrong the mean speed over a gap of bridged samples is."""

LOST_SPEED_M_S = 1.5
LOST_CLIMB_M_S = 0.5
"""How fast a responder moves of whom only the time is known."""

HEADING_WALK_RAD_SQRT_S = math.radians(0.3)
HEADING_DRIFT_RAD_S = math.radians(0.1)
HEADING_DRIFT_UNKNOWN_RAD_S = math.radians(0.5)
"""Gyro noise, and what is left of its bias when that is known, and when it is not."""

GAP_TURN_RAD_S = 0.5
"""How wrong the mean turn over a gap of bridged samples is."""

LARGEST_VARIANCE_M2 = 1e10
UNKNOWN_HEADING_VARIANCE_RAD2 = math.pi**2 / 3.0


def heading_variance(elapsed_s: float, gap_s: float, *, bias_known: bool) -> float:
    """Return the variance (rad²) of a heading change by the gyro over ``elapsed_s``."""
    drift_rad_s = HEADING_DRIFT_RAD_S if bias_known else HEADING_DRIFT_UNKNOWN_RAD_S
    variance_rad2 = (
        HEADING_WALK_RAD_SQRT_S**2 * elapsed_s
        + (drift_rad_s * elapsed_s) ** 2
        + (GAP_TURN_RAD_S * gap_s) ** 2
    )
    return min(variance_rad2, UNKNOWN_HEADING_VARIANCE_RAD2)


def stride_covariance(stride: Stride, gap_s: float, heading_variance_rad2: float) -> Covariance4:
    """Return the covariance of a linearly calibrated stride and the heading change along it.

    Linear calibration supposes that velocity error grew evenly. Had the residual ``r`` come in one
    kick instead, at any moment of the swing alike, the stride would be off by up to ``±r·T/2``,
    with a variance of ``(r·T)²/12`` along each axis. A heading error that grows over the swing
    turns the stride by half of itself, which ties position to heading.
    """
    north_m, east_m, down_m = stride.displacement_m
    common_m2 = (
        STILL_SD_M**2
        + SCALE_SD**2 * (north_m * north_m + east_m * east_m + down_m * down_m)
        + (GAP_SPEED_M_S * gap_s) ** 2
    )
    nn, ee, dd = (
        common_m2 + (rate_m_s * stride.duration_s) ** 2 / 12.0 for rate_m_s in stride.residual_m_s
    )
    # Derivative of the stride by the heading error at its end.
    gn, ge = -0.5 * east_m, 0.5 * north_m
    hh = heading_variance_rad2
    return (nn + hh * gn * gn, hh * gn * ge, 0.0, hh * gn,
            ee + hh * ge * ge, 0.0, hh * ge,
            dd, 0.0,
            hh)  # fmt: skip


def lost_covariance(elapsed_s: float, heading_variance_rad2: float) -> Covariance4:
    """Return the covariance of a movement of which nothing is known but that it took so long."""
    level_m2 = min((LOST_SPEED_M_S * elapsed_s) ** 2, LARGEST_VARIANCE_M2)
    down_m2 = min((LOST_CLIMB_M_S * elapsed_s) ** 2, LARGEST_VARIANCE_M2)
    return (level_m2, 0.0, 0.0, 0.0,
            level_m2, 0.0, 0.0,
            down_m2, 0.0,
            heading_variance_rad2)  # fmt: skip
