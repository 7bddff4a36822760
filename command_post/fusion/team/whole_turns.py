"""Ways in which a map may be turned that nobody's heading tells the turn of (pure).

Passes tell how responders stand to each other and to DAPs, not how all of it lies. If none of those
whom places in common tie together ever knew a heading, the smoother settles on one turn of them
all, and is as sure of it as if there were no other. What is known of the turn beforehand, that any
is as likely, is so nearly a sum of Gaussians, ``SPACING_RAD`` apart (Alspach and Sorenson 1972,
"Nonlinear Bayesian estimation using Gaussian sum approximations"). Under each the team is solved by
itself, and its cost says how likely it is: of a building's axis four remain, of a known heading's
worth of other evidence (a fix, a DAP whose place is known) one, of none a ring.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from command_post.fusion.team.arithmetic import rotated
from command_post.fusion.team.assembly import UNKNOWN_SD_M, Assembled
from command_post.fusion.team.chain import turn_known
from command_post.fusion.team.graph import AXIS
from command_post.fusion.team.marginals import ENDS_ONLY
from command_post.fusion.team.move_log import Floats, Ints
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solving import Solved, Turns, solved_from
from shared.maths.angles import wrap_rad

WAYS = 16
SPACING_RAD = 2.0 * math.pi / WAYS
WIDTH_RAD = 0.7 * SPACING_RAD
"""Gaussians so wide, so far apart, sum up to the same everywhere to a thousandth part."""
LEAST_SHARE = 1e-3
"""What is less likely is left out."""


def with_turns(found: Solved, settings: TeamSettings, iterations: int) -> Solved:
    """Return a solution with all ways in which groups that know no heading may be turned.

    Ends and places of such a group are then as uncertain as these ways differ. It is ``found``
    itself if there is no such group.
    """
    groups = unturned_groups(found)
    if not groups:
        return found
    turns = tuple(_turns(found, group, settings, iterations) for group in groups)
    ends, shared = found.ends.copy(), found.shared.copy()
    for each in turns:
        if each.ways:
            _widen(found, each, ends, shared)
    return found._replace(ends=ends, shared=shared, turns=turns)


def likeliest(found: Solved, settings: TeamSettings) -> Solved:
    """Return the solution with each group that knows no heading turned as suits it best.

    It is ``found`` itself if no turn is better by as much as another heading has to be.
    """
    for group in unturned_groups(found):
        ways = _turns(found, group, settings, settings.commit_iterations).ways
        if not ways:
            continue
        _, best = max(ways, key=lambda way: way[0])
        tried = solved_from(
            found.assembled, best.pose.copy(), best.arrow.copy(), found.belief, settings,
            settings.commit_iterations,
        )  # fmt: skip
        if tried.cost < found.cost - settings.adopt_gain:
            found = tried
    return found


def unturned_groups(found: Solved) -> list[tuple[int, ...]]:
    """Return the chains, by index, of each group tied by places in common that knows no heading.

    Of who is alone so, and is not held to an axis, clouds tell more than one turn does.
    """
    assembled = found.assembled
    if all(turn_known(chain.starts[0]) for chain in assembled.chains):
        return []
    group = _groups(assembled)
    members: dict[int, list[int]] = {}
    for index, leader in enumerate(group):
        members.setdefault(leader, []).append(index)
    return [
        tuple(each)
        for each in members.values()
        if not any(turn_known(start) for i in each for start in assembled.chains[i].starts)
        and (len(each) > 1 or assembled.chains[each[0]].last_unit_name in found.belief.units)
    ]


def _groups(assembled: Assembled) -> list[int]:
    """Return of each chain the first one that it is tied to by places that nobody knew before."""
    graph = assembled.graph
    place = (graph.tie_at[:, 1] - assembled.place_column(0)) // 2
    of_chain = np.searchsorted(graph.first, graph.tie_at[:, 0], side="right") - 1
    unknown = graph.place[place, 2] >= UNKNOWN_SD_M
    group = list(range(len(assembled.chains)))
    first_at: dict[int, int] = {}
    for chain, at in zip(of_chain[unknown].tolist(), place[unknown].tolist(), strict=True):
        one, other = group[chain], group[first_at.setdefault(at, chain)]
        group = [min(one, other) if each in (one, other) else each for each in group]
    return group


def _turns(found: Solved, group: tuple[int, ...], settings: TeamSettings, iterations: int) -> Turns:
    """Return the group's turns by how likely they are, the first as it was found."""
    assembled = found.assembled
    unit_row, node = _gauge(assembled, group)
    places = _places_of(assembled, group)
    tried = []
    for step in range(WAYS):
        turn_rad = wrap_rad(step * SPACING_RAD)
        pose, arrow = _turned_whole(found, group, places, node, turn_rad)
        turn = assembled.graph.turn.copy()
        turn[unit_row] = pose[node, 2], WIDTH_RAD
        told = replace(assembled, graph=assembled.graph._replace(turn=turn))
        tried.append(solved_from(told, pose, arrow, found.belief, settings, iterations, ENDS_ONLY))
    least = min(each.cost for each in tried)
    if not math.isfinite(least):
        return Turns(group, ())
    odds = [_exponential(0.5 * (least - each.cost)) if each.is_sound else 0.0 for each in tried]
    total = math.fsum(each for each in odds if each >= LEAST_SHARE)
    ways = tuple(
        (each / total, way) for each, way in zip(odds, tried, strict=True) if each >= LEAST_SHARE
    )
    return Turns(group, ways)


