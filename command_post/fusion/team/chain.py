"""One responder's moves as a chain of stances, and which of them become nodes (pure)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.log import ResponderLog, Start
from command_post.fusion.team.move_log import (
    DOWN,
    DOWN_M2,
    EAST,
    NORTH,
    PLACE_M2,
    TURN_RAD2,
    Floats,
    Ints,
    Moves,
)
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.unheard import NOTHING_UNHEARD, Unheard, lost_since_m2
from command_post.fusion.team.unseen import Unseen, unseen_before
from shared.compiled import compiled
from shared.units import NS_PER_S

PACE_S = 1.5
LEAST_AHEAD_M = 0.3
"""A shorter stride does not tell which way its wearer goes."""
MOVE, BEGINNING, UNHEARD = range(3)
"""What a stance is: the end of a move, a unit's beginning, or what others alone tell of."""
NEVER_NS = -1
KNOWN_TURN_SD_RAD = 1.5
"""A heading known no better than this is not known."""


UnitName: TypeAlias = tuple[str, int]
"""Whose unit, and when it began: nought for the first that there is, wherever a way is taken up."""


class Chain(NamedTuple):
    """A responder's stances (k ≥ 1): the start, the end of each move, the start of each new unit.

    And where others told of them of whom nobody knew where they went (``unheard``, by stance).

    ``way_m`` (k, 2) is the sum of the moves in the agents' frames, ``length_m`` (k,) their lengths
    summed, ``variance`` (k, 2) those of place (m²) and turn (rad²). ``rise`` (k, 2) sums ways down
    (m) and their variances (m²). ``unit`` (k,) counts the units; ``links`` are the stances at which
    a new unit begins, ``starts`` what each unit said.
    """

    responder_id: str
    time_ns: Ints
    begin_ns: Ints
    way_m: Floats
    length_m: Floats
    variance: Floats
    rise: Floats
    unit: Ints
    links: Ints
    unheard: Ints
    starts: list[Start]

    def begin_of(self, unit: int) -> int:
        """Return the stance at which a unit begins."""
        return 0 if unit == 0 else int(self.links[unit - 1])

    def unit_name(self, unit: int) -> UnitName:
        """Return what a unit is known by from one solution to the next."""
        return self.responder_id, self.starts[unit].time_ns if unit else 0

    @property
    def ends_unheard(self) -> bool:
        """Whether others alone tell where it ends."""
        return self.unheard.size > 0 and int(self.unheard[-1]) == self.time_ns.size - 1

    @property
    def leaps(self) -> Ints:
        """The stances that nobody knows the way to."""
        return np.sort(np.concatenate([self.links, self.unheard]))

    @property
    def last_unit_name(self) -> UnitName:
        """The name of the unit that the chain goes on in."""
        return self.unit_name(int(self.unit[-1]))

    def nearest(self, time_ns: int) -> tuple[int, float, float]:
        """Return the stance nearest in time, and how far in the agent's frame it was from there.

        Between two stances the body goes on evenly while the move lasts, and stands before it.
        """
        (stance,), (offset_m,) = self.nearest_each(np.array([time_ns]))
        north_m, east_m = offset_m.tolist()
        return int(stance), north_m, east_m

    def nearest_each(self, time_ns: Ints) -> tuple[Ints, Floats]:
        """Return the same of several times (n,): stances (n,), and how far from there (n, 2)."""
        return _nearest(self.time_ns, self.begin_ns, self.way_m, time_ns)

    def ahead(self, time_ns: int) -> tuple[float, float]:
        """Return which way the body last went by then: north, east, of length 1; nought if none."""
        stance = int(np.searchsorted(self.time_ns, time_ns, side="right"))
        for end in range(min(stance, self.time_ns.size - 1), 0, -1):
            north_m, east_m = (self.way_m[end] - self.way_m[end - 1]).tolist()
            length_m = math.sqrt(north_m * north_m + east_m * east_m)
            if length_m > LEAST_AHEAD_M:
                return north_m / length_m, east_m / length_m
        return 0.0, 0.0

    def velocity_m_s(self, time_ns: Ints) -> Floats:
        """Return how fast the body then went (n, 2), north and east in the agent's frame.

        It is the mean over ``PACE_S``: a boot swings and stands while the body goes on evenly.
        """
        half_ns = round(0.5 * PACE_S * NS_PER_S)
        return _gone_m(self.time_ns, self.begin_ns, self.way_m, time_ns, half_ns) / PACE_S


