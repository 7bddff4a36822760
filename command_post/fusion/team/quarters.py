"""Ways in which a map held to an axis may lie: turned by right angles, or along none (pure).

An axis is alike modulo a right angle. Headings that are known to 30 degrees tell which of four ways
it is as to one in seven of those who are alone, and better of those whom places in common tie
together; and whether there is an axis at all legs along one corridor leave open. The smoother
settles on one way, and is as sure of it as if there were no other: each other one is told with it,
by how likely it is. Each is solved by itself, for which of a crew of a large team there is no time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

from command_post.fusion.team.arithmetic import exponential
from command_post.fusion.team.assembly import AxisBelief, Rival
from command_post.fusion.team.chain import KNOWN_TURN_SD_RAD
from command_post.fusion.team.graph import AXIS
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solving import QUARTERS_RAD, Solved, Turns, solved_from
from command_post.fusion.team.unturned import gauge, tied_groups
from command_post.fusion.team.whole_turns import spread_over, turned_as_one, with_turns
from shared.maths.angles import wrap_rad

LEAST_SHARE = 0.03
"""What is less likely is left out: a region holds 95 % without it, and outlines take long."""
MOST_COST = -2.0 * math.log(LEAST_SHARE)


_Way: TypeAlias = tuple[float, Solved]
"""How likely it is that a map lies so."""


class _Quarter(NamedTuple):
    """A group's map turned by a right angle, and what that costs beyond what is found."""

    solved: Solved
    cost: float


def with_likeliest_quarter(found: Solved, settings: TeamSettings) -> Solved:
    """Return the solution with each group turned by the right angles that suit it best.

    It is ``found`` itself if no other is better by as much as another heading has to be.
    """
    for group in _groups(found, settings):
        for quarter in _quarters(found, group, settings, settings.commit_iterations):
            if quarter.cost < -settings.adopt_gain:
                found = quarter.solved
                break
    return found


def with_all_ways(
    found: Solved, settings: TeamSettings, iterations: int, *, is_everybody: bool
) -> Solved:
    """Return a crew's solution with all ways that its map may lie.

    Of one that is not everybody they are those alone in which no heading is known.
    """
    turned = with_turns(found, settings, iterations)
    return with_other_ways(turned, settings, iterations) if is_everybody else turned


def with_other_ways(found: Solved, settings: TeamSettings, iterations: int) -> Solved:
    """Return a solution with all ways that its map may lie otherwise, if there may be an axis.

    Ends and places are as uncertain as these differ. It is ``found`` itself if there is no other.
    """
    groups = _groups(found, settings)
    if not groups:
        return found
    believed = _believed(found, settings)
    way = found
    for group in groups:
        ways = [
            each
            for share, solved in believed
            for each in _with_quarters(share, solved, group, settings, iterations)
            if each[1] is found or each[0] > LEAST_SHARE
        ]
        if len(ways) > 1:
            total = math.fsum(share for share, _ in ways)
            shared = tuple((share / total, solved) for share, solved in ways)
            way = spread_over(way, Turns(group, shared))
    return way


def _believed(found: Solved, settings: TeamSettings) -> list[_Way]:
    """Return the solution and what it is under each other belief, with how likely these are."""
    rivals = [each for each in found.belief.rivals if each.share > LEAST_SHARE]
    own = (1.0 - math.fsum(each.share for each in rivals), found)
    others = [(each.share, _believing(found, each, settings)) for each in rivals]
    return [own, *(way for way in others if way[1].is_sound)]


def _with_quarters(
    share: float, solved: Solved, group: tuple[int, ...], settings: TeamSettings, iterations: int
) -> list[_Way]:
    """Return the ways that a group's map may lie under a belief of that ``share``."""
    belief, everybody = solved.belief, len(solved.assembled.chains)
    if belief.mode == "free" and len(group) == everybody:
        return [(share, solved)]
    quarters = _quarters(solved, group, settings, iterations)
    odds = [exponential(-0.5 * max(each.cost, 0.0)) for each in quarters]
    own = share / (1.0 + math.fsum(odds))
    others = [(own * odd, each.solved) for odd, each in zip(odds, quarters, strict=True)]
    return [(own, solved), *others]


