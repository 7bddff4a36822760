"""What the team's smoother is given: everything that ties poses, DAPs and each other together.

A *chain* is one responder's nodes in the order of time; a node is a pose (north, east, and the
turn of the agent's frame against the incident's: m, m, rad). The *arrow* is what all chains share:
the building's axis (rad), the lead of the radio's peaks (s), then scale error and heading drift
(1, rad/s) of every unit, then north and east (m) of every place: DAPs, and points where two
responders met. A normal matrix ordered so, chains first, looks like an arrow: a block-tridiagonal
shaft, and a head as wide as the arrow.

What a unit measures, its own way and where on it a DAP was passed, it measures in its own metres:
by that much of them is it off. Were it off by so many true metres, a map drawn smaller would have
all its ways and passes agree better, and would come out too small (errors in variables).
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]

AXIS, LEAD = 0, 1
"""Columns of the arrow, and of every chain's own list of columns."""
FIRST_UNIT = 2


class Graph(NamedTuple):
    """The factors, in tables: floats in one, the nodes and columns they touch in another.

    ``first`` (R + 1,): where each chain's nodes begin, of n in all. ``columns``: the arrow's
    columns that each chain touches, chain after chain, in the order of the first touch;
    ``columns_first`` (R + 1,) where each chain's begin. ``width`` (n,): how many of its chain's
    columns are touched up to and with each node. *Local* columns below count in that list.

    - ``move`` (m, 5): north, east (m, in the agent's frame), duration (s), standard deviations of
      place (the unit's own m) and turn (rad), from a node to the next; ``move_at`` (m, 3): that
      node, the arrow's column of its unit's scale, and the local one. Drift is the column after.
    - ``tie`` (t, 6): north, east from the node (m, agent's frame) to where a place was reached,
      standard deviation (the unit's own m), degrees of freedom (0: Gaussian), and how fast they
      then went, north and east (m/s, agent's frame; none where no radio told): by the lead they got
      further before they were nearest. ``tie_at`` (t, 4): node, the place's column of the arrow,
      local one, and the arrow's column of its unit's scale.
    - ``fix`` (f, 6): offset as of a tie, north and east (m, incident's frame), standard deviation
      (m), degrees of freedom; ``fix_at`` (f,): node.
    - ``turn`` (h, 2): the agent's frame's turn as it is known, and its standard deviation (rad);
      ``turn_at`` (h,): node.
    - ``straight`` (s, 2): direction of a straight move in the agent's frame, and how far it may be
      off the axis (rad); ``straight_at`` (s,): row of ``move``.
    - ``place`` (p, 3): what is known of each place beforehand: north, east, standard deviation (m).
    - ``unit_sd`` (2 U,): what is known of scale and drift (rad/s) of each unit, unit after unit.
    - ``axis`` (3,): what is known of the axis, its standard deviation, and how far straight moves
      are off it in covariances (rad).
    - ``lead`` (2,): what is known of the lead of peaks, and its standard deviation (s).
    """

    first: Ints
    columns: Ints
    columns_first: Ints
    width: Ints
    move: Floats
    move_at: Ints
    tie: Floats
    tie_at: Ints
    fix: Floats
    fix_at: Ints
    turn: Floats
    turn_at: Ints
    straight: Floats
    straight_at: Ints
    place: Floats
    unit_sd: Floats
    axis: Floats
    lead: Floats


PLACE_DOF = 4.0
TURN_DOF = 8.0
"""Student's t for moves: places of now and then a missed stride, turns of now and then a jump."""

TURN_TAILS = 1.5
"""By so much wider are turns in covariances. These are of the curvature in the middle of Student's
t, with two thirds of its variance, for its tails are left out; and drifts are no constants."""

SCALE_DOF = 4.0
"""Student's t for what is known of scales: most units are as told, one now and then is far off."""

MOST_SCALE_SD = 0.12
"""How far off that may be, Gaussian on top of the tail, or a map could shrink as a whole: the tail
alone charges hardly more for all ways at four tenths than at nine."""

LOOSE_SCALE_SD = 0.1
"""A unit whose scale is known no better is off in true metres, for its own may be anything."""

LARGEST_TURN_RAD = 0.6
"""A step of the solution that turns a node further is shortened, all of it alike."""


@compiled
def with_tails(graph: Graph) -> Graph:
    """Return the graph of which covariances are told: with turns as wide as their tails make them.

    Straight moves are as near the axis as they are found to be. It is about the same states: these
    are where all is likeliest.
    """
    move, straight = graph.move.copy(), graph.straight.copy()
    move[:, 4] *= TURN_TAILS
    straight[:, 1] = graph.axis[2]
    return Graph(
        graph.first, graph.columns, graph.columns_first, graph.width, move, graph.move_at,
        graph.tie, graph.tie_at, graph.fix, graph.fix_at, graph.turn, graph.turn_at,
        straight, graph.straight_at, graph.place, graph.unit_sd, graph.axis, graph.lead,
    )  # fmt: skip


@compiled
def with_columns(
    first: Ints, move_at: Ints, tie_at: Ints, arrow_size: int
) -> tuple[Ints, Ints, Ints]:
    """Fill in the last columns of ``move_at`` and ``tie_at``; return the chains' lists of columns.

    Rows must be in the order of their nodes. Returns ``columns``, ``columns_first``, ``width``.
    """
    columns = np.empty((first.size - 1) * arrow_size, np.int64)
    columns_first = np.zeros(first.size, np.int64)
    width = np.zeros(first[-1], np.int64)
    local = np.empty(arrow_size, np.int64)
    move = 0
    tie = 0
    for chain in range(first.size - 1):
        local[:] = -1
        begin = columns_first[chain]
        for column in range(FIRST_UNIT):
            columns[begin + column] = column
            local[column] = column
        count = FIRST_UNIT
        for node in range(first[chain], first[chain + 1]):
            while move < move_at.shape[0] and move_at[move, 0] == node:
                count = _touch(move_at, move, local, columns, begin, count)
                move += 1
            while tie < tie_at.shape[0] and tie_at[tie, 0] == node:
                count = _touch(tie_at, tie, local, columns, begin, count)
                tie += 1
            width[node] = count
        columns_first[chain + 1] = begin + count
    return columns[: columns_first[-1]].copy(), columns_first, width


@compiled
def _touch(at: Ints, row: int, local: Ints, columns: Ints, begin: int, count: int) -> int:
    """Give the two columns that a row touches their local numbers; return how many there are."""
    column = at[row, 1]
    if local[column] < 0:
        for each in range(2):
            local[column + each] = count + each
            columns[begin + count + each] = column + each
        count += 2
    at[row, 2] = local[column]
    return count
