"""From what has been heard until a moment to the graph that the smoother solves (pure)."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from command_post.fusion.team.chain import (
    Chain,
    chain_of,
    place_nodes,
    straight_moves,
    turn_known,
    unit_sd,
)
from command_post.fusion.team.graph import FIRST_UNIT, Graph, with_columns
from command_post.fusion.team.log import Floats, Installed, Ints, Peak, TeamLog
from command_post.fusion.team.settings import TeamSettings
from shared.messages import LocalPosition
from shared.units import NS_PER_S

PlaceId: TypeAlias = tuple[str, ...]
"""A DAP where it stood since a time, or a meeting of two responders."""

UNKNOWN_SD_M = 1000.0
UNKNOWN_TURN_SD_RAD = 50.0
ANY_AXIS_SD_RAD = 10.0
SAME_PASS_S = 5.0
LEAST_SD_M = 0.1


class AxisBelief(NamedTuple):
    """What is supposed of the building: its axis (rad) and how well that is known, if it has one.

    ``chains`` are the responders whose heading is known well enough to be held to it.
    """

    mode: str
    axis_rad: float
    sd_rad: float
    chains: frozenset[str]


NO_AXIS = AxisBelief("none", 0.0, 1.0, frozenset())


@dataclass
class Assembled:
    """A graph, and what its nodes and places are.

    ``chains`` in the graph's order; ``nodes`` the stances that are nodes, by chain; ``places`` in
    the arrow's order, with the chain's node by which each is first tied (``seen_at``). Of
    passes of DAPs the standard deviations are ``tie_scale`` times what the settings say.
    """

    graph: Graph
    chains: list[Chain]
    nodes: list[Ints]
    units: int
    unit_first: list[int]
    places: list[PlaceId] = field(default_factory=list)
    seen_at: list[int] = field(default_factory=list)
    installed_by: list[int] = field(default_factory=list)
    tie_scale: float = 1.0

    @property
    def arrow_size(self) -> int:
        """Length of the arrow."""
        return self.place_column(len(self.places))

    def place_column(self, place: int) -> int:
        """The column at which a place stands in the arrow."""
        return FIRST_UNIT + 2 * self.units + 2 * place

    def unit_column(self, chain: int, unit: int = 0) -> int:
        """The column at which a unit of a chain stands in the arrow."""
        return FIRST_UNIT + 2 * (self.unit_first[chain] + unit)

    def believing(self, belief: AxisBelief, settings: TeamSettings) -> Assembled:
        """Return the same, with another belief of the building's axis."""
        straight, straight_at = _straights(self.chains, self.nodes, belief, settings)
        axis = np.array([belief.axis_rad, belief.sd_rad])
        graph = self.graph._replace(straight=straight, straight_at=straight_at, axis=axis)
        return replace(self, graph=graph)


class _Tie(NamedTuple):
    """A place reached by the chain: when, stance, offset from there, deviation, freedom."""

    chain: int
    time_ns: int
    stance: int
    north_m: float
    east_m: float
    place: PlaceId
    sd_m: float
    dof: float


class _Known(NamedTuple):
    north_m: float
    east_m: float
    sd_m: float


def assemble(
    log: TeamLog, until_ns: int, belief: AxisBelief, tie_scale: float, settings: TeamSettings
) -> Assembled | None:
    """Return the graph of all that happened until ``until_ns``; ``None`` if nobody has started."""
    chains = [
        chain
        for responder_id in sorted(log.responders)
        if (chain := chain_of(responder_id, log.responders[responder_id], until_ns, settings))
    ]
    if not chains:
        return None
    ties, known = _ties(log, chains, until_ns, settings)
    ties = [
        tie._replace(sd_m=tie_scale * tie.sd_m) if tie.dof and tie.place[0] == "dap" else tie
        for tie in ties
    ]
    fixes = _fixes(log, chains, until_ns, settings)
    assembled = _build(chains, ties, known, fixes, belief, settings)
    assembled.tie_scale = tie_scale
    return assembled


def _ties(
    log: TeamLog, chains: list[Chain], until_ns: int, settings: TeamSettings
) -> tuple[list[_Tie], dict[PlaceId, _Known]]:
    """Return all ties, and what is known of places beforehand."""
    number = {chain.responder_id: index for index, chain in enumerate(chains)}
    stands: dict[str, list[Installed]] = {}
    known: dict[PlaceId, _Known] = {}
    ties: list[_Tie] = []
    for dap_id in sorted(log.daps):
        for installed in log.daps[dap_id]:
            if installed.time_ns > until_ns:
                break
            place = _dap_place(dap_id, installed)
            chain = number.get(installed.installer_id or "")
            if chain is not None:
                ties.append(_install_tie(chains, chain, installed.time_ns, place, settings))
            elif installed.position is not None:
                known[place] = _known(installed.position)
            else:
                continue
            stands.setdefault(dap_id, []).append(installed)
    for index in range(len(chains)):
        ties += _pass_ties(log, chains, index, stands, until_ns, settings)
        ties += _meeting_ties(log, chains, index, number, until_ns, settings)
    return ties, known


