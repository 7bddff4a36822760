"""The errors of one run, second by second.

Everything is scored at whole seconds, from the first estimate of a track to the last truth of its
responder; between two estimates a track is a straight line, after its last it stands still.
*Team* errors remain after the one rotation of the whole team about its first DAP that suits it
best, for proximity cannot observe that rotation; *pair* errors are those of the vector from one
responder to another.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import combinations
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.confidence import inside95, normalised_squared_error
from command_post.evaluation.evidence import Evidence, Method, Track
from shared.maths.polygons import inside_polygon

Floats: TypeAlias = NDArray[np.float64]

ON_FLOOR_M = 0.5
"""Who is further from every floor is on stairs, and on no floor that could be told wrongly."""


class TrackErrors(NamedTuple):
    """One responder's errors at each second scored (n ≥ 1), ``time_s`` from the track's first.

    ``inside`` says when the truth was in the region published for 95 %, ``squared_error`` is the
    horizontal error squared and normalised by the covariance published with it; ``None`` for a
    track that has none. ``floors_off`` is by how many floors the estimate was off, −1 while the
    responder was on none; ``None`` where the building is not known.
    """

    time_s: Floats
    absolute_m: Floats
    team_m: Floats
    vertical_m: Floats
    end_m: float
    inside: NDArray[np.bool_] | None
    squared_error: Floats | None
    floors_off: NDArray[np.intp] | None


class MethodErrors(NamedTuple):
    """One way of tracking: each responder's errors by id, all pairs' (p,), and each DAP's.

    ``pair_m`` is taken after the team's one rotation, ``pair_unturned_m`` without it. ``dap_m`` has
    the horizontal errors of the DAPs that somebody set down.
    """

    responders: dict[str, TrackErrors]
    pair_m: Floats
    pair_unturned_m: Floats
    dap_m: dict[str, float]


class RunErrors(NamedTuple):
    """All errors of one run, to be scored alone or thrown together with others'.

    ``pdr`` is dead reckoning of each responder's increments from their start, ``live`` what the
    post said at the time, ``after`` what it made of everything afterwards, if it did.
    """

    pdr: MethodErrors
    live: MethodErrors
    after: MethodErrors | None


class _Compared(NamedTuple):
    """A track beside its truth at the same whole seconds: (n,), (n, 3) and (n, 3) or ``None``."""

    time_s: Floats
    track_m: Floats
    truth_m: Floats
    covariance_m2: Floats | None
    inside: NDArray[np.bool_] | None
    end_m: float


def measure(evidence: Evidence, floors_down_m: Floats | None = None) -> RunErrors:
    """Return the errors of one run, from whatever evidence there is.

    ``floors_down_m`` (f,) are the heights of the building's floors, down, if they are known.
    """
    return RunErrors(
        pdr=_method_errors(evidence, "pdr", floors_down_m),
        live=_method_errors(evidence, "live", floors_down_m),
        after=_method_errors(evidence, "after", floors_down_m) if evidence.is_smoothed else None,
    )


def _method_errors(
    evidence: Evidence, method: Method, floors_down_m: Floats | None
) -> MethodErrors:
    compared = {
        responder_id: both
        for responder_id, track in evidence.tracks(method).items()
        if (both := _compare(track, evidence.truth(responder_id))) is not None
    }
    pivot_m = evidence.first_dap_m()
    turn_rad = _team_rotation_rad(compared.values(), pivot_m)
    return MethodErrors(
        {
            responder_id: _track_errors(both, turn_rad, pivot_m, floors_down_m)
            for responder_id, both in compared.items()
        },
        _pair_errors(compared, turn_rad),
        _pair_errors(compared, 0.0),
        evidence.dap_errors_m(method),
    )


def _compare(track: Track, truth: Track | None) -> _Compared | None:
    """Put a track beside its truth at whole seconds; ``None`` if the two never meet."""
    if truth is None:
        return None
    last_s = truth.time_s[-1]
    first_s = max(track.time_s[0], truth.time_s[0])
    seconds = np.arange(math.ceil(first_s), math.floor(last_s) + 1.0)
    if seconds.size == 0:
        return None
    end_m = track.at(np.array([last_s])).position_m[0] - truth.position_m[-1]
    at_seconds = track.at(seconds)
    truth_m = truth.at(seconds).position_m
    covariance_m2 = at_seconds.covariance_m2
    inside = None
    if covariance_m2 is not None:
        inside = inside95(at_seconds.position_m - truth_m, covariance_m2)
        _look_into_regions(track, truth, seconds, inside)
    return _Compared(
        time_s=seconds,
        track_m=at_seconds.position_m,
        truth_m=truth_m,
        covariance_m2=covariance_m2,
        inside=inside,
        end_m=float(np.hypot(end_m[0], end_m[1])),
    )


def _look_into_regions(
    track: Track, truth: Track, seconds: Floats, inside: NDArray[np.bool_]
) -> None:
    """Where the newest estimate gave outlines, say in ``inside`` if the truth then was in them.

    Outlines, unlike ellipses, are not carried on from one estimate to the next.
    """
    newest = np.maximum(np.searchsorted(track.time_s, seconds, side="right") - 1, 0)
    for k in np.unique(newest):
        outlines = track.regions_m.get(int(k), ())
        if outlines:
            place_m = truth.at(track.time_s[k : k + 1]).position_m[:, :2]
            found = any(inside_polygon(place_m, outline)[0] for outline in outlines)
            inside[newest == k] = found


def _track_errors(
    both: _Compared, turn_rad: float, pivot_m: Floats, floors_down_m: Floats | None
) -> TrackErrors:
    error_m = both.track_m - both.truth_m
    turned_m = _turned(both.track_m[:, :2] - pivot_m, turn_rad)
    covariance_m2 = both.covariance_m2
    return TrackErrors(
        time_s=both.time_s - both.time_s[0],
        absolute_m=_lengths(error_m),
        team_m=_lengths(turned_m + pivot_m - both.truth_m[:, :2]),
        vertical_m=np.abs(error_m[:, 2]),
        end_m=both.end_m,
        inside=both.inside,
        squared_error=None
        if covariance_m2 is None
        else normalised_squared_error(error_m, covariance_m2),
        floors_off=None if floors_down_m is None else _floors_off(both, floors_down_m),
    )


def _floors_off(both: _Compared, floors_down_m: Floats) -> NDArray[np.intp]:
    """Return by how many floors (n,) the track is off, −1 while its responder is on none."""
    floors_m = np.sort(floors_down_m)
    away_m = np.abs(both.truth_m[:, 2:] - floors_m)
    told_floor = np.abs(both.track_m[:, 2:] - floors_m).argmin(axis=1)
    off = np.abs(told_floor - away_m.argmin(axis=1))
    return np.where(away_m.min(axis=1) < ON_FLOOR_M, off, -1)


def _team_rotation_rad(compared: Iterable[_Compared], pivot_m: Floats) -> float:
    """Return the rotation about ``pivot_m`` that brings all tracks closest to the truth.

    It is the angle of Σ conj(track)·truth, places as complex numbers: the least-squares solution
    for a rotation in the plane (Umeyama 1991, for two dimensions and no scale).
    """
    total = 0.0 + 0.0j
    for both in compared:
        track = (both.track_m[:, :2] - pivot_m) @ np.array([1.0, 1.0j])
        truth = (both.truth_m[:, :2] - pivot_m) @ np.array([1.0, 1.0j])
        total += complex(np.vdot(track, truth))
    return math.atan2(total.imag, total.real)


def _turned(vectors_m: Floats, turn_rad: float) -> Floats:
    """Return the horizontal parts (n, 2) of (n, ≥2), turned clockwise by ``turn_rad``."""
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    north, east = vectors_m[:, 0], vectors_m[:, 1]
    return np.stack([cosine * north - sine * east, sine * north + cosine * east], axis=1)


def _pair_errors(compared: Mapping[str, _Compared], turn_rad: float) -> Floats:
    """Return the errors (p,) of the vector between any two responders while both are scored.

    The tracks are first turned by ``turn_rad``.
    """
    errors = [np.empty(0)]
    for one, other in combinations(compared.values(), 2):
        _, at_one, at_other = np.intersect1d(one.time_s, other.time_s, return_indices=True)
        apart_m = one.track_m[at_one] - other.track_m[at_other]
        truly_apart_m = one.truth_m[at_one] - other.truth_m[at_other]
        errors.append(_lengths(_turned(apart_m, turn_rad) - truly_apart_m[:, :2]))
    return np.concatenate(errors)


def _lengths(vectors_m: Floats) -> Floats:
    """Return the horizontal lengths (n,) of (n, ≥2)."""
    return np.asarray(np.hypot(vectors_m[:, 0], vectors_m[:, 1]))
