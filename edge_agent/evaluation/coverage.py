"""Whether strides are as sure as they say: the share inside their own 95 % ellipse."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from edge_agent.evaluation.errors import align
from edge_agent.evaluation.estimate import EstimatedPath
from edge_agent.evaluation.truth import Array, Truth
from edge_agent.mounts.interface import Increment
from shared.units import NS_PER_S

ELLIPSE_95 = -2.0 * math.log(0.05)
"""Squared Mahalanobis distance that 95 % of errors in the plane stay within: χ² of two."""


def coverage95_pct(increments: Sequence[Increment], path: EstimatedPath, truth: Truth) -> float:
    """Return the share of true strides whose error lies inside the 95 % ellipse published for it.

    A stride goes from one true stance instant to the next. Its error is the displacement of
    ``path`` between them, turned by the rotation of the one rigid alignment of the whole path,
    minus the true displacement, in the plane. Its covariance is the sum of the north-east blocks of
    the increments between the two instants, turned alike; an increment that reaches beyond one of
    them (a stance missed) counts by the share of its time between them, as if its error grew
    evenly. Errors of successive increments are taken as independent, as they are published: what
    heading has drifted since the alignment's mean is in the error, not in the ellipse. A stride
    for which no covariance was published is outside.
    """
    rotation, _ = align(path.at(truth.time_s)[:, :2], truth.position_m)
    step_m = np.diff(path.at(truth.time_s)[:, :2], axis=0)
    # Turning the truth back is turning error and ellipse alike.
    north_m, east_m = (step_m - np.diff(truth.position_m, axis=0) @ rotation).T
    nn, ne, ee = np.diff(_summed_covariance_m2(increments, truth.time_s), axis=0).T
    # e'·adj(C)·e < χ²·det(C) says e'·C⁻¹·e < χ², and is false for a covariance of zero.
    squared = ee * north_m**2 - 2.0 * ne * north_m * east_m + nn * east_m**2
    return float(100.0 * np.mean(squared < ELLIPSE_95 * (nn * ee - ne**2)))


def _summed_covariance_m2(increments: Sequence[Increment], time_s: Array) -> Array:
    """Return what had been published up to each of ``time_s`` (k,): nn, ne and ee (k, 3), m²."""
    ends_s = np.array([(i.start_time_ns, i.end_time_ns) for i in increments]) / NS_PER_S
    blocks_m2 = np.array([(i.covariance[0], i.covariance[1], i.covariance[4]) for i in increments])
    summed_m2 = np.zeros((len(increments), 2, 3))
    summed_m2[:, 1] = np.cumsum(blocks_m2, axis=0)
    summed_m2[1:, 0] = summed_m2[:-1, 1]
    knots_m2 = summed_m2.reshape(-1, 3)
    return np.column_stack(
        [np.interp(time_s, ends_s.ravel(), knots_m2[:, entry]) for entry in range(3)]
    )
