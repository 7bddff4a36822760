"""Solving equations shaped like an arrow: chains eliminated node by node, and the way back.

Each chain carries only those columns of the arrow that it has touched so far; what is left is the
arrow's own, small, dense system. Node after node, kernels are given no more arrays than they need,
and take no views of them: that would cost more than the sums.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.bare_nodes import (
    Run,
    change_bare,
    eliminate_run,
    leave_columns,
    leave_run,
    run_column,
)
from command_post.fusion.team.blocks import (
    Three,
    carry_node,
    change_node,
    invert_block,
    solved,
    times_inverse,
    wing_of,
)
from command_post.fusion.team.graph import LARGEST_TURN_RAD, Graph
from command_post.fusion.team.normal_equations import add_priors, linearise
from command_post.fusion.team.system import RUN_AXIS, RUN_WIDTH, System
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]


@compiled
def reduce_to_arrow(graph: Graph, pose: Floats, arrow: Floats, system: System) -> None:
    """Fill ``system`` with the normal equations about a state, and eliminate all nodes.

    What is left are the arrow's own equations.
    """
    system.arrow[:] = 0.0
    system.arrow_right[:] = 0.0
    for chain in range(graph.first.size - 1):
        linearise(graph, chain, pose, arrow, system)
        _eliminate(graph, chain, system)
    add_priors(graph, arrow, system)
    for chain in range(graph.first.size - 1):
        first = graph.columns_first[chain]
        count = graph.columns_first[chain + 1] - first
        for row in range(count):
            at = graph.columns[first + row]
            system.arrow_right[at] += system.head_right[first + row]
            for column in range(row + 1):
                other = graph.columns[first + column]
                left = system.head[system.head_at[chain] + row * count + column]
                system.arrow[max(at, other), min(at, other)] += left


@compiled
def _eliminate(graph: Graph, chain: int, system: System) -> None:
    """Eliminate a chain's nodes into its head: bare ones first, then each kept into the next."""
    first, end = graph.columns_first[chain], graph.columns_first[chain + 1]
    head = system.head[system.head_at[chain] : system.head_at[chain + 1]]
    head = head.reshape(end - first, end - first)
    head[:] = 0.0
    head_right = system.head_right[first:end]
    head_right[:] = 0.0
    share = np.empty((3, end - first))
    run = Run(
        np.empty((RUN_WIDTH, RUN_WIDTH)), np.empty(RUN_WIDTH), np.empty((1, 3, RUN_WIDTH)),
        np.empty((3, RUN_WIDTH)),
    )  # fmt: skip
    node, link, inverse, right = system.node, system.link, system.inverse, system.right
    wings, wing_at, kept = system.wing, system.wing_at, system.kept
    a, end = graph.first[chain], graph.first[chain + 1]
    wing = wing_of(wings, wing_at, a)
    while a < end:
        onward = after_run(kept, a, end)
        next_wing = wing_of(wings, wing_at, onward) if onward < end else wing
        if onward > a + 1:
            eliminate_run(node, link, inverse, right, system.bare, a, onward, run)
            leave_run(node, link, right, a, run)
            leave_columns(system.scale_at[a], run, wing, next_wing, head, head_right)
        invert_block(node, a, inverse)
        y = solved(inverse, a, right)
        _leave_wing(inverse, a, wing, y, head, head_right, share)
        if onward < end:
            carry_node(node, link, inverse, right, a, onward, y)
            _carry_wing(link, a, share, wing.shape[1], next_wing)
        a, wing = onward, next_wing


@compiled
def after_run(kept: Ints, a: int, end: int) -> int:
    """Return the next kept node after the kept node ``a``, or ``end`` if its chain ends there."""
    onward = a + 1
    while onward < end and kept[onward] == a:
        onward += 1
    return onward


@compiled
def _leave_wing(
    inverse: Floats, a: int, wing: Floats, y: Three, head: Floats, head_right: Floats,
    share: Floats,
) -> None:  # fmt: skip
    """Take what a kept node knew of its ``wing``'s columns to their head.

    Its inverse times its wing is written into the first columns of ``share``.
    """
    times_inverse(inverse, a, wing, share)
    y0, y1, y2 = y
    for row in range(wing.shape[1]):
        w0, w1, w2 = wing[0, row], wing[1, row], wing[2, row]
        head_right[row] -= w0 * y0 + w1 * y1 + w2 * y2
        for column in range(row + 1):
            head[row, column] -= (
                w0 * share[0, column] + w1 * share[1, column] + w2 * share[2, column]
            )


@compiled
def _carry_wing(link: Floats, a: int, share: Floats, width: int, onward: Floats) -> None:
    """Take what node ``a`` knew of ``width`` columns over to the wing (3, ·) of the next."""
    for row in range(3):
        l0, l1, l2 = link[a, 0, row], link[a, 1, row], link[a, 2, row]
        for column in range(width):
            onward[row, column] -= (
                l0 * share[0, column] + l1 * share[1, column] + l2 * share[2, column]
            )


@compiled
def take_step(graph: Graph, system: System, pose: Floats, arrow: Floats, change: Floats) -> float:
    """Go back through the chains and take the step; return how far it moves a place at most.

    ``change`` (n, 3) is room for it.
    """
    for chain in range(graph.first.size - 1):
        columns = graph.columns[graph.columns_first[chain] : graph.columns_first[chain + 1]]
        _go_back(graph, system, chain, system.arrow_right[columns], change)
    furthest_rad = np.max(np.abs(change[:, 2]))
    share = 1.0
    if furthest_rad > LARGEST_TURN_RAD:
        share = LARGEST_TURN_RAD / furthest_rad
    pose += share * change
    arrow += share * system.arrow_right
    return float(np.max(np.abs(change[:, :2])))


@compiled
def _go_back(
    graph: Graph, system: System, chain: int, arrow_change: Floats, change: Floats
) -> None:
    """Write a chain's rows of ``change`` (n, 3), from its last node to its first."""
    link, inverse, right = system.link, system.inverse, system.right
    wings, wing_at, bare, kept = system.wing, system.wing_at, system.bare, system.kept
    of_run = np.empty(RUN_WIDTH)
    start, onward = graph.first[chain], graph.first[chain + 1]
    a = onward - 1
    while True:
        # Behind the last node of a chain is nothing, and its link is nought.
        to = min(onward, change.shape[0] - 1)
        _change_kept(link, inverse, right, wing_of(wings, wing_at, a), a, to, arrow_change, change)
        for each in range(RUN_WIDTH):
            at = run_column(system.scale_at[a], each)
            of_run[each] = change[a, each] if each < RUN_AXIS else arrow_change[at]
        for b in range(onward - 1, a, -1):
            change_bare(link, inverse, right, bare, b, of_run, change)
        if a == start:
            return
        onward, a = a, kept[a - 1]


@compiled
def _change_kept(
    link: Floats, inverse: Floats, right: Floats, wing: Floats, a: int, onward: int,
    arrow_change: Floats, change: Floats,
) -> None:  # fmt: skip
    """Write a kept node's row of ``change`` from its columns' and the next kept one's."""
    # Three sums at once: each alone would wait for its last term at every one.
    rest0, rest1, rest2 = right[a, 0], right[a, 1], right[a, 2]
    for column in range(wing.shape[1]):
        rest0 -= wing[0, column] * arrow_change[column]
        rest1 -= wing[1, column] * arrow_change[column]
        rest2 -= wing[2, column] * arrow_change[column]
    change_node(link, inverse, a, onward, (rest0, rest1, rest2), change)
