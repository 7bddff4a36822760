"""The score card of a Monte Carlo: the errors of many runs of a scenario thrown together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from command_post.evaluation.errors import MethodErrors, RunErrors, TrackErrors
from command_post.evaluation.resampling_runs import Interval, Redrawn
from command_post.evaluation.score_card import Radii, coverage_pct, radii

Floats: TypeAlias = NDArray[np.float64]

FAILED_M = 10.0
"""A track has failed when the 95th percentile of its absolute error is above this."""

WRONG_FLOOR_M = 15.0
"""What the IPIN competition adds to an error for each floor that it is off."""


class Vertical(msgspec.Struct, frozen=True):
    """Percentiles of the absolute error in height."""

    p50_m: float
    p95_m: float


class Consistency(msgspec.Struct, frozen=True):
    """Horizontal error squared and normalised by the covariance given with it (NEES).

    Of covariances that tell the truth the mean is 2, the median 1.39.
    """

    mean: float
    median: float


class RadiiIntervals(msgspec.Struct, frozen=True):
    """95 % intervals of CE50 and CE95, by drawing runs again."""

    ce50_m: Interval
    ce95_m: Interval


class Intervals(msgspec.Struct, frozen=True, kw_only=True):
    """95 % intervals of the figures beside them, by drawing runs again."""

    absolute: RadiiIntervals | None = msgspec.field(name="abs")
    team: RadiiIntervals | None
    pair: RadiiIntervals | None
    dap: RadiiIntervals | None
    fail_pct: Interval | None
    coverage95_pct: Interval | None


class PooledMethod(msgspec.Struct, frozen=True, kw_only=True):
    """One way of tracking over all runs; ``None`` where there is nothing to score.

    ``fail_pct`` is the share of tracks that failed, ``coverage95_pct`` that of seconds with the
    truth inside the region given for 95 %, ``wrong_floor_pct`` that of seconds on a floor for
    which another was told. ``eag_m_s`` is the median track's error accumulation gradient: the
    slope of its error over time, from none at its beginning (after ISO/IEC 18305). ``ipin_m`` is
    the third quartile of errors with 15 m added for each floor (IPIN competition).
    """

    absolute: Radii | None = msgspec.field(name="abs")
    team: Radii | None
    pair: Radii | None
    pair_unturned: Radii | None
    dap: Radii | None
    fail_pct: float | None
    coverage95_pct: float | None
    wrong_floor_pct: float | None
    vertical: Vertical | None
    nees: Consistency | None
    eag_m_s: float | None
    ipin_m: float | None
    intervals: Intervals


class Latency(msgspec.Struct, frozen=True):
    """Time from a message's arrival to the estimates that come of it, holding back apart."""

    p50: float
    p99: float


class Told(msgspec.Struct, frozen=True):
    """In how many runs something was told of a node, and when first (s), in the median of these."""

    runs: int
    first_s: float


class ScenarioScore(msgspec.Struct, frozen=True, kw_only=True):
    """All runs of one scenario, their errors thrown together.

    ``daps_a_run`` is how many DAPs somebody set down, on average. ``told`` is what was told of
    nodes, by their id and what it was: what the fusion doubts of them, clocks, what was refused.
    ``after`` is ``None`` where the way of fusing has no such. ``latency_ms`` is measured on the
    machine that ran it, and the one thing here that no seed repeats.
    """

    runs: int
    live: PooledMethod
    after: PooledMethod | None
    pdr: PooledMethod
    latency_ms: Latency | None = None
    daps_a_run: float = 0.0
    told: dict[str, dict[str, Told]] = {}


class PooledScore(msgspec.Struct, frozen=True, kw_only=True):
    """The score card of a Monte Carlo, by scenario."""

    scenarios: dict[str, ScenarioScore]


def pool(runs: Mapping[str, Sequence[RunErrors]]) -> PooledScore:
    """Return the score card of many runs, given by the name of their scenario."""
    return PooledScore(scenarios={name: _scenario_score(each) for name, each in runs.items()})


def latency(handled_ms: Floats) -> Latency | None:
    """Return what ``handled_ms`` (n,), the time that each message took, comes to."""
    if not handled_ms.size:
        return None
    p50, p99 = np.percentile(handled_ms, (50.0, 99.0))
    return Latency(float(p50), float(p99))


def told_of(runs: Sequence[Mapping[tuple[str, str], float]]) -> dict[str, dict[str, Told]]:
    """Return what was told of each node, from when (s) each run first told what of whom."""
    first_s: dict[tuple[str, str], list[float]] = {}
    for run in runs:
        for (what, node_id), time_s in run.items():
            first_s.setdefault((node_id, what), []).append(time_s)
    told: dict[str, dict[str, Told]] = {}
    for (node_id, what), times_s in sorted(first_s.items()):
        told.setdefault(node_id, {})[what] = Told(len(times_s), float(np.median(times_s)))
    return told


