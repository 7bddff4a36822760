"""The normal equations of the team's graph: every factor's residuals, linearised and weighed.

They are made chain by chain, so that a chain is still at hand when its nodes are eliminated. What
is added to one entry is added in the order of the graph's tables all the same.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.arithmetic import rotated
from command_post.fusion.team.graph import (
    AXIS,
    FIRST_UNIT,
    LEAD,
    LOOSE_SCALE_SD,
    MOST_SCALE_SD,
    PLACE_DOF,
    TURN_DOF,
    Graph,
)
from command_post.fusion.team.residuals import (
    longer,
    off_axis,
    off_fix,
    off_known_turn,
    off_move,
    off_tie,
    off_turn,
    squared_over,
    unit_dof,
    weight_of,
)
from command_post.fusion.team.system import (
    FIX,
    MOVE,
    RUN_AXIS,
    RUN_SCALE,
    STRAIGHT,
    TIE,
    TURN,
    System,
)
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]


@compiled
def linearise(graph: Graph, chain: int, pose: Floats, arrow: Floats, system: System) -> None:
    """Fill ``system`` with a chain's normal equations about ``pose`` and ``arrow``.

    What it has to say of the arrow is added to what is there.
    """
    start, end = graph.first[chain], graph.first[chain + 1]
    system.node[start:end] = 0.0
    system.link[start:end] = 0.0
    system.wing[system.wing_at[start] : system.wing_at[end]] = 0.0
    system.bare[start:end] = 0.0
    system.right[start:end] = 0.0
    rows, until = system.rows[chain], system.rows[chain + 1]
    _add_moves(graph, rows[MOVE], until[MOVE], pose, arrow, system)
    _add_ties(graph, rows[TIE], until[TIE], pose, arrow, system)
    _add_fixes(graph, rows[FIX], until[FIX], pose, system)
    _add_turns(graph, rows[TURN], until[TURN], pose, system)
    _add_straights(graph, rows[STRAIGHT], until[STRAIGHT], pose, arrow, system)


@compiled
def _add_moves(
    graph: Graph, first: int, end: int, pose: Floats, arrow: Floats, system: System
) -> None:
    # Taken out of their tables once: not for every row.
    move, move_at, unit_sd = graph.move, graph.move_at, graph.unit_sd
    node, link, right = system.node, system.link, system.right
    wing, wing_at, width = system.wing, system.wing_at, graph.width
    bare, kept = system.bare, system.kept
    head, head_right = system.arrow, system.arrow_right
    for row in range(first, end):
        a, scale, local = move_at[row, 0], move_at[row, 1], move_at[row, 2]
        stretch = 1.0 + arrow[scale]
        vn, ve, rn, re = off_move(move, row, pose, a, stretch)
        own_m = longer(unit_sd, arrow, scale)
        sd_m = move[row, 3] * own_m
        squared = squared_over(rn, re, sd_m)
        weight = weight_of(squared, PLACE_DOF, 2.0)
        k = weight / (sd_m * sd_m)
        if unit_sd[scale - FIRST_UNIT] < LOOSE_SCALE_SD:
            _add_stretch(head, head_right, scale, weight * squared, own_m)
        # Derivatives by either end's turn; by the ends' places they are -1 and +1.
        gn, ge = 0.5 * (stretch * ve), -0.5 * (stretch * vn)
        _add_move_nodes(node, link, right, a, k, gn, ge, rn, re)
        head[scale, scale] += k * (vn * vn + ve * ve)
        head_right[scale] += k * (vn * rn + ve * re)
        duration_s, sd_rad = move[row, 2], move[row, 4]
        rt = off_turn(pose, a, arrow[scale + 1] * duration_s)
        k_turn = weight_of((rt / sd_rad) ** 2, TURN_DOF, 1.0) / (sd_rad * sd_rad)
        _add_move_turn(node, link, right, a, k_turn, rt)
        head[scale + 1, scale + 1] += k_turn * duration_s * duration_s
        head_right[scale + 1] += k_turn * duration_s * rt
        of_turn = k * (gn * vn + ge * ve)
        of_drift, c = k_turn * duration_s, a + 1
        if kept[a] == a:
            _add_move_wing(wing, wing_at[a] + local, width[a], k, vn, ve, of_turn, of_drift)
        else:
            _add_move_bare(bare, a, k, vn, ve, of_turn, of_drift)
        if kept[c] == c:
            _add_move_wing(wing, wing_at[c] + local, width[c], -k, vn, ve, of_turn, -of_drift)
        else:
            _add_move_bare(bare, c, -k, vn, ve, of_turn, -of_drift)


@compiled
def _add_stretch(
    head: Floats, head_right: Floats, scale: int, weighed: float, own_m: float
) -> None:
    """Add what a residual says of a scale by its standard deviation, which grows with it."""
    head_right[scale] += weighed / own_m
    head[scale, scale] += weighed / (own_m * own_m)


@compiled
def _add_move_nodes(
    node: Floats, link: Floats, right: Floats, a: int, k: float,
    gn: float, ge: float, rn: float, re: float,
) -> None:  # fmt: skip
    """Add what a move's residuals of place, of precision ``k``, say of its two ends."""
    c = a + 1
    kn, ke = k * gn, k * ge
    gg = k * (gn * gn + ge * ge)
    node[a, 0, 0] += k
    node[a, 1, 1] += k
    node[a, 2, 2] += gg
    node[a, 0, 2] -= kn
    node[a, 1, 2] -= ke
    node[c, 0, 0] += k
    node[c, 1, 1] += k
    node[c, 2, 2] += gg
    node[c, 0, 2] += kn
    node[c, 1, 2] += ke
    link[a, 0, 0] -= k
    link[a, 1, 1] -= k
    link[a, 0, 2] -= kn
    link[a, 1, 2] -= ke
    link[a, 2, 0] += kn
    link[a, 2, 1] += ke
    link[a, 2, 2] += gg
    turned = k * (gn * rn + ge * re)
    right[a, 0] += k * rn
    right[a, 1] += k * re
    right[a, 2] -= turned
    right[c, 0] -= k * rn
    right[c, 1] -= k * re
    right[c, 2] -= turned