def _install_tie(
    chains: list[Chain], chain: int, time_ns: int, place: PlaceId, settings: TeamSettings
) -> _Tie:
    """Return the tie of a DAP to its installer, who set it down before them."""
    tie = _tie(chains, chain, time_ns, place, settings.install_sd_m, 0.0)
    ahead_north, ahead_east = chains[chain].ahead(time_ns)
    return tie._replace(
        north_m=tie.north_m + settings.install_ahead_m * ahead_north,
        east_m=tie.east_m + settings.install_ahead_m * ahead_east,
    )


def _known(position: LocalPosition) -> _Known:
    return _Known(position.north_m, position.east_m, _sd_m(position))


def _sd_m(position: LocalPosition) -> float:
    """Return how well a place is known, each way alike; what no covariance can be counts as 0."""
    nn, _, ee = position.covariance_m2
    return math.sqrt(max(0.5 * (nn + ee), LEAST_SD_M**2))


def _pass_ties(
    log: TeamLog, chains: list[Chain], index: int, stands: dict[str, list[Installed]],
    until_ns: int, settings: TeamSettings,
) -> list[_Tie]:  # fmt: skip
    """Return a responder's passes of DAPs, each tied to where the DAP then stood."""
    heard = log.responders[chains[index].responder_id]
    ties = []
    for peak in _passes(heard.peaks, heard.nears, until_ns, settings):
        standing = stands.get(peak.other_id, [])
        at = bisect_right(standing, peak.time_ns, key=lambda each: each.time_ns)
        if at:
            place = _dap_place(peak.other_id, standing[at - 1])
            sd_m = settings.sharpness.sd_at_m(peak.peak_dbm)
            ties.append(_tie(chains, index, peak.time_ns, place, sd_m, settings.sharpness.dof))
    return _shadowed_alike(ties, chains[index], settings.shadowing_m)


def _shadowed_alike(ties: list[_Tie], chain: Chain, shadowing_m: float) -> list[_Tie]:
    """Return a chain's ties to what it heard, those to one within ``shadowing_m`` of way as one.

    The same walls and bodies shadow them: all of them together say no more than one does.
    """
    at_m: dict[PlaceId, list[float]] = {}
    for tie in ties:
        at_m.setdefault(tie.place[:-1], []).append(float(chain.length_m[tie.stance]))
    for way_m in at_m.values():
        way_m.sort()
    told = []
    for tie in ties:
        way_m, here_m = at_m[tie.place[:-1]], float(chain.length_m[tie.stance])
        alike = bisect_right(way_m, here_m + shadowing_m) - bisect_left(way_m, here_m - shadowing_m)
        told.append(tie._replace(sd_m=tie.sd_m * math.sqrt(alike)))
    return told


def _meeting_ties(
    log: TeamLog, chains: list[Chain], index: int, number: dict[str, int],
    until_ns: int, settings: TeamSettings,
) -> list[_Tie]:  # fmt: skip
    """Return both ties of each meeting that is logged with this responder."""
    responder_id = chains[index].responder_id
    own, others = [], []
    for meeting in _meetings(log.responders[responder_id].contacts, until_ns, settings):
        other = number.get(meeting.other_id)
        if other is None:
            continue
        place = ("meeting", responder_id, meeting.other_id, str(meeting.time_ns))
        sd_m = settings.sharpness.sd_at_m(meeting.peak_dbm + settings.contact_gain_db)
        # Either is half of the way from where they met.
        sd_m = settings.contact_share * max(sd_m, settings.contact_sd_least_m)
        dof = settings.sharpness.dof
        own.append(_tie(chains, index, meeting.time_ns, place, sd_m, dof))
        others.append(_tie(chains, other, meeting.time_ns, place, sd_m, dof))
    told = _shadowed_alike(own, chains[index], settings.shadowing_m)
    return [
        *told,
        *(other._replace(sd_m=own.sd_m) for own, other in zip(told, others, strict=True)),
    ]


def _dap_place(dap_id: str, installed: Installed) -> PlaceId:
    return ("dap", dap_id, str(installed.time_ns))


def _tie(
    chains: list[Chain], chain: int, time_ns: int, place: PlaceId, sd_m: float, dof: float
) -> _Tie:
    return _Tie(chain, time_ns, *chains[chain].nearest(time_ns), place, sd_m, dof)


