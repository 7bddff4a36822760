"""What a state of the team's graph leaves unexplained, and what that costs."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.arithmetic import logarithm, rotated
from command_post.fusion.team.graph import (
    AXIS,
    FIRST_UNIT,
    LEAD,
    LOOSE_SCALE_SD,
    MOST_SCALE_SD,
    PLACE_DOF,
    SCALE_DOF,
    TURN_DOF,
    Graph,
)
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]

HALF_PI = math.pi / 2.0


@compiled
def weight_of(squared: float, dof: float, dimension: float) -> float:
    """Return the weight of a residual of that squared length, in its own units; Student's t."""
    return (dof + dimension) / (dof + squared) if dof > 0.0 else 1.0


@compiled
def _penalty(squared: float, dof: float, dimension: float) -> float:
    if dof <= 0.0:
        return squared
    return (dof + dimension) * logarithm(1.0 + squared / dof)


@compiled
def longer(unit_sd: Floats, arrow: Floats, scale: int) -> float:
    """Return how many true metres a unit's own metre is: one, if nobody can tell beforehand."""
    return 1.0 + arrow[scale] if unit_sd[scale - FIRST_UNIT] < LOOSE_SCALE_SD else 1.0


@compiled
def off_move(
    move: Floats, row: int, pose: Floats, a: int, stretch: float
) -> tuple[float, float, float, float]:
    """Return a move's way as it is turned, unstretched, and how far off its end is (m)."""
    vn, ve = rotated(0.5 * (pose[a, 2] + pose[a + 1, 2]), move[row, 0], move[row, 1])
    rn = pose[a + 1, 0] - pose[a, 0] - stretch * vn
    re = pose[a + 1, 1] - pose[a, 1] - stretch * ve
    return vn, ve, rn, re


@compiled
def off_turn(pose: Floats, a: int, turned_rad: float) -> float:
    """Return how much further a node is turned against the one before than by drift."""
    return float(pose[a + 1, 2] - pose[a, 2] - turned_rad)


@compiled
def off_tie(
    tie: Floats, row: int, pose: Floats, a: int, arrow: Floats, place: int
) -> tuple[float, float, float, float]:
    """Return the way from a node to where a place was reached, and how far off that is (m)."""
    on, oe = rotated(
        pose[a, 2], tie[row, 0] + arrow[LEAD] * tie[row, 4], tie[row, 1] + arrow[LEAD] * tie[row, 5]
    )
    return on, oe, pose[a, 0] + on - arrow[place], pose[a, 1] + oe - arrow[place + 1]


@compiled
def off_fix(fix: Floats, row: int, pose: Floats, a: int) -> tuple[float, float, float, float]:
    """Return the way from a node to where somebody was seen, and how far off that is (m)."""
    on, oe = rotated(pose[a, 2], fix[row, 0], fix[row, 1])
    return on, oe, pose[a, 0] + on - fix[row, 2], pose[a, 1] + oe - fix[row, 3]


@compiled
def off_known_turn(pose_rad: float, turn_rad: float) -> float:
    """Return how far a turn is off one that is known (rad), the shorter way round."""
    off_rad = pose_rad - turn_rad
    return off_rad - 2.0 * math.pi * math.floor(off_rad / (2.0 * math.pi) + 0.5)


@compiled
def off_axis(pose: Floats, a: int, direction_rad: float, axis_rad: float) -> float:
    """Return how far a straight move is off the axis, or off what is square to it (rad)."""
    off_rad = 0.5 * (pose[a, 2] + pose[a + 1, 2]) + direction_rad - axis_rad
    return float(off_rad - HALF_PI * math.floor(off_rad / HALF_PI + 0.5))


@compiled
def squared_over(north: float, east: float, sd_m: float) -> float:
    """Return the square of a length over a variance."""
    return (north * north + east * east) / (sd_m * sd_m)


