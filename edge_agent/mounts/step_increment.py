"""A step as an increment: chest and waist tell where it leads by how the sensor faces."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD
from edge_agent.inertial.linear_zupt import PathPoint
from edge_agent.inertial.stride_error import STILL_SD_M, UNKNOWN_HEADING_VARIANCE_RAD2
from edge_agent.mounts.interface import Increment
from shared.messages import Activity
from shared.units import NS_PER_S

STEP_SCALE_SD = 0.1
"""Of a step's length, from the one the bounce tells: some ten per cent, from step to step."""

SWAY_RAD = math.radians(5.0)
"""By how much a single step leads aside of the way."""

RISE_SD_M = 0.1
"""A step may be one of stairs, whose height no bounce tells."""

FAST_STEP_S, RUN_STEP_S = 0.45, 0.38
"""A quicker step is one of fast walking, or of running."""


class StepTimes(Protocol):
    """When a step began and ended."""

    @property
    def start_time_ns(self) -> int:
        """When it began."""

    @property
    def end_time_ns(self) -> int:
        """When it ended."""


class Direction(NamedTuple):
    """How the wearer faces as a step ends, and how far they have turned since the one before.

    ``variance_rad2`` is of that turn. ``course_rad`` is where the step leads, if not along the
    middle of the turn; ``facing_sd_rad`` is how well it is known how the sensor is worn.
    """

    heading_rad: float
    d_heading_rad: float
    variance_rad2: float
    course_rad: float | None = None
    facing_sd_rad: float = UNKNOWN_HEADING_SD_RAD


def step_ahead(
    step: StepTimes, length_m: float, direction: Direction, *, scale_sd: float = STEP_SCALE_SD
) -> Increment:
    """Return the increment of a step of ``length_m`` that leads as ``direction`` says."""
    course_rad = direction.course_rad
    if course_rad is None:
        course_rad = direction.heading_rad - 0.5 * direction.d_heading_rad
    c, s = math.cos(course_rad), math.sin(course_rad)
    along_m2 = STILL_SD_M**2 + (scale_sd * length_m) ** 2
    aside_m2 = STILL_SD_M**2 + (SWAY_RAD * length_m) ** 2
    hh = direction.variance_rad2
    # Derivative of the step by the heading error at its end.
    gn, ge = -0.5 * length_m * s, 0.5 * length_m * c
    covariance = (
        along_m2 * c * c + aside_m2 * s * s + hh * gn * gn,
        (along_m2 - aside_m2) * c * s + hh * gn * ge, 0.0, hh * gn,
        along_m2 * s * s + aside_m2 * c * c + hh * ge * ge, 0.0, hh * ge,
        RISE_SD_M**2, 0.0,
        hh,
    )  # fmt: skip
    return Increment(
        step.start_time_ns,
        step.end_time_ns,
        (length_m * c, length_m * s, 0.0),
        direction.d_heading_rad,
        direction.heading_rad,
        covariance,
        (PathPoint(step.start_time_ns, 0.0, 0.0, 0.0),),
        facing_sd_rad=direction.facing_sd_rad,
        activity=activity_of(step),
    )


def step_anywhere(step: StepTimes, length_m: float) -> Increment:
    """Return the increment of a step of which nothing tells where it leads."""
    level_m2 = 0.5 * length_m**2
    covariance = (level_m2, 0.0, 0.0, 0.0,
                  level_m2, 0.0, 0.0,
                  RISE_SD_M**2, 0.0,
                  UNKNOWN_HEADING_VARIANCE_RAD2)  # fmt: skip
    return Increment(
        step.start_time_ns,
        step.end_time_ns,
        (0.0, 0.0, 0.0),
        0.0,
        0.0,
        covariance,
        (),
        activity=activity_of(step),
    )


def activity_of(step: StepTimes) -> Activity:
    """Return what legs do that step so quickly."""
    lasted_s = (step.end_time_ns - step.start_time_ns) / NS_PER_S
    if lasted_s < RUN_STEP_S:
        return "run"
    return "fast" if lasted_s < FAST_STEP_S else "walk"
