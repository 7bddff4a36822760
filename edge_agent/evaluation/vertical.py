"""Errors of height, wherever the truth has it: along the path, by increment and by floor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from edge_agent.evaluation.errors import path_length_m
from edge_agent.evaluation.estimate import EstimatedPath
from edge_agent.evaluation.truth import Array, Height, Truth
from edge_agent.mounts.interface import Increment
from shared.units import NS_PER_S

SIGMAS_95 = 1.959964
"""95 % of a normal error are within so many standard deviations."""

SAME_FLOOR_M = 0.15
FLOORS_APART_M = 1.0
"""True stances in a row within the first are on one floor; floors differ by more than the second.

Each step of a flight is taken by one stance of a foot, and is no floor.
"""


class VerticalErrors(NamedTuple):
    """What height adds.

    The error of height itself, RMS over all instants and at the end, both paths starting from
    zero; that of the distance in space, from true stance to true stance. Of each increment, since
    the end of the one before: the RMS error of ``d_down_m``, and the share of errors within 1.96
    of the standard deviations told. The RMS error of the climb from one floor to the next, NaN
    without another floor.
    """

    vertical_rmse_m: float
    vertical_end_error_m: float
    distance_3d_error_pct: float
    vertical_increment_rmse_m: float
    vertical_coverage95_pct: float
    floor_rmse_m: float


def vertical_errors(
    increments: Sequence[Increment], path: EstimatedPath, truth: Truth
) -> VerticalErrors | None:
    """Return the errors of ``increments``, laid end to end in ``path``; ``None`` without height."""
    if truth.height is None:
        return None
    height = truth.height
    down_m = path.at(height.time_s)[:, 2]
    error_m = (down_m - down_m[0]) - (height.down_m - height.down_m[0])
    stood_down_m = np.interp(truth.time_s, height.time_s, height.down_m)
    true_m = path_length_m(np.column_stack((truth.position_m, stood_down_m)))
    estimated_m = path_length_m(path.at(truth.time_s))
    increment_error_m, sd_m = _increment_errors(increments, height)
    return VerticalErrors(
        _rms(error_m),
        float(error_m[-1]),
        100.0 * (estimated_m - true_m) / true_m if true_m > 0.0 else math.nan,
        _rms(increment_error_m),
        _share_pct(np.abs(increment_error_m) <= SIGMAS_95 * sd_m),
        _rms(_floor_errors_m(path.at(truth.time_s)[:, 2], stood_down_m)),
    )


def _increment_errors(increments: Sequence[Increment], height: Height) -> tuple[Array, Array]:
    """Return the error of each ``d_down_m`` while height is known, and what it was told to be.

    What the boot rose or sank unsaid before an increment is in the increment's error.
    """
    ends_s = np.array([increments[0].start_time_ns, *(one.end_time_ns for one in increments)])
    ends_s = ends_s / NS_PER_S
    known = (ends_s[:-1] >= height.time_s[0]) & (ends_s[1:] <= height.time_s[-1])
    told_m = np.array([one.displacement_m[2] for one in increments])
    sd_m = np.sqrt([one.covariance[7] for one in increments])
    true_m = np.diff(np.interp(ends_s, height.time_s, height.down_m))
    return (told_m - true_m)[known], sd_m[known]


def _floor_errors_m(down_m: Array, true_m: Array) -> Array:
    """Return the error of each climb between floors, of heights at true stances (k,)."""
    splits = np.flatnonzero(np.abs(np.diff(true_m)) > SAME_FLOOR_M) + 1
    floors = [row for row in np.split(np.arange(len(true_m)), splits) if len(row) > 1]
    errors: list[float] = []
    here = 0
    for there in range(1, len(floors)):
        left, reached = floors[here][-1], floors[there][0]
        climbed_m = float(true_m[reached] - true_m[left])
        if abs(climbed_m) > FLOORS_APART_M:
            errors.append(float(down_m[reached] - down_m[left]) - climbed_m)
            here = there
    return np.array(errors)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else math.nan


def _share_pct(within: NDArray[np.bool_]) -> float:
    return float(100.0 * np.mean(within)) if within.size else math.nan
