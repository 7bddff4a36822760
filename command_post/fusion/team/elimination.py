"""Solving equations shaped like an arrow: chains eliminated node by node, and the way back.

Each chain carries only those columns of the arrow that it has touched so far; what is left is the
arrow's own, small, dense system. Node after node, kernels are given no more arrays than they need,
and take no views of them: that would cost more than the sums.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.graph import AXIS, LARGEST_TURN_RAD, Graph
from command_post.fusion.team.normal_equations import (
    RUN_AXIS,
    RUN_SCALE,
    RUN_WIDTH,
    System,
    add_priors,
    linearise,
)
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Three: TypeAlias = tuple[float, float, float]


class Run(NamedTuple):
    """What the bare nodes between two kept ones leave to their six columns.

    ``head`` (6, 6), its lower triangle, and ``right`` (6,) are of the columns themselves, ``onto``
    (1, 3, 6) of the kept node after them with these; ``share`` (3, 6) is room.
    """

    head: Floats
    right: Floats
    onto: Floats
    share: Floats


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
            _eliminate_run(node, link, inverse, right, system.bare, a, onward, run)
            _leave_run(node, link, right, a, run)
            _leave_columns(system.scale_at[a], run, wing, next_wing, head, head_right)
        _invert_block(node, a, inverse)
        y = _solved(inverse, a, right)
        _leave_wing(inverse, a, wing, y, head, head_right, share)
        if onward < end:
            _carry_node(node, link, inverse, right, a, onward, y)
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
def _eliminate_run(
    node: Floats, link: Floats, inverse: Floats, right: Floats, bare: Floats,
    a: int, onward: int, run: Run,
) -> None:  # fmt: skip
    """Eliminate the bare nodes between two kept ones, as a chain whose arrow are their columns."""
    head, of_head, onto, share = run.head, run.right, run.onto, run.share
    head[:] = 0.0
    of_head[:] = 0.0
    onto[:] = 0.0
    for row in range(3):
        for column in range(3):
            bare[a + 1, column, row] = link[a, row, column]
    for b in range(a + 1, onward):
        _invert_block(node, b, inverse)
        y = _solved(inverse, b, right)
        _leave_bare(inverse, bare, b, y, head, of_head, share)
        _carry_node(node, link, inverse, right, b, b + 1, y)
        if b + 1 < onward:
            _carry_bare(link, b, share, bare, b + 1)
        else:
            _carry_bare(link, b, share, onto, 0)


@compiled
def _leave_bare(
    inverse: Floats, bare: Floats, b: int, y: Three, head: Floats, right: Floats, share: Floats
) -> None:
    """Take what a bare node ``b`` knew of its columns to those themselves."""
    for row in range(3):
        i0, i1, i2 = inverse[b, row, 0], inverse[b, row, 1], inverse[b, row, 2]
        for column in range(RUN_WIDTH):
            share[row, column] = (
                i0 * bare[b, 0, column] + i1 * bare[b, 1, column] + i2 * bare[b, 2, column]
            )
    for row in range(RUN_WIDTH):
        w0, w1, w2 = bare[b, 0, row], bare[b, 1, row], bare[b, 2, row]
        right[row] -= w0 * y[0] + w1 * y[1] + w2 * y[2]
        # Whole rows, of which the lower triangle counts: so all are as long, and done at once.
        for column in range(RUN_WIDTH):
            head[row, column] -= (
                w0 * share[0, column] + w1 * share[1, column] + w2 * share[2, column]
            )


@compiled
def _carry_bare(link: Floats, b: int, share: Floats, onto: Floats, at: int) -> None:
    """Take what a bare node ``b`` knew of its columns over to the next node's, ``onto[at]``."""
    for row in range(3):
        l0, l1, l2 = link[b, 0, row], link[b, 1, row], link[b, 2, row]
        for column in range(RUN_WIDTH):
            onto[at, row, column] -= (
                l0 * share[0, column] + l1 * share[1, column] + l2 * share[2, column]
            )


@compiled
def _leave_run(node: Floats, link: Floats, right: Floats, a: int, run: Run) -> None:
    """Add what bare nodes have left to the kept one before them, and link it with that after."""
    head, of_head, onto = run.head, run.right, run.onto
    for row in range(3):
        right[a, row] += of_head[row]
        for column in range(3):
            link[a, row, column] = onto[0, column, row]
        for column in range(row + 1):
            node[a, column, row] += head[row, column]


@compiled
def _leave_columns(
    scale_at: int, run: Run, wing: Floats, next_wing: Floats, head: Floats, head_right: Floats
) -> None:
    """Add what bare nodes have left to what kept ones at both ends, and the head, know of it."""
    of_run, right, onto = run.head, run.right, run.onto
    for each in range(RUN_AXIS, RUN_WIDTH):
        at = run_column(scale_at, each)
        head_right[at] += right[each]
        for column in range(RUN_AXIS, each + 1):
            head[at, run_column(scale_at, column)] += of_run[each, column]
        for row in range(3):
            wing[row, at] += of_run[each, row]
            next_wing[row, at] += onto[0, row, each]


@compiled
def run_column(scale_at: int, column: int) -> int:
    """Return the chain's local column that a column of a bare node's wing is, after its node."""
    return AXIS if column == RUN_AXIS else scale_at + column - RUN_SCALE