@compiled
def _nearest(time_ns: Ints, begin_ns: Ints, way_m: Floats, at_ns: Ints) -> tuple[Ints, Floats]:
    """Return what ``Chain.nearest_each`` does, of ``at_ns``."""
    stances, offset_m = np.zeros(at_ns.size, np.int64), np.zeros((at_ns.size, 2))
    for k in range(at_ns.size):
        after = int(np.searchsorted(time_ns, at_ns[k]))
        stances[k] = max(after - 1, 0)
        if not 0 < after < time_ns.size:
            continue
        took_ns = max(time_ns[after] - begin_ns[after], 1)
        share = min(max((at_ns[k] - begin_ns[after]) / took_ns, 0.0), 1.0)
        if share >= 0.5:
            stances[k] = after
            share = -(1.0 - share)
        for axis in range(2):
            offset_m[k, axis] = share * (way_m[after, axis] - way_m[after - 1, axis])
    return stances, offset_m


@compiled
def _gone_m(time_ns: Ints, begin_ns: Ints, way_m: Floats, at_ns: Ints, half_ns: int) -> Floats:
    """Return how far the body went (n, 2) from ``half_ns`` before each time until as long after.

    The body goes on evenly from each move's beginning to its end.
    """
    knots_ns = np.empty(2 * time_ns.size)
    last_ns = begin_ns[0]
    for stance in range(time_ns.size):
        last_ns = max(last_ns, begin_ns[stance])
        knots_ns[2 * stance] = last_ns
        last_ns = max(last_ns, time_ns[stance])
        knots_ns[2 * stance + 1] = last_ns
    gone_m = np.empty((at_ns.size, 2))
    for k in range(at_ns.size):
        after_n, after_e = _way_at(knots_ns, way_m, float(at_ns[k] + half_ns))
        before_n, before_e = _way_at(knots_ns, way_m, float(at_ns[k] - half_ns))
        gone_m[k] = after_n - before_n, after_e - before_e
    return gone_m


@compiled
def _way_at(knots_ns: Floats, way_m: Floats, at_ns: float) -> tuple[float, float]:
    """Return the way gone by then; each stance has two knots, its move's beginning and its end."""
    at = int(np.searchsorted(knots_ns, at_ns, side="right")) - 1
    stance = max(at, 0) // 2
    is_going = stance > 0 and at % 2 == 0
    from_stance = stance - 1 if is_going else stance
    north_m, east_m = way_m[from_stance, 0], way_m[from_stance, 1]
    if not is_going or knots_ns[at] == at_ns:
        return north_m, east_m
    took_ns, since_ns = knots_ns[at + 1] - knots_ns[at], at_ns - knots_ns[at]
    return (
        (way_m[stance, 0] - north_m) / took_ns * since_ns + north_m,
        (way_m[stance, 1] - east_m) / took_ns * since_ns + east_m,
    )


