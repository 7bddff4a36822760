"""A solution of the team's graph, kept by time, so that a later graph can start from it (pure)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, TypeAlias

import numpy as np

from command_post.fusion.team.arithmetic import carried, sine_cosine
from command_post.fusion.team.assembly import (
    AS_TOLD,
    NO_AXIS,
    Assembled,
    AxisBelief,
    Noise,
)
from command_post.fusion.team.chain import Chain
from command_post.fusion.team.graph import AXIS, LEAD
from command_post.fusion.team.log import Installed, Start, TeamLog
from command_post.fusion.team.move_log import Floats, Ints
from command_post.fusion.team.suspicions import Suspicion
from command_post.fusion.team.ties import PlaceId
from shared.compiled import compiled


class ChainSolution(NamedTuple):
    """A responder's nodes by time (k,), their poses (k, 3), and each unit's scale and drift."""

    time_ns: Ints
    pose: Floats
    units: Floats


Ways: TypeAlias = Mapping[str, tuple[ChainSolution, ...]]
"""Of each responder, pieces of a way in the order of time."""

NO_WAYS: Ways = {}


class Held(NamedTuple):
    """A suspicion that is held, and how much cheaper it makes the solution.

    It ``stood`` when it was weighed again by what came since. ``of_one``: one responder alone
    contradicts a DAP, and may be who is wrong.
    """

    suspicion: Suspicion
    gain: float
    stood: bool = False
    of_one: bool = False


class Stood(NamedTuple):
    """Where a DAP stood since when, by what had been heard until then."""

    until_ns: int
    installed: tuple[Installed, ...]


class Anchors(NamedTuple):
    """Where responders and DAPs were held to be, for what comes later to begin from.

    It was so at the commit of the period ``number``. ``starts`` are as if they began there,
    ``until_ns`` is until when they had been heard, by responder.
    """

    number: int
    until_ns: Mapping[str, int]
    starts: Mapping[str, Start]
    stood: Mapping[str, Stood]


NO_ANCHORS = Anchors(-1, {}, {}, {})


def overlaid(anchors: Sequence[Anchors]) -> Anchors:
    """Return where all were held to be last, of several in the order of their numbers."""
    whole = NO_ANCHORS
    for each in anchors:
        whole = Anchors(
            max(whole.number, each.number),
            {**whole.until_ns, **each.until_ns},
            {**whole.starts, **each.starts},
            {**whole.stood, **each.stood},
        )
    return whole


class Solution(NamedTuple):
    """The team as it was solved at ``time_ns``, at that cost, and what was believed of its axis.

    ``storeys_m`` are the heights (m down) on which it had walked; ``lead_s`` is by how much peaks
    lead, ``noise`` how far passes and moves scatter beside what is told; ``held`` is what was held
    against nodes, ``examined`` by how many passes each was last judged. Later ones begin from
    ``anchors``, and in time from those that are ``to_come``; ``past`` are the ways before.
    """

    time_ns: int
    chains: Mapping[str, ChainSolution]
    places: Mapping[PlaceId, tuple[float, float]]
    axis_rad: float
    lead_s: float
    belief: AxisBelief
    cost: float
    noise: Noise
    storeys_m: tuple[float, ...] = ()
    held: tuple[Held, ...] = ()
    examined: Mapping[str, int] = MappingProxyType({})
    anchors: Anchors = NO_ANCHORS
    to_come: tuple[Anchors, ...] = ()
    past: Ways = NO_WAYS

    @property
    def suspicions(self) -> tuple[Suspicion, ...]:
        """What was held against nodes."""
        return tuple(each.suspicion for each in self.held)


NOTHING = Solution(-1, {}, {}, 0.0, 0.0, NO_AXIS, math.inf, AS_TOLD)


def joined(solutions: Sequence[Solution]) -> Solution:
    """Return one solution that has what several have, of the first of them where they differ.

    The building's axis is as the one believes it that holds most responders to it.
    """
    if len(solutions) == 1:
        return solutions[0]
    surest = max(solutions, key=lambda each: len(each.belief.units), default=NOTHING)
    of_all: Solution = NOTHING
    for each in reversed(solutions):
        of_all = Solution(
            max(of_all.time_ns, each.time_ns),
            {**of_all.chains, **each.chains},
            {**of_all.places, **each.places},
            surest.axis_rad,
            each.lead_s,
            surest.belief._replace(units=of_all.belief.units | each.belief.units),
            each.cost,
            each.noise,
            each.storeys_m or of_all.storeys_m,
            (*each.held, *of_all.held),
            {**of_all.examined, **each.examined},
            overlaid([of_all.anchors, each.anchors]),
            _by_number(of_all.to_come, each.to_come),
            {**of_all.past, **each.past},
        )
    return of_all


def _by_number(one: tuple[Anchors, ...], other: tuple[Anchors, ...]) -> tuple[Anchors, ...]:
    of_number: dict[int, list[Anchors]] = {}
    for anchors in (*one, *other):
        of_number.setdefault(anchors.number, []).append(anchors)
    return tuple(overlaid(each) for _, each in sorted(of_number.items()))


def concerning(before: Solution, log: TeamLog) -> Solution:
    """Return a solution without what is held against nodes that are not in ``log``."""
    of_log = {"responder": log.responders.keys(), "dap": log.daps.keys()}
    held = tuple(
        each
        for each in before.held
        if each.suspicion.node_id in of_log[each.suspicion.role]
        and (not each.suspicion.other_id or each.suspicion.other_id in log.responders)
    )
    return before if len(held) == len(before.held) else before._replace(held=held)


def begin_from(before: Solution, assembled: Assembled) -> tuple[Floats, Floats]:
    """Return poses and arrow to start the graph from: what was solved before, and moves since."""
    pose = np.zeros((int(assembled.graph.first[-1]), 3))
    arrow = np.zeros(assembled.arrow_size)
    arrow[AXIS] = before.axis_rad
    arrow[LEAD] = before.lead_s
    fixed = _fixed(assembled)
    for index, chain in enumerate(assembled.chains):
        known = before.chains.get(chain.responder_id)
        first = int(assembled.graph.first[index])
        units = np.zeros((len(chain.starts), 2))
        if known is not None:
            shared = min(len(units), len(known.units))
            units[:shared] = known.units[:shared]
        begin = fixed[first]
        times, poses = (np.empty(0, np.int64), np.empty((0, 3))) if known is None else known[:2]
        pose[first : first + len(assembled.nodes[index])] = _extended(
            chain.time_ns, chain.way_m, chain.unit, assembled.nodes[index],
            times, poses, units[:, 0].copy(), begin[0], begin[1],
        )  # fmt: skip
        column = assembled.unit_column(index)
        arrow[column : column + units.size] = units.ravel()
    for place, place_id in enumerate(assembled.places):
        column = assembled.place_column(place)
        node = assembled.seen_at[place]
        if place_id in before.places:
            arrow[column : column + 2] = before.places[place_id]
        elif assembled.graph.place[place, 2] < 100.0 or node < 0:
            arrow[column : column + 2] = assembled.graph.place[place, :2]
        else:
            arrow[column : column + 2] = pose[node, :2]
    return pose, arrow


def _fixed(assembled: Assembled) -> dict[int, tuple[float, float]]:
    """Return where each node is fixed that is, by what was said of it first."""
    rows = zip(assembled.graph.fix_at.tolist(), assembled.graph.fix.tolist(), strict=True)
    return {node: (north_m, east_m) for node, (_, _, north_m, east_m, *_) in reversed([*rows])}


@compiled
def _extended(
    time_ns: Ints,
    way_m: Floats,
    unit: Ints,
    nodes: Ints,
    known_ns: Ints,
    known: Floats,
    scale: Floats,
    north_m: float,
    east_m: float,
) -> Floats:
    """Return poses (k, 3) of nodes: the last one known by each one's time, and the way from it."""
    poses = np.zeros((nodes.size, 3))
    at = -1
    base = 0
    base_pose = np.array([north_m, east_m, 0.0])
    for index in range(nodes.size):
        stance = nodes[index]
        while at + 1 < known_ns.size and known_ns[at + 1] <= time_ns[stance]:
            at += 1
            base_pose = known[at].copy()
            base = np.searchsorted(time_ns, known_ns[at], side="right") - 1
            # Of two stances at one time the node that is meant is that of this unit.
            if time_ns[stance] == known_ns[at]:
                base = stance
        if unit[base] != unit[stance]:
            while unit[base] != unit[stance]:
                base += 1
            base_pose = base_pose.copy()
            base_pose[2] = 0.0
        north = (1.0 + scale[unit[stance]]) * (way_m[stance, 0] - way_m[base, 0])
        east = (1.0 + scale[unit[stance]]) * (way_m[stance, 1] - way_m[base, 1])
        poses[index, 0], poses[index, 1] = carried(base_pose, north, east)
        poses[index, 2] = base_pose[2]
    return poses


