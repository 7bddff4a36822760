"""Ways in which a map may be turned that nobody's heading tells the turn of (pure).

Passes tell how responders stand to each other and to DAPs, not how all of it lies. If none of those
whom places in common tie together ever knew a heading, the smoother settles on one turn of them
all, and is as sure of it as if there were no other. What is known of the turn beforehand, that any
is as likely, is nearly a sum of Gaussians, ``SPACING_RAD`` apart (Alspach and Sorenson 1972,
"Nonlinear Bayesian estimation using Gaussian sum approximations"). Under each the team is solved by
itself, and what that costs says how likely it is: of none there remains a ring, of a building's
axis four turns, and one of anything that tells where somebody or something is.
"""

from __future__ import annotations

import math

import numpy as np

from command_post.fusion.team.arithmetic import exponential, rotated
from command_post.fusion.team.graph import AXIS
from command_post.fusion.team.move_log import Floats
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solving import GAUGE_SD_RAD, Solved, Turns, solved_from
from command_post.fusion.team.unturned import columns_of, gauge, turned_to, unturned_groups
from shared.maths.angles import wrap_rad

WAYS = 16
SPACING_RAD = 2.0 * math.pi / WAYS
"""Gaussians of ``GAUGE_SD_RAD``, so far apart, sum up to the same everywhere to a thousandth."""
LEAST_SHARE = 1e-3
"""What is less likely is left out."""


def with_turns(found: Solved, settings: TeamSettings, iterations: int) -> Solved:
    """Return a solution with all ways in which groups that know no heading may be turned.

    Such a group's ways and places are those of one turn, ends and places as uncertain as turns
    differ. It is ``found`` itself if there is no such group.
    """
    groups = _groups(found)
    for group in groups:
        turns = _turns(found, group, settings, iterations)
        if turns.ways:
            found = spread_over(found, turns)
    return found


def likeliest(found: Solved, settings: TeamSettings) -> Solved:
    """Return the solution with each group that knows no heading turned as suits it best.

    It is ``found`` itself if no turn is better by as much as another heading has to be.
    """
    for group in _groups(found):
        for _, way in _turns(found, group, settings, settings.commit_iterations).ways[:1]:
            tried = solved_from(
                found.assembled, way.pose.copy(), way.arrow.copy(), found.belief, settings,
                settings.commit_iterations,
            )  # fmt: skip
            if tried.cost < found.cost - settings.adopt_gain:
                found = tried
    return found


def _groups(found: Solved) -> list[tuple[int, ...]]:
    """Return the groups whose turns are to be told.

    Of who is alone, and is not held to an axis, a cloud of headings tells more.
    """
    return [
        group
        for group in unturned_groups(found.assembled)
        if len(group) > 1 or found.assembled.chains[group[0]].last_unit_name in found.belief.units
    ]


def _turns(found: Solved, group: tuple[int, ...], settings: TeamSettings, iterations: int) -> Turns:
    """Return a group's turns, first that which is found, or the likeliest if it is far likelier."""
    row, node = gauge(found.assembled, group)
    tried = []
    for step in range(WAYS):
        pose, arrow = turned_as_one(found, group, node, wrap_rad(step * SPACING_RAD))
        told = turned_to(found.assembled, row, float(pose[node, 2]), GAUGE_SD_RAD)
        tried.append(solved_from(told, pose, arrow, found.belief, settings, iterations))
    tried = [way for way in tried if way.is_sound]
    if not tried:
        return Turns(group, ())
    least = min(way.cost for way in tried)
    first = tried[0]
    if first.cost > least + settings.adopt_gain:
        first = next(way for way in tried if way.cost == least)
    odds = [exponential(0.5 * (least - way.cost)) for way in tried]
    total = math.fsum(each for each in odds if each >= LEAST_SHARE)
    ways = [(each / total, w) for each, w in zip(odds, tried, strict=True) if each >= LEAST_SHARE]
    return Turns(group, tuple(sorted(ways, key=lambda way: way[1] is not first)))


def turned_as_one(
    found: Solved, group: tuple[int, ...], node: int, turn_rad: float
) -> tuple[Floats, Floats]:
    """Return poses and arrow with a group's ways and places turned as one, about a node."""
    pose, arrow = found.pose.copy(), found.arrow.copy()
    pivot_m = found.pose[node, :2]
    cosine, sine = rotated(turn_rad, 1.0, 0.0)

    def turned(place_m: Floats) -> Floats:
        north, east = (place_m - pivot_m).T
        return np.asarray(pivot_m + np.column_stack([
            cosine * north - sine * east, sine * north + cosine * east
        ]))  # fmt: skip

    for index in group:
        own = slice(*found.assembled.graph.first[index : index + 2].tolist())
        pose[own, :2] = turned(pose[own, :2])
        pose[own, 2] += turn_rad
    _, places = columns_of(found.assembled, group)
    both = places[:, None] + np.arange(2)
    arrow[both] = turned(arrow[both])
    if found.belief.mode == "free" and len(group) == len(found.assembled.chains):
        arrow[AXIS] += turn_rad
    return pose, arrow


def spread_over(found: Solved, turns: Turns) -> Solved:
    """Return a solution with a group's ways and places as its first turn has them.

    Covariances of ends and places are mean squares about these.
    """
    pose, arrow = found.pose.copy(), found.arrow.copy()
    ends, shared = found.ends.copy(), found.shared.copy()
    _, first = turns.ways[0]
    for index in turns.chains:
        own = slice(*found.assembled.graph.first[index : index + 2].tolist())
        pose[own] = first.pose[own]
        ends[index] = 0.0
        for share, way in turns.ways:
            n, e, turn = (way.pose[own.stop - 1] - first.pose[own.stop - 1]).tolist()
            turn = wrap_rad(turn)
            apart = np.array([n * n, n * e, e * e, turn * turn, n * turn, e * turn])
            ends[index] += share * (way.ends[index] + apart)
    units, places = columns_of(found.assembled, turns.chains)
    arrow[units] = first.arrow[units]
    for column in places.tolist():
        both = slice(column, column + 2)
        arrow[both] = first.arrow[both]
        shared[both, both] = 0.0
        for share, way in turns.ways:
            off_m = way.arrow[both] - first.arrow[both]
            shared[both, both] += share * (way.shared[both, both] + np.outer(off_m, off_m))
    return found._replace(
        pose=pose, arrow=arrow, ends=ends, shared=shared, turns=(*found.turns, turns)
    )
