"""Bare nodes, eliminated from one kept node to the next (``System`` says which are bare).

They are a chain of their own, whose arrow are six columns: the kept node before them, the axis,
and their unit's scale and drift.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.blocks import (
    Three,
    carry_node,
    change_node,
    invert_block,
    solved,
)
from command_post.fusion.team.graph import AXIS
from command_post.fusion.team.system import RUN_AXIS, RUN_SCALE, RUN_WIDTH
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]


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
def eliminate_run(
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
        invert_block(node, b, inverse)
        y = solved(inverse, b, right)
        _leave_bare(inverse, bare, b, y, head, of_head, share)
        carry_node(node, link, inverse, right, b, b + 1, y)
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
def leave_run(node: Floats, link: Floats, right: Floats, a: int, run: Run) -> None:
    """Add what bare nodes have left to the kept one before them, and link it with that after."""
    head, of_head, onto = run.head, run.right, run.onto
    for row in range(3):
        right[a, row] += of_head[row]
        for column in range(3):
            link[a, row, column] = onto[0, column, row]
        for column in range(row + 1):
            node[a, column, row] += head[row, column]


@compiled
def leave_columns(
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
def change_bare(
    link: Floats, inverse: Floats, right: Floats, bare: Floats, b: int, of_run: Floats,
    change: Floats,
) -> None:  # fmt: skip
    """Write a bare node's row of ``change`` from its columns' and the next one's."""
    rest0, rest1, rest2 = right[b, 0], right[b, 1], right[b, 2]
    for column in range(RUN_WIDTH):
        rest0 -= bare[b, 0, column] * of_run[column]
        rest1 -= bare[b, 1, column] * of_run[column]
        rest2 -= bare[b, 2, column] * of_run[column]
    change_node(link, inverse, b, b + 1, (rest0, rest1, rest2), change)
