"""Groups of whom nobody ever knew a heading, and what stands for how they are turned (pure)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from command_post.fusion.team.assembly import UNKNOWN_SD_M, Assembled
from command_post.fusion.team.chain import turn_known
from command_post.fusion.team.move_log import Ints


def unturned_groups(assembled: Assembled) -> list[tuple[int, ...]]:
    """Return the chains, by index, of each group tied by places in common that knows no heading."""
    if all(turn_known(chain.starts[0]) for chain in assembled.chains):
        return []
    return [
        group
        for group in tied_groups(assembled)
        if not any(turn_known(start) for i in group for start in assembled.chains[i].starts)
    ]


def tied_groups(assembled: Assembled) -> list[tuple[int, ...]]:
    """Return the chains, by index, of each group tied by places in common.

    Places that are known beforehand tie nobody to others.
    """
    members: dict[int, list[int]] = {}
    for index, first in enumerate(_groups(assembled)):
        members.setdefault(first, []).append(index)
    return [tuple(each) for each in members.values()]


def _groups(assembled: Assembled) -> list[int]:
    """Return of each chain the first one of those that it is tied to."""
    of_chain, place, unknown = _ties(assembled)
    group = list(range(len(assembled.chains)))
    first_at: dict[int, int] = {}
    for chain, at in zip(of_chain[unknown].tolist(), place[unknown].tolist(), strict=True):
        one, other = group[chain], group[first_at.setdefault(at, chain)]
        group = [min(one, other) if each in (one, other) else each for each in group]
    return group


def _ties(assembled: Assembled) -> tuple[Ints, Ints, Ints]:
    """Return of each tie (t,) the chain and the place; and which are to places not known before."""
    graph = assembled.graph
    place = (graph.tie_at[:, 1] - assembled.place_column(0)) // 2
    of_chain = np.searchsorted(graph.first, graph.tie_at[:, 0], side="right") - 1
    return of_chain, place, np.flatnonzero(graph.place[place, 2] >= UNKNOWN_SD_M)


def columns_of(assembled: Assembled, group: Sequence[int]) -> tuple[Ints, Ints]:
    """Return the arrow's columns of a group's units, each one's scale and drift, and of its places.

    Of each place, which is not known beforehand, it is the first of two columns.
    """
    of_chain, place, unknown = _ties(assembled)
    own = np.unique(place[unknown][np.isin(of_chain[unknown], group)])
    units = [
        assembled.unit_column(index) + np.arange(2 * len(assembled.chains[index].starts))
        for index in group
    ]
    return np.concatenate(units), np.asarray(assembled.place_column(0) + 2 * own, np.int64)


def gauge(assembled: Assembled, group: Sequence[int]) -> tuple[int, int]:
    """Return which unit's turn stands for a group's: its row of ``Graph.turn``, and its first node.

    It is the one that went the longest way.
    """
    units = []
    for index in group:
        nodes, chain = assembled.nodes[index], assembled.chains[index]
        counts = np.bincount(chain.unit[nodes], minlength=len(chain.starts))
        unit = int(counts.argmax())
        at = int(np.searchsorted(nodes, chain.begin_of(unit)))
        node = int(assembled.graph.first[index]) + at
        units.append((int(counts[unit]), -index, assembled.unit_first[index] + unit, node))
    _, _, row, node = max(units)
    return row, node


def turned_to(assembled: Assembled, row: int, turn_rad: float, sd_rad: float) -> Assembled:
    """Return the same, the turn of a unit being known."""
    turn = assembled.graph.turn.copy()
    turn[row] = turn_rad, sd_rad
    return replace(assembled, graph=assembled.graph._replace(turn=turn))
