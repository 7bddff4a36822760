"""The normal equations of the team's graph: every factor's residuals, linearised and weighed."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.arithmetic import logarithm, rotated
from command_post.fusion.team.graph import (
    AXIS,
    FIRST_UNIT,
    LEAD,
    LOOSE_SCALE_SD,
    PLACE_DOF,
    SCALE_DOF,
    TURN_DOF,
    Graph,
)
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]

HALF_PI = math.pi / 2.0


class System(NamedTuple):
    """The normal equations: blocks of nodes (n, 3, 3), of each with the next, with the arrow.

    ``wing`` is flat: node ``a`` has three rows of ``width[a]`` from ``wing_at[a]``. ``inverse``
    takes the inverses of the eliminated blocks. Of ``arrow`` only the lower triangle counts.
    """

    node: Floats
    link: Floats
    inverse: Floats
    wing: Floats
    wing_at: Ints
    right: Floats
    arrow: Floats
    arrow_right: Floats


@compiled
def empty_system(graph: Graph, arrow_size: int) -> System:
    """Return equations of the graph's size, all nought."""
    n = graph.width.size
    wing_at = np.zeros(n + 1, np.int64)
    for node in range(n):
        wing_at[node + 1] = wing_at[node] + 3 * graph.width[node]
    return System(
        np.zeros((n, 3, 3)),
        np.zeros((n, 3, 3)),
        np.zeros((n, 3, 3)),
        np.zeros(wing_at[n]),
        wing_at,
        np.zeros((n, 3)),
        np.zeros((arrow_size, arrow_size)),
        np.zeros(arrow_size),
    )


@compiled
def linearise(graph: Graph, pose: Floats, arrow: Floats, system: System) -> float:
    """Fill ``system`` with the normal equations about pose and arrow; return the cost there."""
    system.node[:] = 0.0
    system.link[:] = 0.0
    system.wing[:] = 0.0
    system.right[:] = 0.0
    system.arrow[:] = 0.0
    system.arrow_right[:] = 0.0
    cost = _add_moves(graph, pose, arrow, system)
    cost += _add_ties(graph, pose, arrow, system)
    cost += _add_fixes(graph, pose, system)
    cost += _add_turns(graph, pose, system)
    cost += _add_straights(graph, pose, arrow, system)
    return cost + _add_priors(graph, arrow, system)


@compiled
def _robust(squared: float, dof: float, dimension: float) -> tuple[float, float]:
    """Return the weight and the cost of a residual of that squared length, in its own units."""
    if dof <= 0.0:
        return 1.0, squared
    weight = (dof + dimension) / (dof + squared)
    return weight, (dof + dimension) * logarithm(1.0 + squared / dof)


@compiled
def _add_moves(graph: Graph, pose: Floats, arrow: Floats, system: System) -> float:
    cost = 0.0
    for row in range(graph.move.shape[0]):
        a = graph.move_at[row, 0]
        c = a + 1
        scale = graph.move_at[row, 1]
        north, east, duration_s, sd_m, sd_rad = graph.move[row]
        vn, ve = rotated(0.5 * (pose[a, 2] + pose[c, 2]), north, east)
        longer = _longer(graph, arrow, scale)
        un = (1.0 + arrow[scale]) * vn
        ue = (1.0 + arrow[scale]) * ve
        rn = pose[c, 0] - pose[a, 0] - un
        re = pose[c, 1] - pose[a, 1] - ue
        sd_m *= longer
        squared = (rn * rn + re * re) / (sd_m * sd_m)
        weight, penalty = _robust(squared, PLACE_DOF, 2.0)
        cost += penalty
        k = weight / (sd_m * sd_m)
        _add_stretch(graph, system, scale, weight * squared, longer)
        # Derivatives by either end's turn; by the ends' places they are -1 and +1.
        gn = 0.5 * ue
        ge = -0.5 * un
        _add_move_place(graph, system, row, k, (gn, ge, vn, ve, rn, re))
        rt = pose[c, 2] - pose[a, 2] - arrow[scale + 1] * duration_s
        weight, penalty = _robust((rt / sd_rad) ** 2, TURN_DOF, 1.0)
        cost += penalty
        _add_move_turn(graph, system, row, weight / (sd_rad * sd_rad), rt)
    return cost


@compiled
def _longer(graph: Graph, arrow: Floats, scale: int) -> float:
    """Return how many true metres a unit's own metre is: one, if nobody can tell beforehand."""
    return 1.0 + arrow[scale] if graph.unit_sd[scale - FIRST_UNIT] < LOOSE_SCALE_SD else 1.0