def solution_of(
    time_ns: int,
    assembled: Assembled,
    pose: Floats,
    arrow: Floats,
    belief: AxisBelief,
    cost: float,
    noise: Noise,
) -> Solution:
    """Return what was solved, by time and name."""
    chains = {}
    for index, chain in enumerate(assembled.chains):
        first, end = assembled.graph.first[index], assembled.graph.first[index + 1]
        column = assembled.unit_column(index)
        units = arrow[column : column + 2 * len(chain.starts)].reshape(-1, 2).copy()
        chains[chain.responder_id] = ChainSolution(
            chain.time_ns[assembled.nodes[index]].copy(), pose[first:end].copy(), units
        )
    places = {}
    for place, place_id in enumerate(assembled.places):
        column = assembled.place_column(place)
        places[place_id] = (float(arrow[column]), float(arrow[column + 1]))
    return Solution(
        time_ns, chains, places, float(arrow[AXIS]), float(arrow[LEAD]), belief, cost, noise
    )


def turned(
    assembled: Assembled, pose: Floats, arrow: Floats, chain_index: int, turn_rad: float,
    unit: int = 0,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Return poses and arrow with one responder's way since ``unit`` began turned about there.

    It is laid out straight from there, as its units said; the places they installed go along.
    """
    chain: Chain = assembled.chains[chain_index]
    first, end = assembled.graph.first[chain_index : chain_index + 2].tolist()
    stance, nodes = chain.begin_of(unit), assembled.nodes[chain_index]
    since = int(np.searchsorted(nodes, stance))
    first += since
    way_m = chain.way_m[nodes[since:]] - chain.way_m[stance]
    laid = laid_out(pose[first], turn_rad, way_m)
    pose, arrow = pose.copy(), arrow.copy()
    pose[first:end] = laid
    for place, by in enumerate(assembled.installed_by):
        if by == chain_index and assembled.seen_at[place] >= first:
            column = assembled.place_column(place)
            arrow[column : column + 2] = pose[assembled.seen_at[place], :2]
    return pose, arrow


@compiled
def laid_out(pose: Floats, turn_rad: float, way_m: Floats) -> Floats:
    """Return poses (k, 3) along a way (k, 2) in a unit's frame, from ``pose`` turned further."""
    turn = pose[2] + turn_rad
    sine, cosine = sine_cosine(turn)
    poses = np.empty((way_m.shape[0], 3))
    for k in range(way_m.shape[0]):
        north, east = way_m[k]
        poses[k, 0] = pose[0] + cosine * north - sine * east
        poses[k, 1] = pose[1] + sine * north + cosine * east
        poses[k, 2] = turn
    return poses
