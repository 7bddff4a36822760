"""Solving equations shaped like an arrow: chains eliminated node by node, and the way back.

Each chain carries only those columns of the arrow that it has touched so far; what is left is the
arrow's own, small, dense system.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.graph import LARGEST_TURN_RAD, Graph
from command_post.fusion.team.normal_equations import System
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]

NO_COVARIANCE, ENDS_ONLY, EVERY_NODE = 0, 1, 2


@compiled
def _invert_block(block: Floats, inverse: Floats) -> None:
    """Write the inverse of a symmetric (3, 3) ``block``, given by its upper triangle."""
    a, b, c = block[0, 0], block[0, 1], block[0, 2]
    d, e, f = block[1, 1], block[1, 2], block[2, 2]
    p = d * f - e * e
    q = c * e - b * f
    r = b * e - c * d
    over = 1.0 / (a * p + b * q + c * r)
    inverse[0, 0] = p * over
    inverse[0, 1] = inverse[1, 0] = q * over
    inverse[0, 2] = inverse[2, 0] = r * over
    inverse[1, 1] = (a * f - c * c) * over
    inverse[1, 2] = inverse[2, 1] = (b * c - a * e) * over
    inverse[2, 2] = (a * d - b * b) * over


@compiled
def determinant(block: Floats) -> float:
    """Return the determinant of a symmetric (3, 3) ``block``."""
    a, b, c = block[0, 0], block[0, 1], block[0, 2]
    d, e, f = block[1, 1], block[1, 2], block[2, 2]
    found: float = a * (d * f - e * e) + b * (c * e - b * f) + c * (b * e - c * d)
    return found


@compiled
def _times(one: Floats, other: Floats) -> Floats:
    """Return the product of (n, k) and (k, m), summed in one order, as a library's need not be."""
    product = np.zeros((one.shape[0], other.shape[1]))
    for row in range(one.shape[0]):
        for k in range(one.shape[1]):
            weight = one[row, k]
            for column in range(other.shape[1]):
                product[row, column] += weight * other[k, column]
    return product


@compiled
def eliminate(graph: Graph, system: System) -> None:
    """Eliminate all nodes, chain by chain, into the arrow's own equations."""
    for chain in range(graph.first.size - 1):
        start, end = graph.first[chain], graph.first[chain + 1]
        columns = graph.columns[graph.columns_first[chain] : graph.columns_first[chain + 1]]
        schur = np.zeros((columns.size, columns.size))
        right = np.zeros(columns.size)
        share = np.zeros((3, columns.size))
        for a in range(start, end):
            _invert_block(system.node[a], system.inverse[a])
            inverse = system.inverse[a]
            width = graph.width[a]
            wing = system.wing[system.wing_at[a] : system.wing_at[a + 1]].reshape(3, width)
            for row in range(3):
                i0, i1, i2 = inverse[row]
                for column in range(width):
                    share[row, column] = (
                        i0 * wing[0, column] + i1 * wing[1, column] + i2 * wing[2, column]
                    )
            r0, r1, r2 = system.right[a]
            y = (
                inverse[0, 0] * r0 + inverse[0, 1] * r1 + inverse[0, 2] * r2,
                inverse[1, 0] * r0 + inverse[1, 1] * r1 + inverse[1, 2] * r2,
                inverse[2, 0] * r0 + inverse[2, 1] * r1 + inverse[2, 2] * r2,
            )
            for row in range(width):
                w0, w1, w2 = wing[0, row], wing[1, row], wing[2, row]
                right[row] -= w0 * y[0] + w1 * y[1] + w2 * y[2]
                for column in range(row + 1):
                    schur[row, column] -= (
                        w0 * share[0, column] + w1 * share[1, column] + w2 * share[2, column]
                    )
            if a + 1 < end:
                _carry_on(graph, system, a, y, share)
        for row in range(columns.size):
            system.arrow_right[columns[row]] += right[row]
            for column in range(row + 1):
                low = max(columns[row], columns[column])
                high = min(columns[row], columns[column])
                system.arrow[low, high] += schur[row, column]


@compiled
def _carry_on(
    graph: Graph, system: System, a: int, y: tuple[float, float, float], share: Floats
) -> None:
    """Take what node ``a`` knew over to the next node of its chain."""
    link = system.link[a]
    inverse = system.inverse[a]
    onward = system.wing[system.wing_at[a + 1] :]
    onward_width = graph.width[a + 1]
    for row in range(3):
        l0, l1, l2 = link[0, row], link[1, row], link[2, row]
        system.right[a + 1, row] -= l0 * y[0] + l1 * y[1] + l2 * y[2]
        for column in range(3):
            total = 0.0
            for k in range(3):
                total += (l0 * inverse[0, k] + l1 * inverse[1, k] + l2 * inverse[2, k]) * link[
                    k, column
                ]
            system.node[a + 1, row, column] -= total
        for column in range(graph.width[a]):
            onward[row * onward_width + column] -= (
                l0 * share[0, column] + l1 * share[1, column] + l2 * share[2, column]
            )


