"""Errors of an estimated path at the true stances.

The path is sampled at the instants of the true stances, and aligned with the truth by one rigid
rotation and translation in the plane, which no dead reckoning can know; it is never scaled. Length,
shape and heading are told apart: a closed loop hides scale, and a straight line hides drift.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from edge_agent.evaluation.estimate import EstimatedPath
from edge_agent.evaluation.truth import Array, Speed, Truth

FEWEST_STRIDES = 5
STANCE_TOLERANCE_S = 0.2
"""A true stance is found when a detected one is no further from its instant; swings last longer."""

PLACE_SHARE = 0.2
"""Of a stride: nearer than this to where it begins or ends, the boot still stands there."""

MOVING_M_S = 0.3
STANCE_SHARED_S = 0.05
"""A boot that motion capture sees faster than this, for so long before and after, does not stand.

Twice what a true stance may have: at a run the sensor above a rolling foot never slows to that.
"""

CLEAR_STRIDE_M = 0.3
"""Shorter strides have no clear direction, and no clear swing."""


class StanceErrors(NamedTuple):
    """What can be told at true stances. See each function of this module."""

    distance_error_pct: float
    stride_rmse_m: float
    ate_pct: float
    end_error_pct: float
    heading_drift_deg_min: float
    missed_stances_pct: float
    false_stances_pct: float


class RigidAlignment(NamedTuple):
    """``aligned = points @ rotation.T + shift``: rotation (2, 2), shift (2,)."""

    rotation: Array
    shift: Array


def stance_errors(path: EstimatedPath, truth: Truth) -> StanceErrors:
    """Return the errors of ``path``; raise ``ValueError`` under ``FEWEST_STRIDES`` true strides."""
    true_m = truth.stride_lengths_m
    if len(true_m) < FEWEST_STRIDES:
        raise ValueError(f"{len(true_m)} true strides: {FEWEST_STRIDES} are needed for a score")
    position_m = path.at(truth.time_s)[:, :2]
    estimated_m = np.linalg.norm(np.diff(position_m, axis=0), axis=1)
    total_m = truth.length_m
    return StanceErrors(
        distance_error_pct=float(100.0 * (estimated_m.sum() - total_m) / total_m),
        stride_rmse_m=float(np.sqrt(np.mean((estimated_m - true_m) ** 2))),
        ate_pct=100.0 * absolute_error_m(position_m, truth.position_m) / total_m,
        end_error_pct=100.0 * end_error_m(position_m, truth.position_m) / total_m,
        heading_drift_deg_min=heading_drift_deg_min(position_m, truth),
        missed_stances_pct=missed_stances_pct(path, truth),
        false_stances_pct=false_stances_pct(path, truth),
    )


def align(points_m: Array, onto_m: Array) -> RigidAlignment:
    """Return the rotation and shift, no mirror and no scale, that best lay (k, 2) on (k, 2).

    Least squares (Kabsch; Umeyama 1991 without scale).
    """
    mean_m, onto_mean_m = points_m.mean(axis=0), onto_m.mean(axis=0)
    left, _, right = np.linalg.svd((points_m - mean_m).T @ (onto_m - onto_mean_m))
    handed = np.diag([1.0, np.sign(np.linalg.det(right.T @ left.T))])
    rotation = right.T @ handed @ left.T
    return RigidAlignment(rotation, onto_mean_m - rotation @ mean_m)


def absolute_error_m(position_m: Array, true_m: Array) -> float:
    """Return the absolute trajectory error: the RMS distance after alignment."""
    rotation, shift = align(position_m, true_m)
    distance_m = np.linalg.norm(position_m @ rotation.T + shift - true_m, axis=1)
    return float(np.sqrt(np.mean(distance_m**2)))


def end_error_m(position_m: Array, true_m: Array) -> float:
    """Return how far off the last stance is, headings aligned on the first tenth of the strides."""
    first = max(4, (len(true_m) - 1) // 10 + 1)
    rotation, _ = align(position_m[:first], true_m[:first])
    travelled_m = rotation @ (position_m[-1] - position_m[0])
    return float(np.linalg.norm(travelled_m - (true_m[-1] - true_m[0])))


def heading_drift_deg_min(position_m: Array, truth: Truth) -> float:
    """Return the slope over time of the error of clear strides' directions; NaN under 6 of them."""
    clear = truth.stride_lengths_m > CLEAR_STRIDE_M
    if np.count_nonzero(clear) < 6:
        return math.nan
    error_rad = (_directions_rad(position_m) - _directions_rad(truth.position_m))[clear]
    mean_rad = np.angle(np.mean(np.exp(1j * error_rad)))
    error_rad = np.unwrap(np.angle(np.exp(1j * (error_rad - mean_rad))))
    slope_rad_s = np.polyfit(truth.time_s[1:][clear], error_rad, 1)[0]
    return float(np.degrees(slope_rad_s) * 60.0)