def chain_of(
    responder_id: str, log: ResponderLog, until_ns: int, settings: TeamSettings,
    unheard: Unheard = NOTHING_UNHEARD,
) -> Chain | None:  # fmt: skip
    """Return the responder's chain as heard of by ``until_ns``; ``None`` if nothing was."""
    starts = log.starts_until(until_ns)
    if not starts:
        return None
    moves = log.moves.until(until_ns)
    unseen = unseen_before(moves, settings)
    added_ns = np.array([start.time_ns for start in starts], np.int64)
    if unheard.time_ns.size:
        unseen = unseen._replace(place_m2=lost_since_m2(unseen.place_m2, moves, unheard))
        added_ns = np.concatenate([added_ns, unheard.time_ns])
    own = _Own(
        settings.restart_sd_m**2, settings.restart_speed_m_s, settings.restart_climb_share**2,
        settings.stride_sd_m, settings.stride_sd_share, settings.told_turn_factor**2,
        settings.stride_turn_sd_rad**2,
    )  # fmt: skip
    count = added_ns.size + moves.end_ns.size
    time_ns, begin_ns, unit, added = np.empty((4, count), np.int64)
    sums = _Sums(*(np.empty((count, width)) for width in (2, 1, 2, 2)))
    order = np.argsort(added_ns, kind="stable")
    _lay_out(
        moves, unseen, added_ns, unheard.gone_m, order, own,
        (time_ns, begin_ns, unit, added), sums,
    )  # fmt: skip
    return Chain(
        responder_id, time_ns, begin_ns, sums.way_m, sums.length_m.ravel(), sums.variance,
        sums.rise, unit, np.flatnonzero(added == BEGINNING)[1:], np.flatnonzero(added == UNHEARD),
        starts,
    )  # fmt: skip


class _Own(NamedTuple):
    """What an agent cannot know of itself, as the settings have it: see ``TeamSettings``."""

    restart_m2: float
    restart_speed_m_s: float
    restart_climb_share2: float
    stride_sd_m: float
    stride_sd_share: float
    told_turn_factor2: float
    stride_turn_rad2: float


class _Sums(NamedTuple):
    """What ``Chain`` sums up, by stance: its fields of these names, lengths as (k, 1)."""

    way_m: Floats
    length_m: Floats
    variance: Floats
    rise: Floats


@compiled
def _lay_out(
    moves: Moves, unseen: Unseen, added_ns: Ints, gone_m: Floats, order: Ints, own: _Own,
    stances: tuple[Ints, Ints, Ints, Ints], sums: _Sums,
) -> None:  # fmt: skip
    """Write a chain's stances by time, those ``added`` before what ends at the same time.

    Added are beginnings of units, and behind these the times that others told of who was silent,
    who may have gone ``gone_m`` since seen before; ``order`` is that of their times. ``stances``
    are ``Chain.time_ns``, ``begin_ns`` and ``unit``, and what each stance is.
    """
    times_ns, since_ns, units, kinds = stances
    begun = added_ns.size - gone_m.size
    total = np.zeros(7)
    at = unit = 0
    for stance in range(times_ns.size):
        moved = stance - at
        is_move = at == order.size or (
            moved < moves.end_ns.size and added_ns[order[at]] > moves.end_ns[moved]
        )
        if is_move:
            times_ns[stance], since_ns[stance] = moves.end_ns[moved], unseen.since_ns[moved]
            kinds[stance] = MOVE
            _add_move(total, moves, unseen, moved, own)
        else:
            which = order[at]
            at += 1
            times_ns[stance] = since_ns[stance] = added_ns[which]
            if which < begun:
                kinds[stance], unit = BEGINNING, max(unit, which)
                _add_beginning(total, moves, added_ns, begun, which, own)
            else:
                # It is reached as it is told of: what is told then is told of it.
                kinds[stance], since_ns[stance] = UNHEARD, added_ns[which] - 1
                gone = gone_m[which - begun]
                total[2] += gone
                total[3] += gone * gone
                total[6] += gone * gone * own.restart_climb_share2
        units[stance] = unit
        sums.way_m[stance] = total[0:2]
        sums.length_m[stance] = total[2:3]
        sums.variance[stance] = total[3:5]
        sums.rise[stance] = total[5:7]


@compiled
def _add_beginning(
    total: Floats, moves: Moves, added_ns: Ints, begun: int, unit: int, own: _Own
) -> None:
    """Add a unit's beginning: before, its wearer may have gone anywhere they could reach."""
    if unit == 0:
        return
    time_ns = added_ns[unit]
    last = int(np.searchsorted(moves.end_ns, time_ns, side="right")) - 1
    seen_ns = moves.end_ns[last] if last >= 0 else NEVER_NS
    for told_ns in added_ns[begun:]:
        if seen_ns < told_ns <= time_ns:
            seen_ns = told_ns
    silent_s = (time_ns - seen_ns) / NS_PER_S if seen_ns > NEVER_NS else 0.0
    gone_m = own.restart_speed_m_s * silent_s
    gone_m2 = own.restart_m2 + gone_m * gone_m
    total[3] += gone_m2
    total[6] += gone_m2 * own.restart_climb_share2