def _passes(
    peaks: list[Peak], nears: list[Peak], until_ns: int, settings: TeamSettings
) -> list[Peak]:
    """Return the peaks sharp enough; of a DAP that tells none, the strongest of each stay."""
    told = {peak.other_id for peak in peaks}
    passes = [
        peak
        for peak in peaks
        if peak.time_ns <= until_ns and peak.peak_dbm >= settings.sharpness.least_dbm
    ]
    stays: dict[str, Peak] = {}
    for near in nears:
        if near.time_ns > until_ns or near.other_id in told:
            continue
        best = stays.get(near.other_id)
        if best is not None and near.time_ns - best.time_ns < SAME_PASS_S * NS_PER_S:
            if near.peak_dbm > best.peak_dbm:
                stays[near.other_id] = near
            continue
        if best is not None:
            passes.append(best)
        stays[near.other_id] = near
    return sorted([*passes, *stays.values()])


def _meetings(contacts: list[Peak], until_ns: int, settings: TeamSettings) -> list[Peak]:
    """Return the contacts close enough, one for each meeting: both units may tell of it."""
    found: dict[str, Peak] = {}
    meetings = []
    for contact in contacts:
        if contact.time_ns > until_ns or contact.peak_dbm < settings.contact_least_dbm:
            continue
        last = found.get(contact.other_id)
        if last and contact.time_ns - last.time_ns < settings.contact_again_s * NS_PER_S:
            continue
        found[contact.other_id] = contact
        meetings.append(contact)
    return meetings


class _FixRow(NamedTuple):
    chain: int
    stance: int
    row: tuple[float, float, float, float, float, float]


def _fixes(
    log: TeamLog, chains: list[Chain], until_ns: int, settings: TeamSettings
) -> list[_FixRow]:
    rows = []
    for index, chain in enumerate(chains):
        for unit, start in enumerate(chain.starts):
            stance = chain.begin_of(unit)
            if start.position is not None:
                sd_m = math.hypot(_sd_m(start.position), settings.start_sd_m)
                at = (start.position.north_m, start.position.east_m)
            elif unit == 0:
                unknown = start.heading_sd_rad >= UNKNOWN_TURN_SD_RAD
                sd_m = settings.unknown_start_sd_m if unknown else settings.entrance_sd_m
                at = (0.0, 0.0)
            else:
                continue
            rows.append(_FixRow(index, stance, (0.0, 0.0, *at, sd_m, 0.0)))
        for fix in log.responders[chain.responder_id].fixes:
            if fix.time_ns <= until_ns:
                stance, north_m, east_m = chain.nearest(fix.time_ns)
                sd_m = _sd_m(fix.position)
                at = (fix.position.north_m, fix.position.east_m)
                row = (north_m, east_m, *at, sd_m, settings.sharpness.dof)
                rows.append(_FixRow(index, stance, row))
    return rows


def _build(
    chains: list[Chain],
    ties: list[_Tie],
    known: dict[PlaceId, _Known],
    fixes: list[_FixRow],
    belief: AxisBelief,
    settings: TeamSettings,
) -> Assembled:
    nodes, first = _nodes(chains, ties, fixes, settings)
    node_of = [
        {int(stance): int(first[index]) + at for at, stance in enumerate(of_chain)}
        for index, of_chain in enumerate(nodes)
    ]
    unit_first = np.concatenate([[0], np.cumsum([len(chain.starts) for chain in chains])])
    units = int(unit_first[-1])
    places = sorted({tie.place for tie in ties} | known.keys())
    column = {place: FIRST_UNIT + 2 * (units + at) for at, place in enumerate(places)}
    ties = sorted(ties, key=lambda tie: (tie.chain, tie.stance, tie.place, tie.sd_m))
    moves = [
        _moves(chain, nodes[index], int(first[index]), int(unit_first[index]))
        for index, chain in enumerate(chains)
    ]
    move = np.concatenate([rows for rows, _ in moves])
    move_at = np.concatenate([at for _, at in moves])
    tie_at = np.array(
        [(node_of[tie.chain][tie.stance], column[tie.place], 0) for tie in ties], np.int64
    ).reshape(-1, 3)
    arrow_size = FIRST_UNIT + 2 * (units + len(places))
    columns, columns_first, width = with_columns(first, move_at, tie_at, arrow_size)
    straight, straight_at = _straights(chains, nodes, belief, settings)
    turns = [
        (
            node_of[index][chain.begin_of(unit)],
            start.turn_rad,
            start.heading_sd_rad if turn_known(start) else UNKNOWN_TURN_SD_RAD,
        )
        for index, chain in enumerate(chains)
        for unit, start in enumerate(chain.starts)
    ]
    graph = Graph(
        first, columns, columns_first, width, move, move_at,
        _tie_rows(chains, ties), tie_at,
        np.array([fix.row for fix in fixes]).reshape(-1, 6),
        np.array([node_of[fix.chain][fix.stance] for fix in fixes], np.int64),
        np.array([(turn_rad, max(sd_rad, 1e-3)) for _, turn_rad, sd_rad in turns]).reshape(-1, 2),
        np.array([node for node, _, _ in turns], np.int64),
        straight, straight_at,
        np.array([known.get(place, (0.0, 0.0, UNKNOWN_SD_M)) for place in places]).reshape(-1, 3),
        unit_sd(chains, settings), np.array([belief.axis_rad, belief.sd_rad]),
        np.array([0.0, settings.lead_sd_s]),
    )  # fmt: skip
    seen: dict[PlaceId, int] = {}
    by: dict[PlaceId, int] = {}
    for tie, (node, _, _) in zip(ties, tie_at.tolist(), strict=True):
        seen.setdefault(tie.place, node)
        if tie.dof == 0.0:
            seen[tie.place] = node
            by[tie.place] = tie.chain
    return Assembled(
        graph, chains, nodes, units, unit_first.tolist(), places,
        [seen.get(place, -1) for place in places], [by.get(place, -1) for place in places],
    )  # fmt: skip


