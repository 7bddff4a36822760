"""A wearer's own scale: how long their steps are, in those that the method tells of anybody.

A walk of a known length begins and ends standing, and the steps there are soft: told too short, or
not at all, or a push as one more. So the scale is told by steady steps: those at either end are
taken to be as long as the others, as many as it takes from where the trunk is as feet land.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, TypeAlias

import numpy as np

from edge_agent.evaluation.course_truth import Waypoints
from edge_agent.mounts.interface import Increment
from shared.units import NS_PER_S

Stepping: TypeAlias = Literal["chest", "waist"]

FULL_SHARE = 0.7
FULL_TIME = 1.3
"""A step no shorter than this share of the usual one, in no more than so many of its times, is no
push and no shuffle."""

SETTING_OUT_STEPS = 2
"""So many full steps at the beginning are told too short: the trunk does not bounce yet."""

BEFORE_STEPS: dict[Stepping, float] = {"waist": 0.6, "chest": 0.4}
AFTER_STEPS: dict[Stepping, float] = {"waist": 0.3, "chest": 0.4}
"""How far the trunk has gone as the first full step begins, and has still to go as the last ends,
in steps. As a foot lands the trunk is midway between both; a waist's filter tells it a tenth of a
second later."""


def steady_length_m(increments: Sequence[Increment], mount: Stepping, *, arrives: bool) -> float:
    """Return the length (m) of a walk from standing, by its steady steps; 0 of no full step.

    ``arrives`` if it ends standing, and not in the midst of the way.
    """
    steps = [one for one in increments if one.steps]
    length_m = np.array([math.hypot(*one.displacement_m[:2]) for one in steps])
    lasted_s = np.array([one.end_time_ns - one.start_time_ns for one in steps]) / NS_PER_S
    if not steps:
        return 0.0
    full = (length_m >= FULL_SHARE * np.median(length_m)) & (
        lasted_s <= FULL_TIME * np.median(lasted_s)
    )
    places = np.flatnonzero(full)
    if not places.size:
        return 0.0
    walked_m = length_m[places[0] : places[-1] + 1 if arrives else None]
    usual_m = float(np.median(walked_m))
    walked_m[:SETTING_OUT_STEPS] = usual_m
    ends = BEFORE_STEPS[mount]
    if arrives:
        walked_m[-1] = usual_m
        ends += AFTER_STEPS[mount]
    return float(walked_m.sum()) + ends * usual_m


def scale_over(
    increments: Sequence[Increment], truth: Waypoints, over_m: float, mount: Stepping
) -> float:
    """Return the scale that the way tells until it is first ``over_m`` from where it began.

    It is taken to be straight so far. It is 1 where nobody came so far, or nothing was told of it.
    """
    away_m = np.linalg.norm(truth.position_m - truth.position_m[0], axis=1)
    far = np.flatnonzero(away_m >= over_m)
    if not far.size:
        return 1.0
    until_ns = float(truth.time_s[far[0]]) * NS_PER_S
    begun = [one for one in increments if one.start_time_ns < until_ns]
    length_m = steady_length_m(begun, mount, arrives=len(begun) == len(increments))
    if begun and begun[-1].end_time_ns > until_ns:
        last = begun[-1]
        share = (last.end_time_ns - until_ns) / (last.end_time_ns - last.start_time_ns)
        length_m -= share * math.hypot(*last.displacement_m[:2])
    return float(away_m[far[0]]) / length_m if length_m > 0.0 else 1.0
