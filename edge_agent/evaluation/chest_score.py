"""How good a chest's, or a hand's, way is: steps against a count, the path against way-points."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from edge_agent.evaluation.course_truth import MountTruth, StepCount, Waypoints
from edge_agent.evaluation.errors import absolute_error_m, closure, path_length_m
from edge_agent.evaluation.estimate import EstimatedPath, estimated_path
from edge_agent.evaluation.score_card import TrialScore, failed_trial
from edge_agent.mounts.interface import Increment
from shared.units import NS_PER_S

FEWEST_WAYPOINTS = 3
SAME_PLACE_M = 0.5
"""A way that ends nearer than this to where it began is closed."""


def score_chest(
    name: str, group: str, increments: Sequence[Increment], truth: MountTruth | None
) -> TrialScore:
    """Return the score of steps against a ``StepCount``, of the path against ``Waypoints``.

    Without truth, the path is taken to end where it began. Errors at way-points are after one
    rigid alignment in the plane, without scale, as a boot's are at its stances.
    """
    if not increments:
        return failed_trial(name, group, truth, "no steps found")
    row = TrialScore(name=name, set=group, n_strides=len(increments))
    path = estimated_path(increments)
    match truth:
        case None:
            return msgspec.structs.replace(row, **closure(path)._asdict())
        case StepCount():
            return with_steps(row, increments, truth)
        case Waypoints():
            row = with_waypoints(row, path, truth)
            return row if truth.steps is None else with_steps(row, increments, truth.steps)
        case _:
            failure = "its truth is neither steps nor way-points: not a recording of a walker"
            return failed_trial(name, group, truth, failure)


def with_steps(row: TrialScore, increments: Sequence[Increment], truth: StepCount) -> TrialScore:
    """Return ``row`` with the steps told that end while they were counted."""
    first_ns, last_ns = truth.time_s[0] * NS_PER_S, truth.time_s[-1] * NS_PER_S
    found = sum(one.steps for one in increments if first_ns <= one.end_time_ns <= last_ns)
    counted = truth.steps
    return msgspec.structs.replace(
        row,
        steps_found=found,
        steps_true=counted,
        steps_error_pct=100.0 * (found / counted - 1.0) if counted else None,
    )


def with_waypoints(row: TrialScore, path: EstimatedPath, truth: Waypoints) -> TrialScore:
    """Return ``row`` with the errors of ``path`` at the way-points.

    The distance is that from point to point, straight, in the estimate as in the truth.
    """
    length_m = truth.length_m
    if len(truth.time_s) < FEWEST_WAYPOINTS or length_m == 0.0:
        failure = f"{len(truth.time_s)} way-points: {FEWEST_WAYPOINTS} apart are needed for a score"
        return msgspec.structs.replace(row, failure=failure)
    position_m = path.at(truth.time_s)[:, :2]
    told_m = path_length_m(position_m)
    closes = float(np.linalg.norm(truth.position_m[-1] - truth.position_m[0])) < SAME_PLACE_M
    return msgspec.structs.replace(
        row,
        length_m=length_m,
        mean_speed_m_s=length_m / float(truth.time_s[-1] - truth.time_s[0]),
        distance_error_pct=100.0 * (told_m / length_m - 1.0),
        ate_pct=100.0 * absolute_error_m(position_m, truth.position_m) / length_m,
        closure_2d_m=float(np.linalg.norm(position_m[-1] - position_m[0])) if closes else None,
    )
