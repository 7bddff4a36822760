"""The score card: one row a trial, and what the trials of a set come to."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import msgspec

from edge_agent.evaluation.course_truth import MountTruth
from edge_agent.evaluation.coverage import coverage95_pct, whole_path_coverage95_pct
from edge_agent.evaluation.errors import closure, stance_errors
from edge_agent.evaluation.estimate import EstimatedPath, estimated_path
from edge_agent.evaluation.truth import Truth
from edge_agent.evaluation.vertical import vertical_errors
from edge_agent.mounts.interface import Increment
from shared.maths.statistics import Summary, summarise

METRICS = (
    "distance_error_pct", "distance_3d_error_pct", "taped_error_pct", "stride_rmse_m", "ate_pct",
    "end_error_pct", "heading_drift_deg_min", "missed_stances_pct", "false_stances_pct",
    "coverage95_pct", "coverage95_whole_path_pct", "vertical_rmse_m", "vertical_end_error_m",
    "vertical_increment_rmse_m", "vertical_coverage95_pct", "floor_rmse_m",
    "closure_2d_m", "closure_3d_m", "worst_m", "steps_error_pct", "steps_off", "steps_exact_pct",
    "off_setting_out", "off_way", "off_turn", "off_arriving", "off_arrived",
    "steps_as_feet_pct", "marks_as_feet_pct",
    "speed_rmse_m_s", "speed_live_rmse_m_s", "realignment_s", "acceleration_rmse_m_s2",
    "acceleration_correlation",
    "samples_per_s",
)  # fmt: skip
"""The fields of ``TrialScore`` that a set sums up."""

IN_PLACE = "in_place"
IN_PLACE_LENGTH_M = 6.0

_SPEED_CLASSES = {
    "foot_strides": ((1.3, "walk"), (1.9, "fast"), (math.inf, "run")),
    "foot_vicon": ((0.5, "slow"), (1.5, "walk"), (math.inf, "run")),
}
"""By group: mean speeds (m/s) below which a trial is of the class."""


class TrialScore(msgspec.Struct, frozen=True, kw_only=True):
    """One recording. What cannot be told of it is ``None``.

    Errors keep their sign: ``distance_error_pct`` (in the plane; ``distance_3d_error_pct`` counts
    climbing as well, where the truth has height) is negative for a path that came out short,
    ``taped_error_pct`` compares all strides told, climbing included, with the length of the course
    as laid out with a tape: the paper's own figure. ``heading_drift_deg_min`` is positive for a
    path that turns right, ``vertical_end_error_m`` for one that ends too low. ``coverage95_pct``
    is no error: 95 is what it should be; ``coverage95_whole_path_pct`` would be lower on any walk
    along which heading drifts, and ``vertical_coverage95_pct`` is that of height.
    ``steps_true`` were counted, ``steps_found`` told, ``steps_off`` more than counted;
    ``steps_exact_pct`` is 100 or 0, so that its mean is the share of trials told exactly.
    ``off_setting_out`` and so on say where they are off (``evaluation/step_places.py``).
    ``steps_by_feet`` are what sensors on the feet tell; ``steps_as_feet_pct`` says whether as many
    were told, ``marks_as_feet_pct`` whether as many were counted, by marks that contradict
    themselves ``contradictions`` times.
    ``worst_m`` is how far the way ever was from the truth, laid on it where it began.
    Of a vehicle's speed, re-alignment and acceleration see ``evaluation/vehicle_score.py``.
    ``samples_per_s`` is what the mount alone took in per second of one processor's time.
    ``failure`` says why there is no score; the trial still counts.
    """

    name: str
    set: str
    n_strides: int | None = None
    length_m: float | None = None
    mean_speed_m_s: float | None = None
    distance_error_pct: float | None = None
    distance_3d_error_pct: float | None = None
    taped_error_pct: float | None = None
    stride_rmse_m: float | None = None
    ate_pct: float | None = None
    end_error_pct: float | None = None
    heading_drift_deg_min: float | None = None
    missed_stances_pct: float | None = None
    false_stances_pct: float | None = None
    coverage95_pct: float | None = None
    coverage95_whole_path_pct: float | None = None
    vertical_rmse_m: float | None = None
    vertical_end_error_m: float | None = None
    vertical_increment_rmse_m: float | None = None
    vertical_coverage95_pct: float | None = None
    floor_rmse_m: float | None = None
    closure_2d_m: float | None = None
    closure_3d_m: float | None = None
    samples_per_s: float | None = None
    steps_true: int | None = None
    steps_found: int | None = None
    steps_error_pct: float | None = None
    steps_off: float | None = None
    steps_exact_pct: float | None = None
    off_setting_out: int | None = None
    off_way: int | None = None
    off_turn: int | None = None
    off_arriving: int | None = None
    off_arrived: int | None = None
    steps_by_feet: int | None = None
    contradictions: int | None = None
    steps_as_feet_pct: float | None = None
    marks_as_feet_pct: float | None = None
    worst_m: float | None = None
    slips: int | None = None
    speed_rmse_m_s: float | None = None
    speed_live_rmse_m_s: float | None = None
    realignment_s: float | None = None
    acceleration_rmse_m_s2: float | None = None
    acceleration_correlation: float | None = None
    failure: str | None = None


class ScoreCard(msgspec.Struct, frozen=True):
    """All trials, and by set: ``n``, ``failed``, and each metric's summary.

    Summaries are of magnitudes (a path 3 % short is as wrong as one 3 % long), over the trials of
    the set that have the metric.
    """

    trials: list[TrialScore]
    sets: dict[str, dict[str, int | Summary]]


def set_of(group: str, truth: MountTruth | None) -> str:
    """Return the set a trial belongs to: its group, and how fast or on the spot it is."""
    classes = _SPEED_CLASSES.get(group)
    if not isinstance(truth, Truth) or classes is None:
        return group
    if group == "foot_vicon" and truth.length_m < IN_PLACE_LENGTH_M:
        return f"{group}/{IN_PLACE}"
    return f"{group}/{next(name for limit, name in classes if truth.mean_speed_m_s < limit)}"


def score_trial(
    name: str, group: str, increments: Sequence[Increment], truth: MountTruth | None
) -> TrialScore:
    """Return the score of a boot's ``increments`` (in order); closure without truth."""
    if truth is not None and not isinstance(truth, Truth):
        return failed_trial(name, group, truth, "its truth has no stances: not a boot's recording")
    if not increments:
        return failed_trial(name, group, truth, "no strides found")
    path = estimated_path(increments)
    if truth is None:
        return TrialScore(
            name=name, set=group, n_strides=len(increments), **closure(path)._asdict()
        )
    try:
        errors = _errors(set_of(group, truth), increments, path, truth)
    except ValueError as error:
        return failed_trial(name, group, truth, str(error))
    if truth.taped_m is not None:
        told_m = sum(math.hypot(*increment.displacement_m) for increment in increments)
        errors["taped_error_pct"] = 100.0 * (told_m / truth.taped_m - 1.0)
    return msgspec.structs.replace(_row(name, group, truth), **errors)