@compiled
def _add_move_turn(
    node: Floats, link: Floats, right: Floats, a: int, k: float, residual: float
) -> None:
    """Add what a move's residual of turn, of precision ``k``, says of its two ends."""
    node[a, 2, 2] += k
    node[a + 1, 2, 2] += k
    link[a, 2, 2] -= k
    right[a, 2] += k * residual
    right[a + 1, 2] -= k * residual


@compiled
def _add_move_wing(
    wing: Floats, at: int, width: int, k: float, vn: float, ve: float, of_turn: float, drift: float
) -> None:
    """Add what a move says of an end and its unit's scale and drift together."""
    wing[at] += k * vn
    wing[at + width] += k * ve
    wing[at + 2 * width] -= of_turn
    wing[at + 2 * width + 1] += drift


@compiled
def _add_move_bare(
    bare: Floats, a: int, k: float, vn: float, ve: float, of_turn: float, drift: float
) -> None:
    """Add the same of an end that is a bare node."""
    bare[a, 0, RUN_SCALE] += k * vn
    bare[a, 1, RUN_SCALE] += k * ve
    bare[a, 2, RUN_SCALE] -= of_turn
    bare[a, 2, RUN_SCALE + 1] += drift


@compiled
def _add_point(
    node: Floats, right: Floats, a: int, k: float, gn: float, ge: float, rn: float, re: float
) -> None:
    """Add residuals of a point carried along with a node, of derivatives 1 and (gn, ge)."""
    node[a, 0, 0] += k
    node[a, 1, 1] += k
    node[a, 0, 2] += k * gn
    node[a, 1, 2] += k * ge
    node[a, 2, 2] += k * (gn * gn + ge * ge)
    right[a, 0] -= k * rn
    right[a, 1] -= k * re
    right[a, 2] -= k * (gn * rn + ge * re)


