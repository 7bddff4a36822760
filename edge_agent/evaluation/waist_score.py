"""How good a waist's way is: each step against a landing of a foot, the way against a tape."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from edge_agent.evaluation.chest_score import score_chest
from edge_agent.evaluation.course_truth import MountTruth, StepCount, Waypoints
from edge_agent.evaluation.errors import closure
from edge_agent.evaluation.estimate import EstimatedPath, estimated_path
from edge_agent.evaluation.score_card import TrialScore, failed_trial
from edge_agent.evaluation.step_places import paired, steps_off
from edge_agent.mounts.interface import Increment
from shared.units import NS_PER_S

HEADED_AFTER_M = 10.0
"""So far from the start the way tells how the agent's frame lies."""


def score_waist(
    name: str, group: str, increments: Sequence[Increment], truth: MountTruth | None
) -> TrialScore:
    """Return the score of steps against counted landings, or of the way against ``Waypoints``.

    Every step told counts, before the first landing and after the last as well. A counted course
    of known length leads out and back, so that the way is scored by its closure, too, and steps too
    many or too few by where they were. Steps told, and steps counted, are compared with those that
    sensors on the feet tell.
    """
    if not increments:
        return failed_trial(name, group, truth, "no steps found")
    if isinstance(truth, StepCount):
        return _with_landings(name, group, increments, truth)
    row = score_chest(name, group, increments, truth)
    if not isinstance(truth, Waypoints) or row.failure is not None:
        return row
    worst = worst_m(estimated_path(increments), truth)
    return msgspec.structs.replace(row, worst_m=worst if math.isfinite(worst) else None)


def _with_landings(
    name: str, group: str, increments: Sequence[Increment], truth: StepCount
) -> TrialScore:
    found = sum(one.steps for one in increments)
    ended_s = np.array([one.end_time_ns for one in increments if one.steps]) / NS_PER_S
    matched = int(paired(ended_s, truth.time_s[1:]).steps.sum())
    row = TrialScore(
        name=name,
        set=group,
        n_strides=len(increments),
        steps_true=truth.steps,
        steps_found=found,
        steps_off=float(found - truth.steps),
        steps_exact_pct=_same_pct(found, truth.steps),
        steps_error_pct=100.0 * (found / truth.steps - 1.0) if truth.steps else None,
        missed_stances_pct=100.0 * (1.0 - matched / truth.steps) if truth.steps else None,
        false_stances_pct=100.0 * (1.0 - matched / found) if found else None,
        steps_by_feet=truth.by_feet,
        contradictions=truth.contradictions,
        steps_as_feet_pct=_same_pct(found, truth.by_feet),
        marks_as_feet_pct=_same_pct(truth.steps, truth.by_feet),
    )
    if truth.distance_m is None:
        return row
    off = steps_off(increments, truth.time_s[1:])
    places = {} if off is None else {f"off_{place}": n for place, n in off._asdict().items()}
    told_m = sum(math.hypot(*one.displacement_m[:2]) for one in increments)
    return msgspec.structs.replace(
        row,
        length_m=truth.distance_m,
        distance_error_pct=100.0 * (told_m / truth.distance_m - 1.0),
        closure_2d_m=closure(estimated_path(increments)).closure_2d_m,
        **places,
    )


def _same_pct(told: int, true: int | None) -> float | None:
    """Return 100 or 0, so that the mean over trials is the share of those told exactly."""
    return None if true is None else 100.0 * (told == true)


def worst_m(path: EstimatedPath, truth: Waypoints) -> float:
    """Return how far the way ever is from the true places, laid on them at its beginning.

    It begins at the first place, and is turned to lead as the truth does over the first
    ``HEADED_AFTER_M``, which dead reckoning cannot know. NaN if it never comes so far.
    """
    told_m = path.at(truth.time_s)[:, :2]
    told_m, true_m = told_m - told_m[0], truth.position_m - truth.position_m[0]
    far = np.flatnonzero(np.linalg.norm(true_m, axis=1) >= HEADED_AFTER_M)
    if not far.size:
        return math.nan
    begun = slice(0, int(far[0]) + 1)
    told, true = told_m @ np.array([1.0, 1.0j]), true_m @ np.array([1.0, 1.0j])
    turn = complex(np.vdot(told[begun], true[begun]))
    if turn == 0.0:
        return math.nan
    return float(np.abs(told * turn / abs(turn) - true).max())