def _errors(
    set_name: str, increments: Sequence[Increment], path: EstimatedPath, truth: Truth
) -> dict[str, float | None]:
    vertical = vertical_errors(increments, path, truth)
    errors = {} if vertical is None else vertical._asdict()
    if set_name.endswith(f"/{IN_PLACE}"):
        errors.pop("distance_3d_error_pct", None)
    else:
        errors |= stance_errors(path, truth)._asdict()
        errors["coverage95_pct"] = coverage95_pct(increments, path, truth)
        errors["coverage95_whole_path_pct"] = whole_path_coverage95_pct(increments, path, truth)
    return {metric: value if math.isfinite(value) else None for metric, value in errors.items()}


def failed_trial(name: str, group: str, truth: MountTruth | None, failure: str) -> TrialScore:
    """Return the row of a trial without a score, and why."""
    return msgspec.structs.replace(_row(name, group, truth), failure=failure)


def _row(name: str, group: str, truth: MountTruth | None) -> TrialScore:
    if not isinstance(truth, Truth):
        return TrialScore(name=name, set=group)
    return TrialScore(
        name=name,
        set=set_of(group, truth),
        n_strides=max(0, len(truth.time_s) - 1),
        length_m=truth.length_m,
        mean_speed_m_s=truth.mean_speed_m_s,
    )


def score_card(trials: Iterable[TrialScore]) -> ScoreCard:
    """Sum up ``trials`` by set, in the order of the sets' names."""
    rows = list(trials)
    sets: dict[str, dict[str, int | Summary]] = {}
    for name in sorted({row.set for row in rows}):
        members = [row for row in rows if row.set == name]
        sets[name] = {
            "n": len(members),
            "failed": sum(row.failure is not None for row in members),
        }
        for metric in METRICS:
            values = [getattr(row, metric) for row in members]
            told = [abs(value) for value in values if value is not None]
            if told:
                sets[name][metric] = summarise(told)
    return ScoreCard(rows, sets)