def _groups(found: Solved, settings: TeamSettings) -> list[tuple[int, ...]]:
    """Return the groups that may be held to an axis, but for those whose turns are told already."""
    if found.belief.mode == "none" and all(r.share <= LEAST_SHARE for r in found.belief.rivals):
        return []
    told = {index for turns in found.turns for index in turns.chains}
    sharp_rad2 = settings.recovered_turn_sd_rad**2
    return [
        group
        for group in tied_groups(found.assembled)
        if told.isdisjoint(group) and any(float(found.ends[i, 3]) < sharp_rad2 for i in group)
    ]


def _quarters(
    found: Solved, group: Sequence[int], settings: TeamSettings, iterations: int
) -> list[_Quarter]:
    """Return a group's map turned by right angles, as far as headings leave that possible."""
    _, node = gauge(found.assembled, group)
    quarters = []
    for turn_rad in QUARTERS_RAD if found.belief.mode != "none" else ():
        if _cost_of_headings(found, group, turn_rad) > MOST_COST:
            continue
        pose, arrow = turned_as_one(found, tuple(group), node, turn_rad)
        solved = solved_from(found.assembled, pose, arrow, found.belief, settings, iterations)
        if solved.is_sound and solved.cost < found.cost + MOST_COST:
            quarters.append(_Quarter(solved, solved.cost - found.cost))
    return sorted(quarters, key=lambda each: each.cost)


def _cost_of_headings(found: Solved, group: Sequence[int], turn_rad: float) -> float:
    """Return how much more what is known of a group's headings costs if all of it is turned."""
    return math.fsum(
        (wrap_rad(off_rad + turn_rad) ** 2 - off_rad**2) / (sd_rad * sd_rad)
        for off_rad, sd_rad in _headings(found, group)
    )


def _headings(found: Solved, group: Sequence[int]) -> Iterator[tuple[float, float]]:
    """Yield how far units of a group are turned off what is known of it, and how surely (rad)."""
    graph = found.assembled.graph
    for index in group:
        first, end = graph.first[index : index + 2].tolist()
        for (told_rad, sd_rad), node in zip(
            graph.turn.tolist(), graph.turn_at.tolist(), strict=True
        ):
            if first <= node < end and sd_rad < KNOWN_TURN_SD_RAD:
                yield wrap_rad(float(found.pose[node, 2]) - told_rad), sd_rad


def _believing(found: Solved, rival: Rival, settings: TeamSettings) -> Solved:
    """Return the solution as it is under another belief of the building's axis."""
    belief = AxisBelief(rival.mode, rival.axis_rad, rival.sd_rad, found.belief.units)
    begin = found
    if found.belief.mode == "given" and rival.mode != "given":
        for group in tied_groups(found.assembled):
            begin = _as_headings_have_it(begin, group)
    pose, arrow = begin.pose.copy(), begin.arrow.copy()
    arrow[AXIS] = rival.axis_rad
    return solved_from(
        found.assembled.believing(belief, settings), pose, arrow, belief, settings,
        settings.commit_iterations,
    )  # fmt: skip


def _as_headings_have_it(found: Solved, group: tuple[int, ...]) -> Solved:
    """Return the solution with a group's map turned as one, as suits what is known of headings."""
    headings = list(_headings(found, group))
    known = math.fsum(1.0 / sd_rad**2 for _, sd_rad in headings)
    if known == 0.0:
        return found
    turn_rad = -math.fsum(off_rad / sd_rad**2 for off_rad, sd_rad in headings) / known
    _, node = gauge(found.assembled, group)
    pose, arrow = turned_as_one(found, group, node, turn_rad)
    return found._replace(pose=pose, arrow=arrow)