def _exponential(number: float) -> float:
    """Return e to the power of ``number``, from -20 to 0 to 1e-12 of it; nought of what is less.

    A thousandth part of it by its series, squared ten times over.
    """
    if number < -20.0:
        return 0.0
    part = number / 1024.0
    power = 1.0 + part * (1.0 + part / 2.0 * (1.0 + part / 3.0 * (1.0 + part / 4.0 * (
        1.0 + part / 5.0 * (1.0 + part / 6.0)))))  # fmt: skip
    for _ in range(10):
        power *= power
    return power


def _gauge(assembled: Assembled, group: Sequence[int]) -> tuple[int, int]:
    """Return which unit's turn stands for the group's: its row of starts, and its first node.

    It is that which went the longest way.
    """
    units = []
    for index in group:
        nodes, chain = assembled.nodes[index], assembled.chains[index]
        counts = np.bincount(chain.unit[nodes], minlength=len(chain.starts))
        unit = int(counts.argmax())
        at = int(np.searchsorted(nodes, chain.begin_of(unit)))
        first = int(assembled.graph.first[index]) + at
        units.append((int(counts[unit]), -index, assembled.unit_first[index] + unit, first))
    _, _, row, node = max(units)
    return row, node


def _places_of(assembled: Assembled, group: Sequence[int]) -> Ints:
    """Return the arrow's columns (p,) of the places that a group alone knows of."""
    graph = assembled.graph
    of_chain = np.searchsorted(graph.first, graph.tie_at[:, 0], side="right") - 1
    columns = np.unique(graph.tie_at[np.isin(of_chain, group), 1])
    place = (columns - assembled.place_column(0)) // 2
    return np.asarray(columns[graph.place[place, 2] >= UNKNOWN_SD_M], np.int64)


def _turned_whole(
    found: Solved, group: Sequence[int], places: Ints, node: int, turn_rad: float
) -> tuple[Floats, Floats]:
    """Return poses and arrow with a group's ways and places turned as one, about a node."""
    pose, arrow = found.pose.copy(), found.arrow.copy()
    pivot = found.pose[node, :2].tolist()
    cosine, sine = rotated(turn_rad, 1.0, 0.0)
    for index in group:
        own = slice(*found.assembled.graph.first[index : index + 2].tolist())
        off_m = pose[own, :2] - pivot
        pose[own, 0] = pivot[0] + cosine * off_m[:, 0] - sine * off_m[:, 1]
        pose[own, 1] = pivot[1] + sine * off_m[:, 0] + cosine * off_m[:, 1]
        pose[own, 2] += turn_rad
    north, east = arrow[places] - pivot[0], arrow[places + 1] - pivot[1]
    arrow[places] = pivot[0] + cosine * north - sine * east
    arrow[places + 1] = pivot[1] + sine * north + cosine * east
    if found.belief.mode == "free" and len(group) == len(found.assembled.chains):
        arrow[AXIS] += turn_rad
    return pose, arrow


def _widen(found: Solved, turns: Turns, ends: Floats, shared: Floats) -> None:
    """Have ``ends`` and ``shared`` tell how a group's ends and places differ, all turns together.

    They are mean squares about ``found``.
    """
    places = _places_of(found.assembled, turns.chains)
    for index in turns.chains:
        ends[index] = 0.0
        end = int(found.assembled.graph.first[index + 1]) - 1
        for share, way in turns.ways:
            n, e, turn = (way.pose[end] - found.pose[end]).tolist()
            turn = wrap_rad(turn)
            apart = np.array([n * n, n * e, e * e, turn * turn, n * turn, e * turn])
            ends[index] += share * (way.ends[index] + apart)
    for column in places.tolist():
        both = slice(column, column + 2)
        shared[both, both] = 0.0
        for share, way in turns.ways:
            off_m = way.arrow[both] - found.arrow[both]
            shared[both, both] += share * (way.shared[both, both] + np.outer(off_m, off_m))
