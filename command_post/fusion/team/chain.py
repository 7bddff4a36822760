"""One responder's moves as a chain of stances, and which of them become nodes (pure)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from typing import NamedTuple, TypeAlias

import numpy as np

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
    added = _added_rows(moves, starts, unheard, settings)
    order = np.argsort(np.concatenate([added.time_ns, moves.end_ns]), kind="stable")
    # Mostly all starts are before all moves.
    is_ordered = bool((order[1:] > order[:-1]).all())
    unseen = unseen_before(moves, settings)
    if unheard.time_ns.size:
        unseen = unseen._replace(place_m2=lost_since_m2(unseen.place_m2, moves, unheard))
    own = _move_rows(moves, unseen, settings)

    def merged(one: Floats | Ints, other: Floats | Ints) -> Floats:
        both = np.concatenate([one, other])
        return np.asarray(both if is_ordered else both[order])

    count = added.time_ns.size
    nowhere = np.zeros(unheard.time_ns.size)
    unit_of_row = merged(
        np.concatenate([np.arange(len(starts)), nowhere]), np.zeros(moves.end_ns.size)
    ).astype(np.int64)
    return Chain(
        responder_id,
        time_ns=merged(added.time_ns, moves.end_ns).astype(np.int64),
        begin_ns=merged(added.begin_ns, unseen.since_ns).astype(np.int64),
        way_m=np.cumsum(merged(np.zeros((count, 2)), own.step_m), axis=0),
        length_m=np.cumsum(merged(added.length_m, own.length_m)),
        variance=np.cumsum(merged(added.variance, own.variance), axis=0),
        rise=np.cumsum(merged(added.rise, own.rise), axis=0),
        unit=np.maximum.accumulate(unit_of_row),
        links=np.flatnonzero(order < len(starts))[1:],
        unheard=np.flatnonzero((order >= len(starts)) & (order < count)),
        starts=starts,
    )


class _Added(NamedTuple):
    time_ns: Ints
    begin_ns: Ints
    length_m: Floats
    variance: Floats
    rise: Floats


class _Rows(NamedTuple):
    step_m: Floats
    length_m: Floats
    variance: Floats
    rise: Floats


def _added_rows(
    moves: Moves, starts: list[Start], unheard: Unheard, settings: TeamSettings
) -> _Added:
    """One row a unit: while nobody counted, its wearer may have gone anywhere they could reach.

    Behind these, one each time that others told of who was silent.
    """
    time_ns = np.array([start.time_ns for start in starts], np.int64)
    seen_ns = np.sort(np.concatenate([moves.end_ns, unheard.time_ns]))
    last = np.searchsorted(seen_ns, time_ns, side="right") - 1
    silent_s = (
        np.where(last >= 0, time_ns - seen_ns[np.maximum(last, 0)], 0) / NS_PER_S
        if seen_ns.size
        else np.zeros(len(starts))
    )
    gone_m2 = settings.restart_sd_m**2 + (settings.restart_speed_m_s * silent_s) ** 2
    gone_m2[0] = 0.0
    gone_m2 = np.concatenate([gone_m2, unheard.gone_m**2])
    nothing = np.zeros(gone_m2.size)
    climbed_m2 = gone_m2 * settings.restart_climb_share**2
    # Each such stance is reached as it is told of: what is told then is told of it.
    return _Added(
        np.concatenate([time_ns, unheard.time_ns]),
        np.concatenate([time_ns, unheard.time_ns - 1]),
        np.concatenate([np.zeros(len(starts)), unheard.gone_m]),
        np.column_stack([gone_m2, nothing]), np.column_stack([nothing, climbed_m2]),
    )  # fmt: skip


def _move_rows(moves: Moves, unseen: Unseen, settings: TeamSettings) -> _Rows:
    """One row a move, with variances that allow for what an agent cannot know of itself."""
    step_m, values = moves.values[:, [NORTH, EAST]], moves.values
    length_m = np.hypot(step_m[:, 0], step_m[:, 1])
    own_m2 = (settings.stride_sd_m + settings.stride_sd_share * length_m) ** 2
    place_m2 = values[:, PLACE_M2] + own_m2 + unseen.place_m2
    told_rad2 = settings.told_turn_factor**2 * values[:, TURN_RAD2]
    turn_rad2 = told_rad2 + settings.stride_turn_sd_rad**2 + unseen.turn_rad2
    return _Rows(
        step_m + unseen.way_m[:, :2],
        length_m + np.hypot(unseen.way_m[:, 0], unseen.way_m[:, 1]),
        np.column_stack([place_m2, turn_rad2]),
        np.column_stack([
            values[:, DOWN] + unseen.way_m[:, 2], values[:, DOWN_M2] + unseen.down_m2
        ]),
    )  # fmt: skip


def straight_moves(
    chain: Chain, nodes: Ints, held: AbstractSet[UnitName], settings: TeamSettings
) -> tuple[Ints, Floats]:
    """Return which moves from node to node are straight, and their directions (rad).

    Directions are in the unit's frame; moves are those of units in ``held`` alone.
    """
    is_held = np.array([chain.unit_name(unit) in held for unit in range(len(chain.starts))])
    way_m = np.diff(chain.way_m[nodes], axis=0)
    straight_m = np.sqrt(way_m[:, 0] * way_m[:, 0] + way_m[:, 1] * way_m[:, 1])
    length_m = np.diff(chain.length_m[nodes])
    found = np.flatnonzero(
        (straight_m > settings.straight_least_m)
        & (straight_m >= settings.straight_share * length_m)
        & is_held[chain.unit[nodes[1:]]]
    )
    return found, np.array([math.atan2(east, north) for north, east in way_m[found].tolist()])


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