@compiled
def _add_ties(
    graph: Graph, first: int, end: int, pose: Floats, arrow: Floats, system: System
) -> None:
    tie, tie_at, unit_sd = graph.tie, graph.tie_at, graph.unit_sd
    wing, head, head_right = system.wing, system.arrow, system.arrow_right
    for row in range(first, end):
        a, place, scale = tie_at[row, 0], tie_at[row, 1], tie_at[row, 3]
        on, oe, rn, re = off_tie(tie, row, pose, a, arrow, place)
        own_m = longer(unit_sd, arrow, scale)
        sd_m = tie[row, 2] * own_m
        squared = squared_over(rn, re, sd_m)
        weight = weight_of(squared, tie[row, 3], 2.0)
        k = weight / (sd_m * sd_m)
        if unit_sd[scale - FIRST_UNIT] < LOOSE_SCALE_SD:
            _add_stretch(head, head_right, scale, weight * squared, own_m)
        _add_point(system.node, system.right, a, k, -oe, on, rn, re)
        width, at = graph.width[a], system.wing_at[a]
        to_place = at + tie_at[row, 2]
        wing[to_place] -= k
        wing[to_place + width + 1] -= k
        wing[to_place + 2 * width] += k * oe
        wing[to_place + 2 * width + 1] -= k * on
        head[place, place] += k
        head[place + 1, place + 1] += k
        head_right[place] += k * rn
        head_right[place + 1] += k * re
        vn, ve = rotated(pose[a, 2], tie[row, 4], tie[row, 5])
        wing[at + LEAD] += k * vn
        wing[at + LEAD + width] += k * ve
        wing[at + LEAD + 2 * width] += k * (on * ve - oe * vn)
        head[LEAD, LEAD] += k * (vn * vn + ve * ve)
        head[place, LEAD] -= k * vn
        head[place + 1, LEAD] -= k * ve
        head_right[LEAD] -= k * (vn * rn + ve * re)


@compiled
def _add_fixes(graph: Graph, first: int, end: int, pose: Floats, system: System) -> None:
    for row in range(first, end):
        a, sd_m = graph.fix_at[row], graph.fix[row, 4]
        on, oe, rn, re = off_fix(graph.fix, row, pose, a)
        weight = weight_of(squared_over(rn, re, sd_m), graph.fix[row, 5], 2.0)
        _add_point(system.node, system.right, a, weight / (sd_m * sd_m), -oe, on, rn, re)


@compiled
def _add_turns(graph: Graph, first: int, end: int, pose: Floats, system: System) -> None:
    for row in range(first, end):
        a = graph.turn_at[row]
        off_rad = off_known_turn(pose[a, 2], graph.turn[row, 0])
        k = 1.0 / (graph.turn[row, 1] * graph.turn[row, 1])
        system.node[a, 2, 2] += k
        system.right[a, 2] -= k * off_rad


@compiled
def _add_straights(
    graph: Graph, first: int, end: int, pose: Floats, arrow: Floats, system: System
) -> None:
    """Straight moves follow the axis, or are square to it; Cauchy, for many do not."""
    node, link, right = system.node, system.link, system.right
    wing, wing_at, width = system.wing, system.wing_at, graph.width
    bare, kept = system.bare, system.kept
    for row in range(first, end):
        a = graph.move_at[graph.straight_at[row], 0]
        sd_rad = graph.straight[row, 1]
        off_rad = off_axis(pose, a, graph.straight[row, 0], arrow[AXIS])
        k = weight_of((off_rad / sd_rad) ** 2, 1.0, 1.0) / (sd_rad * sd_rad)
        for each in (a, a + 1):
            node[each, 2, 2] += 0.25 * k
            right[each, 2] -= 0.5 * k * off_rad
            if kept[each] == each:
                wing[wing_at[each] + 2 * width[each] + AXIS] -= 0.5 * k
            else:
                bare[each, 2, RUN_AXIS] -= 0.5 * k
        link[a, 2, 2] += 0.25 * k
        system.arrow[AXIS, AXIS] += k
        system.arrow_right[AXIS] += k * off_rad


@compiled
def add_priors(graph: Graph, arrow: Floats, system: System) -> None:
    """Add what is known of the arrow beforehand."""
    for column, known in ((AXIS, graph.axis), (LEAD, graph.lead)):
        k = 1.0 / known[1] ** 2
        system.arrow[column, column] += k
        system.arrow_right[column] -= k * (arrow[column] - known[0])
    places_from = arrow.size - 2 * graph.place.shape[0]
    for column in range(FIRST_UNIT, places_from):
        sd = graph.unit_sd[column - FIRST_UNIT]
        dof = unit_dof(column, sd)
        k = weight_of((arrow[column] / sd) ** 2, dof, 1.0) / (sd * sd)
        if dof > 0.0:
            k += 1.0 / MOST_SCALE_SD**2
        system.arrow[column, column] += k
        system.arrow_right[column] -= k * arrow[column]
    for place in range(graph.place.shape[0]):
        k = 1.0 / graph.place[place, 2] ** 2
        for axis in range(2):
            column = places_from + 2 * place + axis
            system.arrow[column, column] += k
            system.arrow_right[column] -= k * (arrow[column] - graph.place[place, axis])