def _scenario_score(runs: Sequence[RunErrors]) -> ScenarioScore:
    redrawn = Redrawn(len(runs)) if runs else None
    smoothed = [run.after for run in runs if run.after is not None]
    return ScenarioScore(
        runs=len(runs),
        live=_pooled([run.live for run in runs], redrawn),
        after=_pooled(smoothed, redrawn) if runs and len(smoothed) == len(runs) else None,
        pdr=_pooled([run.pdr for run in runs], redrawn),
        daps_a_run=float(np.mean([len(run.live.dap_m) for run in runs])) if runs else 0.0,
    )


def _pooled(runs: Sequence[MethodErrors], redrawn: Redrawn | None) -> PooledMethod:
    tracks = [track for run in runs for track in run.responders.values()]
    height = _percentiles([track.vertical_m for track in tracks], (50.0, 95.0))
    squared = _together([track.squared_error for track in tracks])
    gradients = [_gradient_m_s(track) for track in tracks]
    ipin = _percentiles([_with_floors_m(track) for track in tracks], (75.0,))
    return PooledMethod(
        absolute=radii(track.absolute_m for track in tracks),
        team=radii(track.team_m for track in tracks),
        pair=radii(run.pair_m for run in runs),
        pair_unturned=radii(run.pair_unturned_m for run in runs),
        dap=radii(list(run.dap_m.values()) for run in runs),
        fail_pct=100.0 * float(np.mean([_failed(track) for track in tracks])) if tracks else None,
        coverage95_pct=coverage_pct(tracks),
        wrong_floor_pct=_wrong_floor_pct(tracks),
        vertical=Vertical(*height) if height else None,
        nees=_consistency(squared),
        eag_m_s=float(np.median(gradients)) if gradients else None,
        ipin_m=ipin[0] if ipin else None,
        intervals=_intervals(runs, redrawn),
    )


def _consistency(squared: Floats) -> Consistency | None:
    if not squared.size:
        return None
    return Consistency(float(squared.mean()), float(np.median(squared)))


def _failed(track: TrackErrors) -> bool:
    return float(np.percentile(track.absolute_m, 95.0)) > FAILED_M


def _gradient_m_s(track: TrackErrors) -> float:
    """Return the slope of the line from nought that fits the error over time best."""
    moment = float(np.dot(track.time_s, track.time_s))
    return float(np.dot(track.time_s, track.absolute_m)) / moment if moment else 0.0


def _with_floors_m(track: TrackErrors) -> Floats:
    if track.floors_off is None:
        return track.absolute_m
    return np.asarray(track.absolute_m + WRONG_FLOOR_M * np.maximum(track.floors_off, 0))


def _wrong_floor_pct(tracks: Iterable[TrackErrors]) -> float | None:
    off = _together([track.floors_off for track in tracks])
    on_floor = off[off >= 0]
    return 100.0 * float(np.mean(on_floor > 0)) if on_floor.size else None


def _together(parts: Iterable[NDArray[Any] | None]) -> NDArray[Any]:
    return np.concatenate([np.empty(0), *(part for part in parts if part is not None)])


def _percentiles(errors_m: Sequence[Floats], percent: Sequence[float]) -> list[float]:
    """Return percentiles of errors thrown together; none if there are no errors."""
    together = _together(errors_m)
    return [float(each) for each in np.percentile(together, percent)] if together.size else []


def _intervals(runs: Sequence[MethodErrors], redrawn: Redrawn | None) -> Intervals:
    def radii_of(errors_of: Callable[[MethodErrors], Iterable[Floats]]) -> RadiiIntervals | None:
        errors_m = [_together(errors_of(run)) for run in runs]
        if redrawn is None or not any(each.size for each in errors_m):
            return None
        return RadiiIntervals(*redrawn.percentiles(errors_m, (50.0, 95.0)))

    tracks = [list(run.responders.values()) for run in runs]
    failed = [sum(_failed(track) for track in each) for each in tracks]
    inside = [_together([track.inside for track in each]) for each in tracks]
    return Intervals(
        absolute=radii_of(lambda run: (track.absolute_m for track in run.responders.values())),
        team=radii_of(lambda run: (track.team_m for track in run.responders.values())),
        pair=radii_of(lambda run: [run.pair_m]),
        dap=radii_of(lambda run: [np.array(list(run.dap_m.values()))]),
        fail_pct=redrawn.share_pct(failed, [len(each) for each in tracks])
        if redrawn is not None and any(tracks)
        else None,
        coverage95_pct=redrawn.share_pct(
            [float(each.sum()) for each in inside], [each.size for each in inside]
        )
        if redrawn is not None and any(each.size for each in inside)
        else None,
    )
