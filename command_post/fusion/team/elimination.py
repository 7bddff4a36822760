"""Solving equations shaped like an arrow: chains eliminated node by node, and the way back.

Each chain carries only those columns of the arrow that it has touched so far; what is left is the
arrow's own, small, dense system. Node after node, kernels are given no more arrays than they need,
and take no views of them: that would cost more than the sums.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.graph import LARGEST_TURN_RAD, Graph
from command_post.fusion.team.normal_equations import System, add_priors, linearise
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Three: TypeAlias = tuple[float, float, float]


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
    """Eliminate a chain's nodes, one after another, into its head."""
    first, end = graph.columns_first[chain], graph.columns_first[chain + 1]
    head = system.head[system.head_at[chain] : system.head_at[chain + 1]]
    head = head.reshape(end - first, end - first)
    head[:] = 0.0
    head_right = system.head_right[first:end]
    head_right[:] = 0.0
    share = np.empty((3, end - first))
    node, link, inverse, right = system.node, system.link, system.inverse, system.right
    wings, wing_at = system.wing, system.wing_at
    wing = wing_of(wings, wing_at, graph.first[chain])
    for a in range(graph.first[chain], graph.first[chain + 1]):
        _invert_block(node, a, inverse)
        times_inverse(inverse, a, wing, share)
        y0, y1, y2 = _solved(inverse, a, right)
        for row in range(wing.shape[1]):
            w0, w1, w2 = wing[0, row], wing[1, row], wing[2, row]
            head_right[row] -= w0 * y0 + w1 * y1 + w2 * y2
            for column in range(row + 1):
                head[row, column] -= (
                    w0 * share[0, column] + w1 * share[1, column] + w2 * share[2, column]
                )
        if a + 1 < graph.first[chain + 1]:
            _carry_node(node, link, inverse, right, a, (y0, y1, y2))
            onward = wing_of(wings, wing_at, a + 1)
            _carry_wing(link, a, share, wing.shape[1], onward)
            wing = onward


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
    node: Floats, link: Floats, inverse: Floats, right: Floats, a: int, y: Three
) -> None:
    """Take what node ``a`` knew over to the next node of its chain."""
    for row in range(3):
        l0, l1, l2 = link[a, 0, row], link[a, 1, row], link[a, 2, row]
        right[a + 1, row] -= l0 * y[0] + l1 * y[1] + l2 * y[2]
        f0 = l0 * inverse[a, 0, 0] + l1 * inverse[a, 1, 0] + l2 * inverse[a, 2, 0]
        f1 = l0 * inverse[a, 0, 1] + l1 * inverse[a, 1, 1] + l2 * inverse[a, 2, 1]
        f2 = l0 * inverse[a, 0, 2] + l1 * inverse[a, 1, 2] + l2 * inverse[a, 2, 2]
        for column in range(row, 3):
            node[a + 1, row, column] -= (
                f0 * link[a, 0, column] + f1 * link[a, 1, column] + f2 * link[a, 2, column]
            )


@compiled
def _carry_wing(link: Floats, a: int, share: Floats, width: int, onward: Floats) -> None:
    """Take what node ``a`` knew of ``width`` columns over to the next node's wing (3, ·)."""
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
    wings, wing_at = system.wing, system.wing_at
    end = graph.first[chain + 1]
    for a in range(end - 1, graph.first[chain] - 1, -1):
        wing = wing_of(wings, wing_at, a)
        # Three sums at once: each alone would wait for its last term at every one.
        rest0, rest1, rest2 = right[a, 0], right[a, 1], right[a, 2]
        for column in range(wing.shape[1]):
            rest0 -= wing[0, column] * arrow_change[column]
            rest1 -= wing[1, column] * arrow_change[column]
            rest2 -= wing[2, column] * arrow_change[column]
        if a + 1 < end:
            for k in range(3):
                rest0 -= link[a, 0, k] * change[a + 1, k]
                rest1 -= link[a, 1, k] * change[a + 1, k]
                rest2 -= link[a, 2, k] * change[a + 1, k]
        for row in range(3):
            i0, i1, i2 = inverse[a, row, 0], inverse[a, row, 1], inverse[a, row, 2]
            change[a, row] = i0 * rest0 + i1 * rest1 + i2 * rest2
