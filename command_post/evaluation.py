"""The score card: how far tracks and DAPs are from the truth (pure).

Everything is scored at whole seconds, from the first estimate of a track to the last truth of its
responder; between two estimates a track is a straight line, after its last it stands still.
Absolute errors are those of CE50 and CE95 (ISO/IEC 18305). *Team* errors remain after the one
rotation of the whole team about its first DAP that suits it best, for proximity cannot observe
that rotation; *pair* errors are those of the vector from one responder to another.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from command_post.confidence import inside95
from command_post.evidence import Evidence, Method, Track
from shared.maths.statistics import circular_error

Floats: TypeAlias = NDArray[np.float64]

FAILED_M = 10.0
"""A track has failed when the 95th percentile of its absolute error is above this."""


class Radii(msgspec.Struct, frozen=True):
    """Radii that half and 95 % of the errors stay within."""

    ce50_m: float
    ce95_m: float


class MethodScore(msgspec.Struct, frozen=True, kw_only=True):
    """One way of tracking, scored. ``None`` where there is nothing to score.

    ``team`` and ``pair`` (between responders) are taken after the one rotation of the whole team
    that fits the truth best, for nothing that is heard inside tells which way the map is turned;
    ``abs`` and ``pair_unturned`` are taken as it stands.
    ``end_m`` is the median responder's absolute error at the last truth, ``vertical_m`` the median
    absolute error in height.
    """

    absolute: Radii | None = msgspec.field(name="abs")
    pair: Radii | None
    pair_unturned: Radii | None
    team: Radii | None
    end_m: float | None
    vertical_m: float | None


class DapScore(msgspec.Struct, frozen=True, kw_only=True):
    """Errors of the DAPs that responders set down: over all, and of each by id."""

    ce50_m: float
    ce95_m: float
    each_m: dict[str, float]


class ResponderScore(msgspec.Struct, frozen=True, kw_only=True):
    """One responder's absolute errors, by dead reckoning alone and live; and the live coverage."""

    pdr: Radii | None
    live: Radii | None
    pdr_end_m: float | None
    live_end_m: float | None
    coverage95_pct: float | None


class Score(msgspec.Struct, frozen=True, kw_only=True):
    """The score card of one run.

    ``pdr`` is dead reckoning of each responder's increments from their start, ``live`` what the
    post said at the time. ``coverage95_pct`` is the share of the time in which the truth was
    inside the 95 % ellipse that the post gave.
    """

    pdr: MethodScore
    live: MethodScore
    dap: DapScore | None
    coverage95_pct: float | None
    responders: dict[str, ResponderScore]


class PooledMethod(msgspec.Struct, frozen=True, kw_only=True):
    """One way of tracking over all runs; ``fail_pct`` is the share of tracks that failed."""

    absolute: Radii | None = msgspec.field(name="abs")
    team: Radii | None
    pair: Radii | None
    pair_unturned: Radii | None
    fail_pct: float | None


class PooledLive(PooledMethod, frozen=True, kw_only=True):
    """What the post said, over all runs."""

    dap: Radii | None
    coverage95_pct: float | None


class ScenarioScore(msgspec.Struct, frozen=True, kw_only=True):
    """All runs of one scenario, their errors thrown together."""

    runs: int
    live: PooledLive
    pdr: PooledMethod


class PooledScore(msgspec.Struct, frozen=True, kw_only=True):
    """The score card of a Monte Carlo, by scenario."""

    scenarios: dict[str, ScenarioScore]


class TrackErrors(NamedTuple):
    """One responder's errors at each second scored (n ≥ 1), metres.

    ``inside`` says when the truth was in the published 95 % ellipse; ``None`` for a track that
    has none.
    """

    absolute_m: Floats
    team_m: Floats
    vertical_m: Floats
    end_m: float
    inside: NDArray[np.bool_] | None


class MethodErrors(NamedTuple):
    """One way of tracking: each responder's errors by id, and all pairs' (p,) in metres.

    ``pair_m`` is taken after the team's one rotation, ``pair_unturned_m`` without it.
    """

    responders: dict[str, TrackErrors]
    pair_m: Floats
    pair_unturned_m: Floats


class RunErrors(NamedTuple):
    """All errors of one run, to be scored alone or thrown together with others'."""

    pdr: MethodErrors
    live: MethodErrors
    dap_m: dict[str, float]


class _Compared(NamedTuple):
    """A track beside its truth at the same whole seconds: (n,), (n, 3) and (n, 3) or ``None``."""

    time_s: Floats
    track_m: Floats
    truth_m: Floats
    covariance_m2: Floats | None
    end_m: float


def measure(evidence: Evidence) -> RunErrors:
    """Return the errors of one run, from whatever evidence there is."""
    pivot_m = evidence.first_dap_m()
    return RunErrors(
        pdr=_method_errors(evidence, "pdr", pivot_m),
        live=_method_errors(evidence, "live", pivot_m),
        dap_m=evidence.dap_errors_m(),
    )


