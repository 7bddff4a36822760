"""Covariances of a solved graph's nodes, from its arrow's back through the chains."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.bare_nodes import run_column
from command_post.fusion.team.blocks import times_inverse, wing_of
from command_post.fusion.team.graph import Graph
from command_post.fusion.team.system import RUN_AXIS, RUN_WIDTH, System
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]

NO_COVARIANCE, ENDS_ONLY, EVERY_NODE = 0, 1, 2


class _Room(NamedTuple):
    """A node's covariance ``block`` (3, 3) and ``cross`` with the arrow (3, ·), and room for more.

    A node is what is left to it, less ``g`` times the arrow and ``f`` times the next node, so that
    its covariance is D⁻¹ + [G F] Σ [G F]ᵀ; ``to_arrow`` and ``to_next`` are −[G F] Σ.
    """

    block: Floats
    cross: Floats
    g: Floats
    to_arrow: Floats
    f: Floats
    to_next: Floats
    product: Floats


@compiled
def marginals(graph: Graph, system: System, shared: Floats, which: int) -> Floats:
    """Return nodes' covariances, (R, 6) of the chains' ends, or (n, 6) of all (``EVERY_NODE``).

    ``shared`` (A, A) is the arrow's. Columns are nn, ne, ee, turn with turn, north and east.
    """
    chains = graph.first.size - 1
    found = np.zeros((graph.width.size if which == EVERY_NODE else chains, 6))
    inverse, link, bare, kept = system.inverse, system.link, system.bare, system.kept
    wings, wing_at = system.wing, system.wing_at
    of_run, run_room = np.zeros((RUN_WIDTH, RUN_WIDTH)), _room(RUN_WIDTH)
    for chain in range(chains):
        columns = graph.columns[graph.columns_first[chain] : graph.columns_first[chain + 1]]
        own = np.zeros((columns.size, columns.size))
        for row in range(columns.size):
            for column in range(columns.size):
                own[row, column] = shared[columns[row], columns[column]]
        room = _room(columns.size)
        a = graph.first[chain + 1] - 1
        _go_back(inverse, link, a, wing_of(wings, wing_at, a), own, room)
        _tell(room.block, found, a if which == EVERY_NODE else chain)
        while which == EVERY_NODE and a > graph.first[chain]:
            onward, a = a, kept[a - 1]
            scale_at = system.scale_at[a]
            _begin_run(scale_at, room, run_room)
            _go_back(inverse, link, a, wing_of(wings, wing_at, a), own, room)
            _tell(room.block, found, a)
            if onward > a + 1:
                _end_run(scale_at, own, room, of_run, run_room)
            for b in range(onward - 1, a, -1):
                _go_back(inverse, link, b, bare[b], of_run, run_room)
                _tell(run_room.block, found, b)
    return found


@compiled
def _room(width: int) -> _Room:
    return _Room(
        np.zeros((3, 3)), np.zeros((3, width)), np.zeros((3, width)), np.zeros((3, width)),
        np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)),
    )  # fmt: skip


@compiled
def _tell(block: Floats, found: Floats, row: int) -> None:
    """Write a node's covariance (3, 3) into its row of what is found."""
    found[row, 0], found[row, 1], found[row, 2] = block[0, 0], block[0, 1], block[1, 1]
    found[row, 3], found[row, 4], found[row, 5] = block[2, 2], block[0, 2], block[1, 2]


@compiled
def _begin_run(scale_at: int, room: _Room, run_room: _Room) -> None:
    """Keep of the kept node after a run what its bare nodes need."""
    run_room.block[:] = room.block
    for column in range(RUN_AXIS, RUN_WIDTH):
        run_room.cross[:, column] = room.cross[:, run_column(scale_at, column)]