@compiled
def take_step(graph: Graph, system: System, pose: Floats, arrow: Floats) -> float:
    """Go back through the chains and take the step; return how far it moves a place at most."""
    change = np.zeros((graph.width.size, 3))
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
    end = graph.first[chain + 1]
    for a in range(end - 1, graph.first[chain] - 1, -1):
        width = graph.width[a]
        wing = system.wing[system.wing_at[a] : system.wing_at[a + 1]].reshape(3, width)
        # Three sums at once: each alone would wait for its last term at every one.
        rest0, rest1, rest2 = system.right[a]
        for column in range(width):
            rest0 -= wing[0, column] * arrow_change[column]
            rest1 -= wing[1, column] * arrow_change[column]
            rest2 -= wing[2, column] * arrow_change[column]
        if a + 1 < end:
            link = system.link[a]
            for k in range(3):
                rest0 -= link[0, k] * change[a + 1, k]
                rest1 -= link[1, k] * change[a + 1, k]
                rest2 -= link[2, k] * change[a + 1, k]
        for row in range(3):
            i0, i1, i2 = system.inverse[a, row]
            change[a, row] = i0 * rest0 + i1 * rest1 + i2 * rest2


@compiled
def marginals(graph: Graph, system: System, shared: Floats, which: int) -> Floats:
    """Return nodes' covariances (see :class:`Covariance`): (R, 6) of the ends, or (n, 6) of all."""
    chains = graph.first.size - 1
    found = np.zeros((graph.width.size if which == EVERY_NODE else chains, 6))
    for chain in range(chains):
        start, end = graph.first[chain], graph.first[chain + 1]
        columns = graph.columns[graph.columns_first[chain] : graph.columns_first[chain + 1]]
        own = np.zeros((columns.size, columns.size))
        for row in range(columns.size):
            for column in range(columns.size):
                own[row, column] = shared[columns[row], columns[column]]
        node = np.zeros((3, 3))
        cross = np.zeros((3, columns.size))
        wings = np.zeros((6, columns.size))
        last = start if which == EVERY_NODE else end - 1
        for a in range(end - 1, last - 1, -1):
            _marginal(graph, system, own, a, a + 1 < end, node, cross, wings)
            row = a if which == EVERY_NODE else chain
            found[row, 0] = node[0, 0]
            found[row, 1] = node[0, 1]
            found[row, 2] = node[1, 1]
            found[row, 3] = node[2, 2]
            found[row, 4] = node[0, 2]
            found[row, 5] = node[1, 2]
    return found


@compiled
def _marginal(
    graph: Graph,
    system: System,
    own: Floats,
    a: int,
    has_next: bool,
    node: Floats,
    cross: Floats,
    wings: Floats,
) -> None:
    """Go from the next node's covariance to ``a``'s: ``node`` its own, ``cross`` with the arrow.

    A node is what is left to it, less G times the arrow and F times the next node, so that its
    covariance is D⁻¹ + [G F] Σ [G F]ᵀ. ``wings`` (6, ·) is room for G and for what it comes to.
    """
    width = graph.width[a]
    inverse = system.inverse[a]
    wing = system.wing[system.wing_at[a] : system.wing_at[a + 1]].reshape(3, width)
    g, to_arrow = wings[:3], wings[3:]
    for row in range(3):
        i0, i1, i2 = inverse[row]
        for column in range(width):
            g[row, column] = i0 * wing[0, column] + i1 * wing[1, column] + i2 * wing[2, column]
    _minus_times(g, own, width, to_arrow)
    if has_next:
        f = _times(inverse, system.link[a])
        to_next = -_times(f, node) - _times_transposed(g, cross, width)
        for row in range(3):
            f0, f1, f2 = f[row]
            for column in range(width):
                to_arrow[row, column] -= (
                    f0 * cross[0, column] + f1 * cross[1, column] + f2 * cross[2, column]
                )
        node[:] = inverse - _times_transposed(to_arrow, g, width) - _times(to_next, f.T)
    else:
        node[:] = inverse - _times_transposed(to_arrow, g, width)
    cross[:, :width] = to_arrow[:, :width]


@compiled
def _minus_times(g: Floats, own: Floats, width: int, product: Floats) -> None:
    """Write −(3, width)(width, width) into the first columns of ``product``, three rows at once."""
    product[:, :width] = 0.0
    for k in range(width):
        g0, g1, g2 = g[0, k], g[1, k], g[2, k]
        for column in range(width):
            product[0, column] -= g0 * own[k, column]
            product[1, column] -= g1 * own[k, column]
            product[2, column] -= g2 * own[k, column]


@compiled
def _times_transposed(one: Floats, other: Floats, width: int) -> Floats:
    """Return the product (3, 3) of the first columns of (3, ·) and those of (3, ·), transposed."""
    product = np.zeros((3, 3))
    for k in range(width):
        for row in range(3):
            for column in range(3):
                product[row, column] += one[row, k] * other[column, k]
    return product
