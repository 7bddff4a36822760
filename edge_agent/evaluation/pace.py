"""A wearer's own scale: how long their steps are, in those that the method tells of anybody."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from edge_agent.evaluation.course_truth import Waypoints
from edge_agent.evaluation.estimate import estimated_path
from edge_agent.mounts.interface import Increment


def scale_over(increments: Sequence[Increment], truth: Waypoints, over_m: float) -> float:
    """Return the scale that the way tells until it is first ``over_m`` from where it began.

    Both ways are taken straight. It is 1 where nobody came so far, or nothing was told of it.
    """
    away_m = np.linalg.norm(truth.position_m - truth.position_m[0], axis=1)
    far = np.flatnonzero(away_m >= over_m)
    if not far.size or not increments:
        return 1.0
    told_m = estimated_path(increments).at(truth.time_s[[0, far[0]]])
    length_m = float(np.linalg.norm(told_m[1, :2] - told_m[0, :2]))
    return float(away_m[far[0]]) / length_m if length_m else 1.0