@compiled
def _end_run(scale_at: int, own: Floats, room: _Room, of_run: Floats, run_room: _Room) -> None:
    """Write the covariance of a run's six columns, and that of the kept nodes at its ends."""
    for row in range(3):
        for column in range(3):
            of_run[row, column] = room.block[row, column]
            run_room.cross[column, row] = room.to_next[row, column]
        for column in range(RUN_AXIS, RUN_WIDTH):
            of_run[row, column] = room.cross[row, run_column(scale_at, column)]
            of_run[column, row] = of_run[row, column]
    for row in range(RUN_AXIS, RUN_WIDTH):
        for column in range(RUN_AXIS, RUN_WIDTH):
            at = run_column(scale_at, row)
            of_run[row, column] = own[at, run_column(scale_at, column)]


@compiled
def _go_back(inverse: Floats, link: Floats, a: int, wing: Floats, own: Floats, room: _Room) -> None:
    """Go from the next node's covariance to ``a``'s, ``own`` being that of its wing's columns.

    Behind the last node of a chain all is nought, as is its link.
    """
    width = wing.shape[1]
    times_inverse(inverse, a, wing, room.g)
    _minus_times(room.g, own, width, room.to_arrow)
    block, cross, g, to_arrow, f, to_next, product = room
    _times_transposed(g, cross, width, product)
    for row in range(3):
        i0, i1, i2 = inverse[a, row, 0], inverse[a, row, 1], inverse[a, row, 2]
        for column in range(3):
            f[row, column] = (
                i0 * link[a, 0, column] + i1 * link[a, 1, column] + i2 * link[a, 2, column]
            )
        f0, f1, f2 = f[row, 0], f[row, 1], f[row, 2]
        for column in range(3):
            of_next = f0 * block[0, column] + f1 * block[1, column] + f2 * block[2, column]
            to_next[row, column] = -of_next - product[row, column]
        for column in range(width):
            to_arrow[row, column] -= (
                f0 * cross[0, column] + f1 * cross[1, column] + f2 * cross[2, column]
            )
    _times_transposed(to_arrow, g, width, product)
    for row in range(3):
        t0, t1, t2 = to_next[row, 0], to_next[row, 1], to_next[row, 2]
        for column in range(3):
            of_next = t0 * f[column, 0] + t1 * f[column, 1] + t2 * f[column, 2]
            block[row, column] = inverse[a, row, column] - product[row, column] - of_next
        for column in range(width):
            cross[row, column] = to_arrow[row, column]


@compiled
def _minus_times(g: Floats, own: Floats, width: int, product: Floats) -> None:
    """Write −(3, width)(width, width) into the first columns of ``product``.

    Two rows of the second at once, of which there are as many as there are ways north and east: so
    what it comes to is read and written half as often.
    """
    product[:, :width] = 0.0
    for k in range(0, width, 2):
        g0, g1, g2 = g[0, k], g[1, k], g[2, k]
        h0, h1, h2 = g[0, k + 1], g[1, k + 1], g[2, k + 1]
        for column in range(width):
            one, other = own[k, column], own[k + 1, column]
            product[0, column] = product[0, column] - g0 * one - h0 * other
            product[1, column] = product[1, column] - g1 * one - h1 * other
            product[2, column] = product[2, column] - g2 * one - h2 * other


@compiled
def _times_transposed(one: Floats, other: Floats, width: int, product: Floats) -> None:
    """Write the product (3, 3) of the first columns of (3, ·) and those of (3, ·), transposed."""
    # Nine sums at once: each alone would wait for its last term at every one.
    p00 = p01 = p02 = p10 = p11 = p12 = p20 = p21 = p22 = 0.0
    for k in range(width):
        a0, a1, a2 = one[0, k], one[1, k], one[2, k]
        b0, b1, b2 = other[0, k], other[1, k], other[2, k]
        p00 += a0 * b0
        p01 += a0 * b1
        p02 += a0 * b2
        p10 += a1 * b0
        p11 += a1 * b1
        p12 += a1 * b2
        p20 += a2 * b0
        p21 += a2 * b1
        p22 += a2 * b2
    product[0, 0], product[0, 1], product[0, 2] = p00, p01, p02
    product[1, 0], product[1, 1], product[1, 2] = p10, p11, p12
    product[2, 0], product[2, 1], product[2, 2] = p20, p21, p22