def _directions_rad(position_m: Array) -> Array:
    north_m, east_m = np.diff(position_m, axis=0).T
    directions_rad: Array = np.arctan2(east_m, north_m)
    return directions_rad


def missed_stances_pct(path: EstimatedPath, truth: Truth) -> float:
    """Return the share of true stances that no detected one tells of.

    One does within ``STANCE_TOLERANCE_S`` of the true instant; or, since the boot may stand for
    long and a method may tell one instant of it alone, between the neighbouring true stances and,
    in the estimate, within a fifth of the stride of where the boot stands at the true instant.
    """
    begin_s, end_s = path.stances_s.T
    near = (begin_s <= truth.time_s[:, None] + STANCE_TOLERANCE_S) & (
        end_s >= truth.time_s[:, None] - STANCE_TOLERANCE_S
    )
    return float(100.0 * np.mean(~(near.any(axis=1) | _at_their_places(path, truth))))


def _at_their_places(path: EstimatedPath, truth: Truth) -> NDArray[np.bool_]:
    """Return which true stances (k,) have a detected one beside them that has not left the place.

    At the place is nearer than a fifth of the true stride on that side of the instant.
    """
    middle_s = _middles_s(path)
    stride = np.searchsorted(truth.time_s, middle_s) - 1
    inside = (stride >= 0) & (stride < len(truth.time_s) - 1)
    middle_s, stride = middle_s[inside], stride[inside]
    margin_m = PLACE_SHARE * truth.stride_lengths_m[stride]
    middle_m = path.at(middle_s)[:, :2]
    ends_m = path.at(truth.time_s)[:, :2]
    found = np.zeros(len(truth.time_s), dtype=np.bool_)
    for stance in (stride, stride + 1):
        distance_m = np.linalg.norm(middle_m - ends_m[stance], axis=1)
        found[stance[distance_m <= margin_m]] = True
    return found


def _middles_s(path: EstimatedPath) -> Array:
    """Return the middles of the detected stances that have a beginning and an end."""
    finite = path.stances_s[np.isfinite(path.stances_s).all(axis=1)]
    middles_s: Array = finite.mean(axis=1)
    return middles_s


def false_stances_pct(path: EstimatedPath, truth: Truth) -> float:
    """Return the share of clear true swings that a detected stance cuts in two.

    It does when it lies between the two true stances and leaves, in the estimate, at least a fifth
    of the stride on either side: a stance that flickers while the boot stands cuts nothing. Where
    the truth has speed, it must also say that the boot moved: true stances are not told where the
    boot slowed down too briefly, and what falls between two of them need not be a swing.
    """
    middle_s = _middles_s(path)
    middle_s = middle_s[_moves(middle_s, truth.speed)]
    stood_m = path.at(middle_s)[:, :2]
    ends_m = path.at(truth.time_s)[:, :2]
    cut = []
    for stride in np.flatnonzero(truth.stride_lengths_m > CLEAR_STRIDE_M):
        inside = (middle_s > truth.time_s[stride]) & (middle_s < truth.time_s[stride + 1])
        margin_m = PLACE_SHARE * truth.stride_lengths_m[stride]
        from_m = np.linalg.norm(stood_m[inside] - ends_m[stride], axis=1)
        to_m = np.linalg.norm(stood_m[inside] - ends_m[stride + 1], axis=1)
        cut.append(bool(np.any((from_m > margin_m) & (to_m > margin_m))))
    return float(100.0 * np.mean(cut)) if cut else math.nan


def _moves(instant_s: Array, speed: Speed | None) -> NDArray[np.bool_]:
    """Return at which of ``instant_s`` (m,) the boot moves; maybe all, where there is no speed.

    While the capture had lost the boot, none: then nobody can say so.
    """
    if speed is None:
        return np.ones(len(instant_s), dtype=np.bool_)
    first, end = np.searchsorted(
        speed.time_s, (instant_s - STANCE_SHARED_S, instant_s + STANCE_SHARED_S)
    )
    slowest_m_s = [
        np.fmin.reduce(speed.speed_m_s[a:b], initial=np.nan)
        for a, b in zip(first, end, strict=True)
    ]
    return np.array(slowest_m_s) > MOVING_M_S


def path_length_m(position_m: Array) -> float:
    """Return the length of the way through ``position_m`` (n, 2 or 3)."""
    return float(np.linalg.norm(np.diff(position_m, axis=0), axis=1).sum())


class Closure(NamedTuple):
    """How far the end is from the start, in the plane and in space, and how long the path was."""

    closure_2d_m: float
    closure_3d_m: float
    length_m: float


def closure(path: EstimatedPath) -> Closure:
    """Return what can be told of a recording that ends where it began, without other truth."""
    travelled_m = path.position_m[-1] - path.position_m[0]
    return Closure(
        float(np.linalg.norm(travelled_m[:2])),
        float(np.linalg.norm(travelled_m)),
        path_length_m(path.position_m[:, :2]),
    )