@compiled
def wing_of(wing: Floats, wing_at: Ints, a: int) -> Floats:
    """Return what a node has to do with the arrow: a view (3, width)."""
    first, end = wing_at[a], wing_at[a + 1]
    return wing[first:end].reshape(3, (end - first) // 3)


@compiled
def _invert_block(node: Floats, a: int, inverse: Floats) -> None:
    """Write the inverse of a node's symmetric block, given by its upper triangle."""
    n00, n01, n02 = node[a, 0, 0], node[a, 0, 1], node[a, 0, 2]
    n11, n12, n22 = node[a, 1, 1], node[a, 1, 2], node[a, 2, 2]
    p = n11 * n22 - n12 * n12
    q = n02 * n12 - n01 * n22
    r = n01 * n12 - n02 * n11
    over = 1.0 / (n00 * p + n01 * q + n02 * r)
    inverse[a, 0, 0] = p * over
    inverse[a, 0, 1] = inverse[a, 1, 0] = q * over
    inverse[a, 0, 2] = inverse[a, 2, 0] = r * over
    inverse[a, 1, 1] = (n00 * n22 - n02 * n02) * over
    inverse[a, 1, 2] = inverse[a, 2, 1] = (n01 * n02 - n00 * n12) * over
    inverse[a, 2, 2] = (n00 * n11 - n01 * n01) * over


@compiled
def determinant(block: Floats) -> float:
    """Return the determinant of a symmetric (3, 3) ``block``."""
    a, b, c = block[0, 0], block[0, 1], block[0, 2]
    d, e, f = block[1, 1], block[1, 2], block[2, 2]
    found: float = a * (d * f - e * e) + b * (c * e - b * f) + c * (b * e - c * d)
    return found


@compiled
def times_inverse(inverse: Floats, a: int, wing: Floats, share: Floats) -> None:
    """Write a node's inverse times its wing (3, width) into the first columns of ``share``."""
    for row in range(3):
        i0, i1, i2 = inverse[a, row, 0], inverse[a, row, 1], inverse[a, row, 2]
        for column in range(wing.shape[1]):
            share[row, column] = i0 * wing[0, column] + i1 * wing[1, column] + i2 * wing[2, column]


@compiled
def _solved(inverse: Floats, a: int, right: Floats) -> Three:
    """Return a node's inverse times its right side."""
    r0, r1, r2 = right[a, 0], right[a, 1], right[a, 2]
    return (
        inverse[a, 0, 0] * r0 + inverse[a, 0, 1] * r1 + inverse[a, 0, 2] * r2,
        inverse[a, 1, 0] * r0 + inverse[a, 1, 1] * r1 + inverse[a, 1, 2] * r2,
        inverse[a, 2, 0] * r0 + inverse[a, 2, 1] * r1 + inverse[a, 2, 2] * r2,
    )


@compiled
def _carry_node(
    node: Floats, link: Floats, inverse: Floats, right: Floats, a: int, onward: int, y: Three
) -> None:
    """Take what node ``a`` knew over to the ``onward`` one, which it is linked with."""
    for row in range(3):
        l0, l1, l2 = link[a, 0, row], link[a, 1, row], link[a, 2, row]
        right[onward, row] -= l0 * y[0] + l1 * y[1] + l2 * y[2]
        f0 = l0 * inverse[a, 0, 0] + l1 * inverse[a, 1, 0] + l2 * inverse[a, 2, 0]
        f1 = l0 * inverse[a, 0, 1] + l1 * inverse[a, 1, 1] + l2 * inverse[a, 2, 1]
        f2 = l0 * inverse[a, 0, 2] + l1 * inverse[a, 1, 2] + l2 * inverse[a, 2, 2]
        for column in range(row, 3):
            node[onward, row, column] -= (
                f0 * link[a, 0, column] + f1 * link[a, 1, column] + f2 * link[a, 2, column]
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
            _change_bare(link, inverse, right, bare, b, of_run, change)
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
    _change_node(link, inverse, a, onward, (rest0, rest1, rest2), change)


@compiled
def _change_bare(
    link: Floats, inverse: Floats, right: Floats, bare: Floats, b: int, of_run: Floats,
    change: Floats,
) -> None:  # fmt: skip
    """Write a bare node's row of ``change`` from its columns' and the next one's."""
    rest0, rest1, rest2 = right[b, 0], right[b, 1], right[b, 2]
    for column in range(RUN_WIDTH):
        rest0 -= bare[b, 0, column] * of_run[column]
        rest1 -= bare[b, 1, column] * of_run[column]
        rest2 -= bare[b, 2, column] * of_run[column]
    _change_node(link, inverse, b, b + 1, (rest0, rest1, rest2), change)


@compiled
def _change_node(
    link: Floats, inverse: Floats, a: int, onward: int, rest: Three, change: Floats
) -> None:
    """Write a node's row of ``change`` from the next one's, and what its columns leave."""
    rest0, rest1, rest2 = rest
    for k in range(3):
        rest0 -= link[a, 0, k] * change[onward, k]
        rest1 -= link[a, 1, k] * change[onward, k]
        rest2 -= link[a, 2, k] * change[onward, k]
    for row in range(3):
        i0, i1, i2 = inverse[a, row, 0], inverse[a, row, 1], inverse[a, row, 2]
        change[a, row] = i0 * rest0 + i1 * rest1 + i2 * rest2
