"""Whether strides are as sure as they say: the share inside their own 95 % ellipse."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from edge_agent.evaluation.errors import CLEAR_STRIDE_M, align
from edge_agent.evaluation.estimate import EstimatedPath
from edge_agent.evaluation.truth import Array, Truth
from edge_agent.mounts.interface import Increment
from shared.units import NS_PER_S

ELLIPSE_95 = -2.0 * math.log(0.05)
"""Squared Mahalanobis distance that 95 % of errors in the plane stay within: χ² of two."""


class _Offset(NamedTuple):
    """Agent's heading minus the true one, and the variance of that: rad, rad²."""

    mean_rad: float
    variance_rad2: float


class _Stride(NamedTuple):
    """What lies between two true stances.

    ``told_m`` and ``true_m`` (2,) are the way in the agent's and in the truth's plane,
    ``covariance`` (3, 3) is the one told of (north, east, heading).
    """

    told_m: Array
    true_m: Array
    covariance: Array


class _Innovation(NamedTuple):
    """Error (2,) of a stride foretold, and its covariance (2, 2).

    ``lever_m`` (2,) is by how much the heading's offset moves the stride.
    """

    error_m: Array
    covariance_m2: Array
    lever_m: Array


def coverage95_pct(increments: Sequence[Increment], path: EstimatedPath, truth: Truth) -> float:
    """Return the share of true strides whose error lies inside the 95 % ellipse told for it.

    A stride goes from one true stance instant to the next. What is told of it holds given the
    heading at its start, which is off by all that has drifted before; the strides before say by
    how much, as they say it to whoever fuses them with places known. So the offset of the agent's
    heading is estimated from stride to stride, by a Kalman filter of this one state to which the
    true strides are measurements and the covariances told (of position, of heading, and between
    the two) are all it knows. The error of a stride is its displacement minus the true one turned
    by the offset as known *before* it: no stride is aligned with itself. Its ellipse is the one
    told, widened across the stride by how well the offset was known. The first stride that has a
    direction begins the estimate and is not judged. NaN if none can be.

    The covariance of a stride is the sum over the increments between the two instants; an
    increment that reaches beyond one of them (a stance missed) counts by the share of its time
    between them, as if its error grew evenly. A stride for which none was told is outside.
    """
    inside: list[bool] = []
    offset: _Offset | None = None
    for stride in _strides(increments, path, truth):
        if offset is None:
            offset = _first_offset(stride)
            continue
        foretold = _innovation(stride, offset)
        inside.append(_within(foretold.error_m, foretold.covariance_m2))
        offset = _corrected(offset, foretold, stride.covariance)
    return float(100.0 * np.mean(inside)) if inside else math.nan


def whole_path_coverage95_pct(
    increments: Sequence[Increment], path: EstimatedPath, truth: Truth
) -> float:
    """Return the share inside with headings aligned once, by the rotation of the whole path.

    As :func:`coverage95_pct` but for that, and the ellipse is as told. What heading has drifted
    since the path's mean is in the error and in no increment: on long walks this counts drift.
    """
    rotation, _ = align(path.at(truth.time_s)[:, :2], truth.position_m)
    inside = [
        _within(stride.told_m - stride.true_m @ rotation, stride.covariance[:2, :2])
        for stride in _strides(increments, path, truth)
    ]
    return float(100.0 * np.mean(inside))


def _strides(increments: Sequence[Increment], path: EstimatedPath, truth: Truth) -> list[_Stride]:
    told_m = np.diff(path.at(truth.time_s)[:, :2], axis=0)
    true_m = np.diff(truth.position_m, axis=0)
    covariances = np.diff(_summed_covariance(increments, truth.time_s), axis=0)
    return [_Stride(*stride) for stride in zip(told_m, true_m, covariances, strict=True)]


def _summed_covariance(increments: Sequence[Increment], time_s: Array) -> Array:
    """Return (k, 3, 3) of north, east, heading: all that was told up to each of ``time_s``."""
    ends_s = np.array([(i.start_time_ns, i.end_time_ns) for i in increments]) / NS_PER_S
    told = np.array([i.covariance for i in increments])
    summed = np.zeros((len(increments), 2, 10))
    summed[:, 1] = np.cumsum(told, axis=0)
    summed[1:, 0] = summed[:-1, 1]
    knots = summed.reshape(-1, 10)
    upper = [np.interp(time_s, ends_s.ravel(), knots[:, entry]) for entry in range(10)]
    nn, ne, _, nh, ee, _, eh, _, _, hh = upper
    return np.array([[nn, ne, nh], [ne, ee, eh], [nh, eh, hh]]).transpose(2, 0, 1)


def _first_offset(stride: _Stride) -> _Offset | None:
    """Return the offset at the end of ``stride`` by its direction; ``None`` if it has none."""
    north_m, east_m = stride.told_m.tolist()
    if min(math.hypot(north_m, east_m), float(np.linalg.norm(stride.true_m))) < CLEAR_STRIDE_M:
        return None
    true_north_m, true_east_m = stride.true_m.tolist()
    turned_rad = math.atan2(east_m, north_m) - math.atan2(true_east_m, true_north_m)
    # By (north, east, heading): of the direction told, less what heading has changed since.
    slope = np.array([-east_m, north_m, 0.0]) / (north_m**2 + east_m**2) - [0.0, 0.0, 1.0]
    return _Offset(turned_rad, float(slope @ stride.covariance @ slope))


def _innovation(stride: _Stride, offset: _Offset) -> _Innovation:
    c, s = math.cos(offset.mean_rad), math.sin(offset.mean_rad)
    true_north_m, true_east_m = stride.true_m.tolist()
    north_m, east_m = c * true_north_m - s * true_east_m, s * true_north_m + c * true_east_m
    lever_m = np.array([-east_m, north_m])
    spread_m2 = offset.variance_rad2 * np.outer(lever_m, lever_m)
    return _Innovation(
        stride.told_m - [north_m, east_m], stride.covariance[:2, :2] + spread_m2, lever_m
    )


def _corrected(offset: _Offset, foretold: _Innovation, covariance: Array) -> _Offset:
    """Return the offset at the end of a stride, which turns by an error tied to its position's."""
    grown_rad2 = offset.variance_rad2 + float(covariance[2, 2])
    if not np.linalg.det(foretold.covariance_m2) > 0.0:
        return _Offset(offset.mean_rad, grown_rad2)
    tied = offset.variance_rad2 * foretold.lever_m + covariance[:2, 2]
    gain = np.linalg.solve(foretold.covariance_m2, tied)
    return _Offset(
        offset.mean_rad + float(gain @ foretold.error_m), grown_rad2 - float(gain @ tied)
    )


def _within(error_m: Array, covariance_m2: Array) -> bool:
    """Whether ``error_m`` is inside the 95 % ellipse; in none, if the covariance is singular."""
    (nn, ne), (_, ee) = covariance_m2.tolist()
    north_m, east_m = error_m.tolist()
    # e'·adj(C)·e < χ²·det(C) says e'·C⁻¹·e < χ², and is false for a covariance of zero.
    squared = ee * north_m**2 - 2.0 * ne * north_m * east_m + nn * east_m**2
    return bool(squared < ELLIPSE_95 * (nn * ee - ne**2))