def score(errors: RunErrors) -> Score:
    """Return the score card of one run; what cannot be scored is ``None``."""
    ids = sorted(errors.pdr.responders | errors.live.responders)
    dap = _radii([list(errors.dap_m.values())])
    return Score(
        pdr=_method_score(errors.pdr),
        live=_method_score(errors.live),
        dap=None if dap is None else DapScore(
            ce50_m=dap.ce50_m, ce95_m=dap.ce95_m, each_m=dict(sorted(errors.dap_m.items()))
        ),
        coverage95_pct=_coverage_pct(errors.live.responders.values()),
        responders={responder_id: _responder_score(responder_id, errors) for responder_id in ids},
    )  # fmt: skip


def pool(runs: Mapping[str, Sequence[RunErrors]]) -> PooledScore:
    """Return the score card of many runs, given by the name of their scenario."""
    return PooledScore(scenarios={name: _scenario_score(each) for name, each in runs.items()})


def _method_errors(evidence: Evidence, method: Method, pivot_m: Floats) -> MethodErrors:
    compared = {
        responder_id: both
        for responder_id, track in evidence.tracks(method).items()
        if (both := _compare(track, evidence.truth(responder_id))) is not None
    }
    turn_rad = _team_rotation_rad(compared.values(), pivot_m)
    return MethodErrors(
        {
            responder_id: _track_errors(both, turn_rad, pivot_m)
            for responder_id, both in compared.items()
        },
        _pair_errors(compared, turn_rad),
        _pair_errors(compared, 0.0),
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
    return _Compared(
        time_s=seconds,
        track_m=at_seconds.position_m,
        truth_m=truth.at(seconds).position_m,
        covariance_m2=at_seconds.covariance_m2,
        end_m=float(np.hypot(end_m[0], end_m[1])),
    )


def _track_errors(both: _Compared, turn_rad: float, pivot_m: Floats) -> TrackErrors:
    error_m = both.track_m - both.truth_m
    turned_m = _turned(both.track_m[:, :2] - pivot_m, turn_rad)
    return TrackErrors(
        absolute_m=_lengths(error_m),
        team_m=_lengths(turned_m + pivot_m - both.truth_m[:, :2]),
        vertical_m=np.abs(error_m[:, 2]),
        end_m=both.end_m,
        inside=None if both.covariance_m2 is None else inside95(error_m, both.covariance_m2),
    )


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


def _radii(errors_m: Iterable[Sequence[float] | Floats]) -> Radii | None:
    """Return CE50 and CE95 of errors thrown together; ``None`` if there are none."""
    together = np.concatenate([np.empty(0), *map(np.asarray, errors_m)])
    return Radii(*circular_error(together)) if together.size else None


def _method_score(errors: MethodErrors) -> MethodScore:
    tracks = errors.responders.values()
    return MethodScore(
        absolute=_radii(track.absolute_m for track in tracks),
        pair=_radii([errors.pair_m]),
        pair_unturned=_radii([errors.pair_unturned_m]),
        team=_radii(track.team_m for track in tracks),
        end_m=float(np.median([track.end_m for track in tracks])) if tracks else None,
        vertical_m=float(np.median(np.concatenate([track.vertical_m for track in tracks])))
        if tracks
        else None,
    )


def _responder_score(responder_id: str, errors: RunErrors) -> ResponderScore:
    pdr = errors.pdr.responders.get(responder_id)
    live = errors.live.responders.get(responder_id)
    return ResponderScore(
        pdr=_radii([pdr.absolute_m]) if pdr else None,
        live=_radii([live.absolute_m]) if live else None,
        pdr_end_m=pdr.end_m if pdr else None,
        live_end_m=live.end_m if live else None,
        coverage95_pct=_coverage_pct([live]) if live else None,
    )


def _coverage_pct(tracks: Iterable[TrackErrors]) -> float | None:
    inside = [track.inside for track in tracks if track.inside is not None]
    return 100.0 * float(np.concatenate(inside).mean()) if inside else None


def _scenario_score(runs: Sequence[RunErrors]) -> ScenarioScore:
    live = _pooled([run.live for run in runs])
    return ScenarioScore(
        runs=len(runs),
        live=PooledLive(
            absolute=live.absolute,
            team=live.team,
            pair=live.pair,
            pair_unturned=live.pair_unturned,
            fail_pct=live.fail_pct,
            dap=_radii([list(run.dap_m.values()) for run in runs]),
            coverage95_pct=_coverage_pct(
                track for run in runs for track in run.live.responders.values()
            ),
        ),
        pdr=_pooled([run.pdr for run in runs]),
    )


def _pooled(runs: Sequence[MethodErrors]) -> PooledMethod:
    tracks = [track for run in runs for track in run.responders.values()]
    failed = [float(np.percentile(track.absolute_m, 95.0)) > FAILED_M for track in tracks]
    return PooledMethod(
        absolute=_radii(track.absolute_m for track in tracks),
        team=_radii(track.team_m for track in tracks),
        pair=_radii(run.pair_m for run in runs),
        pair_unturned=_radii(run.pair_unturned_m for run in runs),
        fail_pct=100.0 * float(np.mean(failed)) if failed else None,
    )
