"""Room for the normal equations of the team's graph, and which of its nodes are bare."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.graph import Graph
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]

TABLES = 5
MOVE, TIE, FIX, TURN, STRAIGHT = range(TABLES)
"""Columns of ``System.rows``."""

RUN_AXIS, RUN_SCALE, RUN_WIDTH = 3, 4, 6
"""Columns of a bare node: the three of the kept node before it, axis, scale and drift."""


class System(NamedTuple):
    """The normal equations: blocks of nodes (n, 3, 3), of each with the next, with the arrow.

    A node is *bare* where its chain goes on in one unit, and nothing ties it to a place: all that
    it has to do with the arrow are the axis, scale and drift. The others are *kept*, and so are the
    ends of each chain. ``kept`` (n,) is the kept node that a bare one comes after, or the node
    itself. Bare nodes are eliminated first, from each kept node to the next, and what they leave
    links those two: so few nodes have to do with a whole arrow, and ``link`` is of each with the
    next at first, then of each kept one with the next kept.

    ``wing`` is flat: a kept node has three rows of its ``width`` (see the graph) from ``wing_at``.
    ``bare`` (n, 3, 6) is of bare ones with their six columns. ``scale_at`` (n,) is the chain's
    local column of the scale of the unit in which it goes on from a node. ``inverse``
    takes the inverses of the eliminated blocks. Of ``node`` the upper triangle counts, of ``arrow``
    the lower one. Chain ``c``'s rows of the graph's tables begin at ``rows[c]`` (R + 1, 5). What
    its elimination leaves to the arrow is ``head``, flat, from ``head_at[c]``, square, its lower
    triangle, and ``head_right``, from the graph's ``columns_first[c]``.
    """

    node: Floats
    link: Floats
    inverse: Floats
    wing: Floats
    wing_at: Ints
    bare: Floats
    kept: Ints
    scale_at: Ints
    right: Floats
    arrow: Floats
    arrow_right: Floats
    rows: Ints
    head: Floats
    head_at: Ints
    head_right: Floats


@compiled
def empty_system(graph: Graph, arrow_size: int) -> System:
    """Return equations of the graph's size, with nothing in them as yet."""
    n = graph.width.size
    kept = _kept(graph)
    wing_at = np.zeros(n + 1, np.int64)
    for node in range(n):
        wing_at[node + 1] = wing_at[node] + 3 * graph.width[node] * (kept[node] == node)
    scale_at = np.zeros(n, np.int64)
    scale_at[graph.move_at[:, 0]] = graph.move_at[:, 2]
    head_at = np.zeros(graph.first.size, np.int64)
    for chain in range(graph.first.size - 1):
        columns = graph.columns_first[chain + 1] - graph.columns_first[chain]
        head_at[chain + 1] = head_at[chain] + columns * columns
    # What is linearised anew at every iteration is not emptied twice.
    return System(
        np.empty((n, 3, 3)),
        np.empty((n, 3, 3)),
        np.empty((n, 3, 3)),
        np.empty(wing_at[n]),
        wing_at,
        np.empty((n, 3, RUN_WIDTH)),
        kept,
        scale_at,
        np.empty((n, 3)),
        np.zeros((arrow_size, arrow_size)),
        np.zeros(arrow_size),
        _rows(graph),
        np.empty(head_at[-1]),
        head_at,
        np.empty(graph.columns.size),
    )


@compiled
def _kept(graph: Graph) -> Ints:
    """Return of each node (n,) the last one until it that is kept, which may be itself."""
    kept = np.arange(graph.width.size)
    is_bare = np.ones(kept.size, np.bool_)
    is_bare[graph.first[:-1]] = False
    is_bare[graph.first[1:] - 1] = False
    is_bare[graph.tie_at[:, 0]] = False
    for row in range(1, graph.move_at.shape[0]):
        if graph.move_at[row, 1] != graph.move_at[row - 1, 1]:
            is_bare[graph.move_at[row, 0]] = False
    for node in range(kept.size):
        if is_bare[node]:
            kept[node] = kept[node - 1]
    return kept


@compiled
def _rows(graph: Graph) -> Ints:
    """Return where each chain's rows begin in each of the graph's tables, and where they end."""
    rows = np.zeros((graph.first.size, TABLES), np.int64)
    for chain in range(1, graph.first.size):
        end = graph.first[chain]
        rows[chain] = rows[chain - 1]
        move, tie, fix, turn, straight = rows[chain]
        while move < graph.move_at.shape[0] and graph.move_at[move, 0] < end:
            move += 1
        while tie < graph.tie_at.shape[0] and graph.tie_at[tie, 0] < end:
            tie += 1
        while fix < graph.fix_at.size and graph.fix_at[fix] < end:
            fix += 1
        while turn < graph.turn_at.size and graph.turn_at[turn] < end:
            turn += 1
        while straight < graph.straight_at.size and graph.straight_at[straight] < move:
            straight += 1
        rows[chain] = move, tie, fix, turn, straight
    return rows
