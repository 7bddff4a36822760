"""Increments, ties and mixtures as the rows that the kernels read.

All of it in double precision with nothing but IEEE 754's own operations, for the same bits
everywhere; rounded once to single precision at the end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from command_post.fusion.cloud.layout import (
    COMPONENT_MEAN,
    COMPONENT_ROOT,
    COMPONENT_TURNED,
    COMPONENT_WEIGHT,
    COMPONENT_WIDTH,
    Lanes,
)
from command_post.fusion.cloud.model import ANY_HEADING_SD_RAD, CloudModel, Mixture, Tie
from command_post.fusion.cloud.noise import CHANCES
from shared.messages import OdometryIncrement
from shared.units import NS_PER_S

MOST_TOLD_SD_M = 10.0
MOST_TOLD_SD_RAD = math.pi
MOST_LOST = 100
LONGEST_S = 60.0
LEAST_SD_M = 1e-3
STATE = 5

Rows = Sequence[Sequence[float]]


def step_row(
    increment: OdometryIncrement | None, lost: int, count: int, model: CloudModel
) -> tuple[float, ...]:
    """Return the STEP_WIDTH numbers of an increment for a cloud of ``count``; ``None``: no move.

    ``lost`` increments went missing before it.
    """
    resampling = (model.resample_below * count, model.kept_spread)
    if increment is None:
        return (0.0, 0.0, -1.0, *(0.0,) * 10, *resampling)
    elapsed_s = (increment.event_time_ns - increment.start_time_ns) / NS_PER_S
    elapsed_s = min(max(elapsed_s, 0.0), LONGEST_S)
    root = lower_root(_noise(increment, min(lost, MOST_LOST), model))
    return (
        increment.d_north_m, increment.d_east_m, elapsed_s,
        root[0][0], root[1][0], root[1][1], *root[2],
        math.sqrt(root[2][2] ** 2 + model.jump_sd_rad**2),
        math.floor(model.jump_share * CHANCES), math.floor((1.0 - model.missed_share) * CHANCES),
        model.drift_walk_rad_s * math.sqrt(elapsed_s), *resampling,
    )  # fmt: skip


def _noise(increment: OdometryIncrement, lost: int, model: CloudModel) -> Rows:
    """Return the covariance (3×3) of an increment in north, east and heading."""
    nn, ne, _, nh, ee, _, eh, _, _, hh = increment.covariance
    d_north, d_east = increment.d_north_m, increment.d_east_m
    length_m = math.sqrt(d_north * d_north + d_east * d_east)
    position_sd_m = model.position_sd_m + model.position_sd_per_m * length_m
    position_m2 = position_sd_m**2 + (model.lost_sd_m * lost) ** 2
    heading_rad2 = model.heading_sd_rad**2 * (1 + lost)
    return (
        (min(nn, MOST_TOLD_SD_M**2) + position_m2, ne, nh),
        (ne, min(ee, MOST_TOLD_SD_M**2) + position_m2, eh),
        (nh, eh, min(hh, MOST_TOLD_SD_RAD**2) + heading_rad2),
    )


def tie_row(tie: Tie, origin_m: tuple[float, float]) -> tuple[float, ...]:
    """Return the TIE_WIDTH numbers of a tie, for a cloud with this origin.

    ``ValueError`` if its degrees of freedom are not positive.
    """
    if not tie.dof > 0.0:
        raise ValueError(f"a tie's degrees of freedom must be above 0, not {tie.dof}")
    nn, ne, ee = tie.covariance_m2
    own_m2 = max(tie.sd_m, LEAST_SD_M) ** 2
    (north, _), (across, east) = lower_root(((nn, ne), (ne, ee)))
    nn, ne, ee = north**2 + own_m2, north * across, across**2 + east**2 + own_m2
    determinant = nn * ee - ne * ne
    per_dof = 1.0 / (determinant * tie.dof)
    return (
        tie.north_m - origin_m[0], tie.east_m - origin_m[1], *tie.since_m,
        ee * per_dof, -2.0 * ne * per_dof, nn * per_dof, -0.5 * (tie.dof + 2.0),
        2.0 * math.pi * math.sqrt(determinant),
    )  # fmt: skip


def component_rows(mixture: Mixture, origin_m: tuple[float, float]) -> Lanes:
    """Return a mixture as (k, COMPONENT_WIDTH), for a cloud with this origin.

    ``ValueError`` if its parts do not fit together, or no weight is positive.
    """
    weights, means, covariances = (np.asarray(part, np.float64) for part in mixture)
    many, wide = means.shape if means.ndim == 2 else (0, 0)
    fits = weights.shape == (many,) and covariances.shape == (many, wide, wide)
    if not (many > 0 and wide in {4, STATE} and fits):
        shapes = f"{weights.shape}, {means.shape}, {covariances.shape}"
        raise ValueError(f"a mixture is k weights, (k, 4 or 5) means, covariances; not {shapes}")
    if not (np.all(weights >= 0.0) and np.all(np.isfinite(means)) and weights.sum() > 0.0):
        raise ValueError(
            "a mixture's weights must not be negative nor all nought, its means finite"
        )
    rows = np.zeros((many, COMPONENT_WIDTH))
    rows[:, COMPONENT_WEIGHT] = np.add.accumulate(weights) / np.add.accumulate(weights)[-1]
    rows[:, COMPONENT_MEAN : COMPONENT_MEAN + wide] = means
    rows[:, COMPONENT_MEAN : COMPONENT_MEAN + 2] -= origin_m
    for row, covariance in zip(rows, covariances, strict=True):
        full = np.zeros((STATE, STATE))
        full[:wide, :wide] = covariance
        if full[2, 2] >= ANY_HEADING_SD_RAD**2:
            full[2, :] = full[:, 2] = 0.0
            row[COMPONENT_TURNED] = 1.0
        told = [
            entry for j, line in enumerate(lower_root(full.tolist())) for entry in line[: j + 1]
        ]
        row[COMPONENT_ROOT : COMPONENT_ROOT + len(told)] = told
    return rows.astype(np.float32)


def lower_root(matrix: Rows) -> list[list[float]]:
    """Return the lower Cholesky root of a covariance, or of one near it that can be.

    What two have in common is bound to what either has, so that no told matrix can fail.
    """
    root: list[list[float]] = []
    for j, told in enumerate(matrix):
        line = [0.0] * len(matrix)
        left = max(float(told[j]), 0.0)
        for k in range(j):
            common = float(told[k])
            for before in range(k):
                common -= line[before] * root[k][before]
            most = math.sqrt(left)
            line[k] = min(max(common / root[k][k], -most), most) if root[k][k] > 0.0 else 0.0
            left = max(left - line[k] * line[k], 0.0)
        line[j] = math.sqrt(left)
        root.append(line)
    return root