@compiled
def _add_move(total: Floats, moves: Moves, unseen: Unseen, k: int, own: _Own) -> None:
    """Add a move, with variances that allow for what an agent cannot know of itself."""
    values, unseen_m = moves.values[k], unseen.way_m[k]
    length_m = math.hypot(values[NORTH], values[EAST])
    own_m = own.stride_sd_m + own.stride_sd_share * length_m
    told_rad2 = own.told_turn_factor2 * values[TURN_RAD2]
    total[0] += values[NORTH] + unseen_m[0]
    total[1] += values[EAST] + unseen_m[1]
    total[2] += length_m + math.hypot(unseen_m[0], unseen_m[1])
    total[3] += values[PLACE_M2] + own_m * own_m + unseen.place_m2[k]
    total[4] += told_rad2 + own.stride_turn_rad2 + unseen.turn_rad2[k]
    total[5] += values[DOWN] + unseen_m[2]
    total[6] += values[DOWN_M2] + unseen.down_m2[k]


def straight_moves(
    chain: Chain, nodes: Ints, held: AbstractSet[UnitName], settings: TeamSettings
) -> tuple[Ints, Floats]:
    """Return which moves from node to node are straight, and their directions (rad).

    Directions are in the unit's frame; moves are those of units in ``held`` alone.
    """
    is_held = np.array([chain.unit_name(unit) in held for unit in range(len(chain.starts))])
    return _straight(
        chain.way_m, chain.length_m, chain.unit, nodes, is_held,
        settings.straight_least_m, settings.straight_share,
    )  # fmt: skip


@compiled
def _straight(
    way_m: Floats, length_m: Floats, unit: Ints, nodes: Ints, is_held: NDArray[np.bool_],
    least_m: float, share: float,
) -> tuple[Ints, Floats]:  # fmt: skip
    """Return which moves are straight, of those of held units, and their directions (rad)."""
    found, direction_rad = np.empty(nodes.size, np.int64), np.empty(nodes.size)
    count = 0
    for move in range(nodes.size - 1):
        one, other = nodes[move], nodes[move + 1]
        north_m, east_m = way_m[other, 0] - way_m[one, 0], way_m[other, 1] - way_m[one, 1]
        straight_m = math.sqrt(north_m * north_m + east_m * east_m)
        is_straight = straight_m >= share * (length_m[other] - length_m[one])
        if straight_m > least_m and is_straight and is_held[unit[other]]:
            found[count], direction_rad[count] = move, math.atan2(east_m, north_m)
            count += 1
    return found[:count].copy(), direction_rad[:count].copy()


@compiled
def place_nodes(time_ns: Ints, length_m: Floats, wanted: Ints, node_m: float, node_ns: int) -> Ints:
    """Return the stances that become nodes: those wanted (ascending), and no two far apart."""
    nodes = np.empty(time_ns.size, np.int64)
    nodes[0] = wanted[0]
    count = 1
    for target in wanted[1:]:
        stance = nodes[count - 1]
        while stance < target:
            first = stance
            stance += 1
            while (
                stance < target
                and length_m[stance] - length_m[first] < node_m
                and time_ns[stance] - time_ns[first] < node_ns
            ):
                stance += 1
            nodes[count] = stance
            count += 1
    return nodes[:count].copy()


def turn_known(start: Start) -> bool:
    """Whether a unit knows how its frame is turned."""
    return start.heading_sd_rad < KNOWN_TURN_SD_RAD and math.isfinite(start.heading_sd_rad)


def unit_sd(chains: Sequence[Chain], settings: TeamSettings) -> Floats:
    """Return (2 U,) what is known beforehand of each unit's scale and drift."""
    return np.array([
        sd
        for chain in chains
        for start in chain.starts
        for sd in (
            settings.loose_scale_sd if start.is_loose else settings.scale_sd,
            settings.drift_sd_rad_s,
        )
    ])  # fmt: skip
