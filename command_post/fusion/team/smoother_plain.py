"""What ``smoother.py`` means, said plainly: residuals, their derivatives, and a dense solution.

Slow, and short enough to be checked by eye; the tests hold the kernel to it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.graph import (
    AXIS,
    FIRST_UNIT,
    LARGEST_TURN_RAD,
    LEAD,
    LOOSE_SCALE_SD,
    MOST_SCALE_SD,
    PLACE_DOF,
    SCALE_DOF,
    TURN_DOF,
    Graph,
    with_tails,
)

Floats: TypeAlias = NDArray[np.float64]


class Factor(NamedTuple):
    """One residual (d,) in units of its standard deviation, its derivatives (d, all states).

    ``longer`` is one more than the scale error, state ``scale``, with which the standard deviation
    grows; what that state says of the others by it is left out.
    """

    residual: Floats
    derivative: Floats
    dof: float
    scale: int = 0
    longer: float = math.inf


class Smoothed(NamedTuple):
    """Poses (n, 3), arrow (A,), the last step's cost and normal matrix, all states' covariance."""

    pose: Floats
    arrow: Floats
    cost: float
    normal: Floats
    covariance: Floats


def smooth_plainly(graph: Graph, pose: Floats, arrow: Floats, iterations: int) -> Smoothed:
    """Return the states after so many steps of reweighted Gauss-Newton."""
    cost, normal, covariance = 0.0, np.eye(1), np.eye(1)
    for _ in range(iterations):
        covariance = np.asarray(np.linalg.inv(_normal(with_tails(graph), pose, arrow)[1]))
        cost, normal, right = _normal(graph, pose, arrow)
        change = np.linalg.solve(normal, right)
        turned = float(np.abs(change[2 : pose.size : 3]).max())
        change *= min(1.0, LARGEST_TURN_RAD / turned) if turned else 1.0
        pose = pose + change[: pose.size].reshape(-1, 3)
        arrow = arrow + change[pose.size :]
    return Smoothed(pose, arrow, cost, normal, covariance)


def _normal(graph: Graph, pose: Floats, arrow: Floats) -> tuple[float, Floats, Floats]:
    """Return the cost of a state, and the normal equations about it."""
    normal = np.zeros((pose.size + arrow.size,) * 2)
    right = np.zeros(pose.size + arrow.size)
    cost = 0.0
    for residual, derivative, dof, scale, longer in _factors(graph, pose, arrow):
        squared = float(residual @ residual)
        weight = (dof + residual.size) / (dof + squared) if dof else 1.0
        cost += (dof + residual.size) * math.log1p(squared / dof) if dof else squared
        normal += weight * derivative.T @ derivative
        right -= weight * derivative.T @ residual
        normal[scale, scale] += weight * squared / longer**2
        right[scale] += weight * squared / longer
    return cost, normal, right


def _factors(graph: Graph, pose: Floats, arrow: Floats) -> Iterator[Factor]:
    states = pose.size + arrow.size
    yield from _moves(graph, pose, arrow)
    for (a, column, _, scale), (*at_m, sd_m, dof, fast_n, fast_e) in zip(
        graph.tie_at, graph.tie, strict=True
    ):
        derivative = np.zeros((2, states))
        fast_m_s = np.array([fast_n, fast_e])
        offset = _point(derivative, pose, a, *(at_m + arrow[LEAD] * fast_m_s))
        derivative[:, pose.size + LEAD] = _turned(pose[a, 2], *fast_m_s)
        derivative[[0, 1], [pose.size + column, pose.size + column + 1]] = -1.0
        residual = pose[a, :2] + offset - arrow[column : column + 2]
        yield _measured(graph, arrow, scale, Factor(residual / sd_m, derivative / sd_m, dof))
    for a, (north, east, *place, sd_m, dof) in zip(graph.fix_at, graph.fix, strict=True):
        derivative = np.zeros((2, states))
        offset = _point(derivative, pose, a, north, east)
        yield Factor((pose[a, :2] + offset - place) / sd_m, derivative / sd_m, dof)
    for a, (turn_rad, sd_rad) in zip(graph.turn_at, graph.turn, strict=True):
        derivative = np.zeros((1, states))
        derivative[0, 3 * a + 2] = 1.0
        off_rad = math.remainder(pose[a, 2] - turn_rad, math.tau)
        yield Factor(np.array([off_rad]) / sd_rad, derivative / sd_rad, 0.0)
    for at, (direction_rad, sd_rad) in zip(graph.straight_at, graph.straight, strict=True):
        a = graph.move_at[at, 0]
        derivative = np.zeros((1, states))
        derivative[0, [3 * a + 2, 3 * a + 5]] = 0.5
        derivative[0, pose.size + AXIS] = -1.0
        along_rad = 0.5 * (pose[a, 2] + pose[a + 1, 2]) + direction_rad
        off_rad = math.remainder(along_rad - arrow[AXIS], math.pi / 2)
        yield Factor(np.array([off_rad]) / sd_rad, derivative / sd_rad, 1.0)
    yield from _priors(graph, pose, arrow)


def _moves(graph: Graph, pose: Floats, arrow: Floats) -> Iterator[Factor]:
    for (a, scale, _), row in zip(graph.move_at, graph.move, strict=True):
        north, east, duration_s, sd_m, sd_rad = row
        turn_rad = 0.5 * (pose[a, 2] + pose[a + 1, 2])
        along = _turned(turn_rad, north, east)
        moved = (1.0 + arrow[scale]) * along
        derivative = np.zeros((2, pose.size + arrow.size))
        derivative[[0, 1], [3 * a, 3 * a + 1]] = -1.0
        derivative[[0, 1], [3 * a + 3, 3 * a + 4]] = 1.0
        for turn in (3 * a + 2, 3 * a + 5):
            derivative[:, turn] = 0.5 * moved[1], -0.5 * moved[0]
        derivative[:, pose.size + scale] = -along
        residual = pose[a + 1, :2] - pose[a, :2] - moved
        off = Factor(residual / sd_m, derivative / sd_m, PLACE_DOF)
        yield _measured(graph, arrow, scale, off)
        derivative = np.zeros((1, pose.size + arrow.size))
        derivative[0, [3 * a + 2, 3 * a + 5]] = -1.0, 1.0
        derivative[0, pose.size + scale + 1] = -duration_s
        off_rad = pose[a + 1, 2] - pose[a, 2] - arrow[scale + 1] * duration_s
        yield Factor(np.array([off_rad]) / sd_rad, derivative / sd_rad, TURN_DOF)


def _measured(graph: Graph, arrow: Floats, scale: int, off: Factor) -> Factor:
    """Return a residual told in true metres in those of the unit that measured it."""
    if graph.unit_sd[scale - FIRST_UNIT] >= LOOSE_SCALE_SD:
        return off
    longer = 1.0 + float(arrow[scale])
    column = off.derivative.shape[1] - arrow.size + scale
    return Factor(off.residual / longer, off.derivative / longer, off.dof, column, longer)


def _priors(graph: Graph, pose: Floats, arrow: Floats) -> Iterator[Factor]:
    units = (arrow.size - FIRST_UNIT - 2 * len(graph.place)) // 2
    mean = np.concatenate(
        [graph.axis[:1], graph.lead[:1], np.zeros(2 * units), graph.place[:, :2].ravel()]
    )
    sd = np.concatenate(
        [graph.axis[1:2], graph.lead[1:], graph.unit_sd, np.repeat(graph.place[:, 2], 2)]
    )
    derivative = np.hstack([np.zeros((arrow.size, pose.size)), np.diag(1.0 / sd)])
    off = (arrow - mean) / sd
    is_heavy = np.zeros(arrow.size, np.bool_)
    scales = FIRST_UNIT + 2 * np.arange(units)
    is_heavy[scales] = graph.unit_sd[::2] < LOOSE_SCALE_SD
    yield Factor(off[~is_heavy], derivative[~is_heavy], 0.0)
    for column in np.flatnonzero(is_heavy):
        yield Factor(off[[column]], derivative[[column]], SCALE_DOF)
        wider = graph.unit_sd[column - FIRST_UNIT] / MOST_SCALE_SD
        yield Factor(wider * off[[column]], wider * derivative[[column]], 0.0)


def _turned(turn_rad: float, north: float, east: float) -> Floats:
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    return np.array([cosine * north - sine * east, sine * north + cosine * east])


def _point(derivative: Floats, pose: Floats, a: int, north: float, east: float) -> Floats:
    """Write the derivatives of a point carried along with node ``a``; return its offset."""
    offset = _turned(pose[a, 2], north, east)
    derivative[[0, 1], [3 * a, 3 * a + 1]] = 1.0
    derivative[:, 3 * a + 2] = -offset[1], offset[0]
    return offset