@compiled
def unit_dof(column: int, sd: float) -> float:
    """Return Student's degrees of freedom of a unit's column of the arrow; 0: Gaussian."""
    is_scale = (column - FIRST_UNIT) % 2 == 0 and sd < LOOSE_SCALE_SD
    return SCALE_DOF if is_scale else 0.0


@compiled
def cost_of(graph: Graph, pose: Floats, arrow: Floats) -> float:
    """Return twice the negative log-posterior of a state, up to a constant."""
    cost = _moves_cost(graph, pose, arrow)
    cost += _ties_cost(graph, pose, arrow)
    total = 0.0
    for row in range(graph.fix.shape[0]):
        _, _, rn, re = off_fix(graph.fix, row, pose, graph.fix_at[row])
        squared = squared_over(rn, re, graph.fix[row, 4])
        total += _penalty(squared, graph.fix[row, 5], 2.0)
    cost += total
    total = 0.0
    for row in range(graph.turn.shape[0]):
        off_rad = off_known_turn(pose[graph.turn_at[row], 2], graph.turn[row, 0])
        total += 1.0 / (graph.turn[row, 1] * graph.turn[row, 1]) * off_rad * off_rad
    cost += total
    total = 0.0
    for row in range(graph.straight.shape[0]):
        a = graph.move_at[graph.straight_at[row], 0]
        off_rad = off_axis(pose, a, graph.straight[row, 0], arrow[AXIS])
        total += _penalty((off_rad / graph.straight[row, 1]) ** 2, 1.0, 1.0)
    return float(cost + total + _priors_cost(graph, arrow))


@compiled
def _moves_cost(graph: Graph, pose: Floats, arrow: Floats) -> float:
    move, total = graph.move, 0.0
    for row in range(move.shape[0]):
        a, scale = graph.move_at[row, 0], graph.move_at[row, 1]
        _, _, rn, re = off_move(move, row, pose, a, 1.0 + arrow[scale])
        sd_m = move[row, 3] * longer(graph.unit_sd, arrow, scale)
        total += _penalty(squared_over(rn, re, sd_m), PLACE_DOF, 2.0)
        rt = off_turn(pose, a, arrow[scale + 1] * move[row, 2])
        total += _penalty((rt / move[row, 4]) ** 2, TURN_DOF, 1.0)
    return total


@compiled
def _ties_cost(graph: Graph, pose: Floats, arrow: Floats) -> float:
    tie, total = graph.tie, 0.0
    for row in range(tie.shape[0]):
        a, place = graph.tie_at[row, 0], graph.tie_at[row, 1]
        _, _, rn, re = off_tie(tie, row, pose, a, arrow, place)
        sd_m = tie[row, 2] * longer(graph.unit_sd, arrow, graph.tie_at[row, 3])
        total += _penalty(squared_over(rn, re, sd_m), tie[row, 3], 2.0)
    return total


@compiled
def _priors_cost(graph: Graph, arrow: Floats) -> float:
    off_rad, off_s = arrow[AXIS] - graph.axis[0], arrow[LEAD] - graph.lead[0]
    total = float(1.0 / graph.axis[1] ** 2 * off_rad * off_rad)
    total += float(1.0 / graph.lead[1] ** 2 * off_s * off_s)
    places_from = arrow.size - 2 * graph.place.shape[0]
    for column in range(FIRST_UNIT, places_from):
        sd = graph.unit_sd[column - FIRST_UNIT]
        dof = unit_dof(column, sd)
        total += _penalty((arrow[column] / sd) ** 2, dof, 1.0)
        if dof > 0.0:
            total += (arrow[column] / MOST_SCALE_SD) ** 2
    for place in range(graph.place.shape[0]):
        for axis in range(2):
            off_m = arrow[places_from + 2 * place + axis] - graph.place[place, axis]
            total += 1.0 / graph.place[place, 2] ** 2 * off_m * off_m
    return total