def _nodes(
    chains: list[Chain], ties: Iterable[_Tie], fixes: Iterable[_FixRow], settings: TeamSettings
) -> tuple[list[Ints], Ints]:
    wanted: list[set[int]] = [
        {0, chain.time_ns.size - 1, *chain.links.tolist(), *(chain.links - 1).tolist()}
        for chain in chains
    ]
    for index, stance in (*((t.chain, t.stance) for t in ties), *(f[:2] for f in fixes)):
        wanted[index].add(stance)
    nodes = [
        place_nodes(
            chain.time_ns,
            chain.length_m,
            np.array(sorted(stances), np.int64),
            settings.node_m,
            round(settings.node_s * NS_PER_S),
        )
        for chain, stances in zip(chains, wanted, strict=True)
    ]
    return nodes, np.concatenate([[0], np.cumsum([len(each) for each in nodes])])


def _tie_rows(chains: list[Chain], ties: list[_Tie]) -> Floats:
    """Return ``Graph.tie`` of ties in the order of their chains."""
    rows = np.array([(t.north_m, t.east_m, t.sd_m, t.dof, 0.0, 0.0) for t in ties]).reshape(-1, 6)
    of_chain = np.array([tie.chain for tie in ties], np.int64)
    time_ns = np.array([tie.time_ns for tie in ties], np.int64)
    for index, chain in enumerate(chains):
        heard = (of_chain == index) & (rows[:, 3] > 0.0)
        rows[heard, 4:] = chain.velocity_m_s(time_ns[heard])
    return rows


def _moves(chain: Chain, nodes: Ints, first: int, first_unit: int) -> tuple[Floats, Ints]:
    """Return a chain's rows of ``Graph.move`` and ``Graph.move_at``."""
    one, other = nodes[:-1], nodes[1:]
    way_m = chain.way_m[other] - chain.way_m[one]
    duration_s = (chain.time_ns[other] - chain.time_ns[one]) / NS_PER_S
    place_m2, turn_rad2 = (chain.variance[other] - chain.variance[one]).T
    length_m = chain.length_m[other] - chain.length_m[one]
    # The turn goes evenly from one end's to the other's; where it did not, the way bends.
    sd_m = np.sqrt(place_m2) + 0.29 * length_m * np.sqrt(turn_rad2)
    sd_rad = np.sqrt(turn_rad2)
    link = np.isin(other, chain.links)
    sd_m[link] = np.sqrt(place_m2[link])
    sd_rad[link] = UNKNOWN_TURN_SD_RAD
    rows = np.column_stack([way_m, duration_s, np.maximum(sd_m, 0.01), np.maximum(sd_rad, 1e-4)])
    scale = FIRST_UNIT + 2 * (first_unit + chain.unit[other])
    at = np.column_stack([first + np.arange(len(one)), scale, np.zeros(len(one), np.int64)])
    return rows, at.astype(np.int64)


def _straights(
    chains: list[Chain],
    nodes: list[Ints],
    belief: AxisBelief,
    settings: TeamSettings,
) -> tuple[Floats, Ints]:
    """Return the straight moves of those held to the axis."""
    rows, at = [np.empty((0, 2))], [np.empty(0, np.int64)]
    row = 0
    for chain, of_chain in zip(chains, nodes, strict=True):
        if chain.responder_id in belief.chains:
            found, direction_rad = straight_moves(chain, of_chain, settings)
            sd_rad = np.full(len(found), settings.straight_sd_rad)
            rows.append(np.column_stack([direction_rad, sd_rad]))
            at.append(row + found)
        row += len(of_chain) - 1
    return np.concatenate(rows), np.concatenate(at)