@compiled
def _add_stretch(graph: Graph, system: System, scale: int, weighed: float, longer: float) -> None:
    """Add what a residual says of a scale by its standard deviation, which grows with it."""
    if graph.unit_sd[scale - FIRST_UNIT] >= LOOSE_SCALE_SD:
        return
    system.arrow_right[scale] += weighed / longer
    system.arrow[scale, scale] += weighed / (longer * longer)


@compiled
def _add_move_place(
    graph: Graph,
    system: System,
    row: int,
    k: float,
    terms: tuple[float, float, float, float, float, float],
) -> None:
    """Add a move's two residuals of place, of precision ``k``."""
    gn, ge, vn, ve, rn, re = terms
    a = graph.move_at[row, 0]
    c = a + 1
    scale = graph.move_at[row, 1]
    local = graph.move_at[row, 2]
    gg = k * (gn * gn + ge * ge)
    for node, sign in ((a, -1.0), (c, 1.0)):
        system.node[node, 0, 0] += k
        system.node[node, 1, 1] += k
        system.node[node, 2, 2] += gg
        system.node[node, 0, 2] += sign * k * gn
        system.node[node, 1, 2] += sign * k * ge
        wing = system.wing_at[node] + local
        width = graph.width[node]
        system.wing[wing] -= sign * k * vn
        system.wing[wing + width] -= sign * k * ve
        system.wing[wing + 2 * width] -= k * (gn * vn + ge * ve)
        system.right[node, 0] -= sign * k * rn
        system.right[node, 1] -= sign * k * re
        system.right[node, 2] -= k * (gn * rn + ge * re)
    link = system.link[a]
    link[0, 0] -= k
    link[1, 1] -= k
    link[0, 2] -= k * gn
    link[1, 2] -= k * ge
    link[2, 0] += k * gn
    link[2, 1] += k * ge
    link[2, 2] += gg
    system.arrow[scale, scale] += k * (vn * vn + ve * ve)
    system.arrow_right[scale] += k * (vn * rn + ve * re)


@compiled
def _add_move_turn(graph: Graph, system: System, row: int, k: float, residual: float) -> None:
    """Add a move's residual of turn, of precision ``k``."""
    a = graph.move_at[row, 0]
    c = a + 1
    drift = graph.move_at[row, 1] + 1
    local = graph.move_at[row, 2] + 1
    duration_s = graph.move[row, 2]
    system.node[a, 2, 2] += k
    system.node[c, 2, 2] += k
    system.link[a, 2, 2] -= k
    system.wing[system.wing_at[a] + 2 * graph.width[a] + local] += k * duration_s
    system.wing[system.wing_at[c] + 2 * graph.width[c] + local] -= k * duration_s
    system.right[a, 2] += k * residual
    system.right[c, 2] -= k * residual
    system.arrow[drift, drift] += k * duration_s * duration_s
    system.arrow_right[drift] += k * duration_s * residual


@compiled
def _add_point(
    system: System, node: int, k: float, gn: float, ge: float, rn: float, re: float
) -> None:
    """Add residuals of a point carried along with a node, of derivatives 1 and (gn, ge)."""
    system.node[node, 0, 0] += k
    system.node[node, 1, 1] += k
    system.node[node, 0, 2] += k * gn
    system.node[node, 1, 2] += k * ge
    system.node[node, 2, 2] += k * (gn * gn + ge * ge)
    system.right[node, 0] -= k * rn
    system.right[node, 1] -= k * re
    system.right[node, 2] -= k * (gn * rn + ge * re)


@compiled
def _add_ties(graph: Graph, pose: Floats, arrow: Floats, system: System) -> float:
    cost = 0.0
    for row in range(graph.tie.shape[0]):
        a = graph.tie_at[row, 0]
        place = graph.tie_at[row, 1]
        north, east, sd_m, dof, fast_north, fast_east = graph.tie[row]
        on, oe = rotated(
            pose[a, 2], north + arrow[LEAD] * fast_north, east + arrow[LEAD] * fast_east
        )
        vn, ve = rotated(pose[a, 2], fast_north, fast_east)
        rn = pose[a, 0] + on - arrow[place]
        re = pose[a, 1] + oe - arrow[place + 1]
        scale = graph.tie_at[row, 3]
        longer = _longer(graph, arrow, scale)
        sd_m *= longer
        squared = (rn * rn + re * re) / (sd_m * sd_m)
        weight, penalty = _robust(squared, dof, 2.0)
        cost += penalty
        k = weight / (sd_m * sd_m)
        _add_stretch(graph, system, scale, weight * squared, longer)
        _add_point(system, a, k, -oe, on, rn, re)
        width = graph.width[a]
        wing = system.wing_at[a] + graph.tie_at[row, 2]
        system.wing[wing] -= k
        system.wing[wing + width + 1] -= k
        system.wing[wing + 2 * width] += k * oe
        system.wing[wing + 2 * width + 1] -= k * on
        system.arrow[place, place] += k
        system.arrow[place + 1, place + 1] += k
        system.arrow_right[place] += k * rn
        system.arrow_right[place + 1] += k * re
        lead = system.wing_at[a] + LEAD
        system.wing[lead] += k * vn
        system.wing[lead + width] += k * ve
        system.wing[lead + 2 * width] += k * (on * ve - oe * vn)
        system.arrow[LEAD, LEAD] += k * (vn * vn + ve * ve)
        system.arrow[place, LEAD] -= k * vn
        system.arrow[place + 1, LEAD] -= k * ve
        system.arrow_right[LEAD] -= k * (vn * rn + ve * re)
    return cost


@compiled
def _add_fixes(graph: Graph, pose: Floats, system: System) -> float:
    cost = 0.0
    for row in range(graph.fix.shape[0]):
        a = graph.fix_at[row]
        north, east, place_north, place_east, sd_m, dof = graph.fix[row]
        on, oe = rotated(pose[a, 2], north, east)
        rn = pose[a, 0] + on - place_north
        re = pose[a, 1] + oe - place_east
        weight, penalty = _robust((rn * rn + re * re) / (sd_m * sd_m), dof, 2.0)
        cost += penalty
        _add_point(system, a, weight / (sd_m * sd_m), -oe, on, rn, re)
    return cost


@compiled
def _add_turns(graph: Graph, pose: Floats, system: System) -> float:
    cost = 0.0
    for row in range(graph.turn.shape[0]):
        a = graph.turn_at[row]
        turn_rad, sd_rad = graph.turn[row]
        off_rad = pose[a, 2] - turn_rad
        off_rad -= 2.0 * math.pi * math.floor(off_rad / (2.0 * math.pi) + 0.5)
        k = 1.0 / (sd_rad * sd_rad)
        cost += k * off_rad * off_rad
        system.node[a, 2, 2] += k
        system.right[a, 2] -= k * off_rad
    return cost


@compiled
def _add_straights(graph: Graph, pose: Floats, arrow: Floats, system: System) -> float:
    """Straight moves follow the axis, or are square to it; Cauchy, for many do not."""
    cost = 0.0
    for row in range(graph.straight.shape[0]):
        a = graph.move_at[graph.straight_at[row], 0]
        c = a + 1
        direction_rad, sd_rad = graph.straight[row]
        off_rad = 0.5 * (pose[a, 2] + pose[c, 2]) + direction_rad - arrow[AXIS]
        off_rad -= HALF_PI * math.floor(off_rad / HALF_PI + 0.5)
        weight, penalty = _robust((off_rad / sd_rad) ** 2, 1.0, 1.0)
        cost += penalty
        k = weight / (sd_rad * sd_rad)
        for node in (a, c):
            system.node[node, 2, 2] += 0.25 * k
            system.right[node, 2] -= 0.5 * k * off_rad
            system.wing[system.wing_at[node] + 2 * graph.width[node]] -= 0.5 * k
        system.link[a, 2, 2] += 0.25 * k
        system.arrow[AXIS, AXIS] += k
        system.arrow_right[AXIS] += k * off_rad
    return cost


@compiled
def _add_priors(graph: Graph, arrow: Floats, system: System) -> float:
    k = 1.0 / graph.axis[1] ** 2
    off_rad = arrow[AXIS] - graph.axis[0]
    cost = float(k * off_rad * off_rad)
    system.arrow[AXIS, AXIS] += k
    system.arrow_right[AXIS] -= k * off_rad
    k = 1.0 / graph.lead[1] ** 2
    off_s = arrow[LEAD] - graph.lead[0]
    cost += float(k * off_s * off_s)
    system.arrow[LEAD, LEAD] += k
    system.arrow_right[LEAD] -= k * off_s
    places_from = arrow.size - 2 * graph.place.shape[0]
    for column in range(FIRST_UNIT, places_from):
        sd = graph.unit_sd[column - FIRST_UNIT]
        is_scale = (column - FIRST_UNIT) % 2 == 0 and sd < LOOSE_SCALE_SD
        weight, penalty = _robust((arrow[column] / sd) ** 2, SCALE_DOF if is_scale else 0.0, 1.0)
        k = weight / (sd * sd)
        cost += penalty
        system.arrow[column, column] += k
        system.arrow_right[column] -= k * arrow[column]
    for place in range(graph.place.shape[0]):
        k = 1.0 / graph.place[place, 2] ** 2
        for axis in range(2):
            column = places_from + 2 * place + axis
            off_m = arrow[column] - graph.place[place, axis]
            cost += k * off_m * off_m
            system.arrow[column, column] += k
            system.arrow_right[column] -= k * off_m
    return cost
