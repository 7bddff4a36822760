"""From what has been heard until a moment to the graph that the smoother solves (pure)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from command_post.fusion.team.chain import (
    Chain,
    UnitName,
    chain_of,
    place_nodes,
    straight_moves,
    turn_known,
    unit_sd,
)
from command_post.fusion.team.graph import FIRST_UNIT, Graph, with_columns
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.move_log import Floats, Ints
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.ties import PlaceId, Ties, asides_m2, level_sd_m, ties_of
from command_post.fusion.team.unheard import unheard_of
from shared.compiled import compiled
from shared.units import NS_PER_S

UNKNOWN_SD_M = 1000.0
UNKNOWN_TURN_SD_RAD = 50.0
ANY_AXIS_SD_RAD = 10.0


class Rival(NamedTuple):
    """Another belief of the building's axis, and how likely it is."""

    mode: str
    axis_rad: float
    sd_rad: float
    share: float


class AxisBelief(NamedTuple):
    """What is supposed of the building: its axis (rad) and how well that is known, if it has one.

    ``units`` are those whose heading is known well enough, without it, to be held to it: an axis
    is alike modulo a right angle, and would hold a heading that may be any to a wrong one as well.
    ``rivals`` are the other beliefs, the likeliest of each mode.
    """

    mode: str
    axis_rad: float
    sd_rad: float
    units: frozenset[UnitName]
    rivals: tuple[Rival, ...] = ()


NO_AXIS = AxisBelief("none", 0.0, 1.0, frozenset())


class Noise(NamedTuple):
    """By how much standard deviations are wider than the settings and the units say.

    ``passes`` are those of passes of DAPs; ``places`` and ``turns`` those of moves; ``straights``
    those of straight moves about the axis, in covariances.
    """

    passes: float = 1.0
    places: float = 1.0
    turns: float = 1.0
    straights: float = 1.0


AS_TOLD = Noise()


@dataclass
class Assembled:
    """A graph, and what its nodes and places are.

    ``chains`` in the graph's order; ``nodes`` the stances that are nodes, by chain; ``places`` in
    the arrow's order, with the chain's node by which each is first tied (``seen_at``). Standard
    deviations are as ``noise`` says. A place is here where it is passed: of a known one that may be
    aside of where it stands, each way with the variance ``aside_m2``, which the graph has in what
    is known of it. Ties say ``tie_share`` of what each would by itself.
    """

    graph: Graph
    chains: list[Chain]
    nodes: list[Ints]
    units: int
    unit_first: list[int]
    places: list[PlaceId] = field(default_factory=list)
    seen_at: list[int] = field(default_factory=list)
    installed_by: list[int] = field(default_factory=list)
    noise: Noise = AS_TOLD
    aside_m2: Floats = field(default_factory=lambda: np.empty(0))
    tie_share: Floats = field(default_factory=lambda: np.empty(0))

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
        graph = self.graph._replace(
            straight=straight, straight_at=straight_at, axis=_axis(belief, self.noise, settings)
        )
        return replace(self, graph=graph)


def assemble(
    log: TeamLog, until_ns: int, belief: AxisBelief, noise: Noise, settings: TeamSettings
) -> Assembled | None:
    """Return the graph of all that happened until ``until_ns``; ``None`` if nobody has started."""
    chains = [
        chain
        for responder_id in sorted(log.responders)
        if (chain := chain_of(responder_id, log.responders[responder_id], until_ns, settings))
    ]
    if not chains:
        return None
    ties, known = ties_of(log, chains, until_ns, settings)
    heard = _with_unheard(log, chains, ties, until_ns, settings)
    if any(one is not other for one, other in zip(heard, chains, strict=True)):
        chains = heard
        ties, known = ties_of(log, chains, until_ns, settings)
    is_dap = np.array([place[0] == "dap" for place in ties.place], np.bool_)
    wider = np.where(is_dap & (ties.dof > 0.0), noise.passes, 1.0)
    ties = ties._replace(sd_m=wider * ties.sd_m)
    fixes = _fixes(log, chains, until_ns, settings)
    asides = asides_m2(ties, known, settings)
    held = {
        place: (each.north_m, each.east_m, math.hypot(each.sd_m, math.sqrt(asides.get(place, 0.0))))
        for place, each in known.items()
    }
    assembled = _build(chains, ties, held, fixes, belief, noise, settings)
    assembled.aside_m2 = np.array([asides.get(place, 0.0) for place in assembled.places])
    return assembled


def _with_unheard(
    log: TeamLog, chains: list[Chain], ties: Ties, until_ns: int, settings: TeamSettings
) -> list[Chain]:
    """Return the chains with where others told of who was silent; the same if nobody did."""
    found = list(chains)
    for index, chain in enumerate(chains):
        own = log.responders[chain.responder_id]
        fixed_ns = [fix.time_ns for fix in own.fixes if fix.time_ns <= until_ns]
        told_ns = np.append(ties.time_ns[ties.chain == index], np.array(fixed_ns, np.int64))
        unheard = unheard_of(own, chain.time_ns, chain.begin_ns, told_ns, until_ns, settings)
        if unheard.time_ns.size:
            found[index] = chain_of(chain.responder_id, own, until_ns, settings, unheard) or chain
    return found


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
                sd_m = math.hypot(level_sd_m(start.position), settings.start_sd_m)
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
                sd_m = level_sd_m(fix.position)
                at = (fix.position.north_m, fix.position.east_m)
                row = (north_m, east_m, *at, sd_m, settings.sharpness.dof)
                rows.append(_FixRow(index, stance, row))
    return rows


def _build(
    chains: list[Chain],
    ties: Ties,
    known: Mapping[PlaceId, tuple[float, float, float]],
    fixes: list[_FixRow],
    belief: AxisBelief,
    noise: Noise,
    settings: TeamSettings,
) -> Assembled:
    places = sorted(set(ties.place) | known.keys())
    number = {place: at for at, place in enumerate(places)}
    place = np.array([number[each] for each in ties.place], np.int64)
    order = np.lexsort((ties.sd_m, place, ties.stance, ties.chain))
    ties, place = ties.ordered(order), place[order]
    of_fix = np.array([(fix.chain, fix.stance) for fix in fixes], np.int64).reshape(-1, 2).T
    nodes, first = _nodes(chains, (ties.chain, ties.stance), (of_fix[0], of_fix[1]), settings)
    begins = np.array([
        (index, chain.begin_of(unit))
        for index, chain in enumerate(chains)
        for unit in range(len(chain.starts))
    ], np.int64).T  # fmt: skip
    starts = [start for chain in chains for start in chain.starts]
    unit_first = _counted(len(chain.starts) for chain in chains)
    units = int(unit_first[-1])
    moves = [
        _moves(chain, nodes[index], int(first[index]), int(unit_first[index]), noise)
        for index, chain in enumerate(chains)
    ]
    move = np.concatenate([rows for rows, _ in moves])
    move_at = np.concatenate([at for _, at in moves])
    stance_first = _counted(chain.time_ns.size for chain in chains)
    every_node = np.concatenate([stance_first[index] + each for index, each in enumerate(nodes)])

    def node_of(chain: Ints, stance: Ints) -> Ints:
        return np.searchsorted(every_node, stance_first[chain] + stance)

    unit = np.concatenate([unit_first[index] + chain.unit for index, chain in enumerate(chains)])
    tie_node = node_of(ties.chain, ties.stance)
    tie_at = np.column_stack([
        tie_node,
        FIRST_UNIT + 2 * (units + place),
        np.zeros(place.size, np.int64),
        FIRST_UNIT + 2 * unit[stance_first[ties.chain] + ties.stance],
    ])  # fmt: skip
    arrow_size = FIRST_UNIT + 2 * (units + len(places))
    columns, columns_first, width = with_columns(first, move_at, tie_at, arrow_size)
    straight, straight_at = _straights(chains, nodes, belief, settings)
    turn = [
        (
            start.turn_rad,
            max(start.heading_sd_rad if turn_known(start) else UNKNOWN_TURN_SD_RAD, 1e-3),
        )
        for start in starts
    ]
    graph = Graph(
        first, columns, columns_first, width, move, move_at,
        _tie_rows(chains, ties), tie_at,
        np.array([fix.row for fix in fixes]).reshape(-1, 6),
        node_of(*of_fix),
        np.array(turn).reshape(-1, 2), node_of(*begins),
        straight, straight_at,
        np.array([known.get(place, (0.0, 0.0, UNKNOWN_SD_M)) for place in places]).reshape(-1, 3),
        unit_sd(chains, settings), _axis(belief, noise, settings),
        np.array([0.0, settings.lead_sd_s]),
    )  # fmt: skip
    # Of several rows of a place the last one written counts: the first in time, or by whom it was
    # set down.
    seen_at, installed_by = np.full(len(places), -1), np.full(len(places), -1)
    seen_at[place[::-1]] = tie_node[::-1]
    installs = np.flatnonzero(ties.dof == 0.0)
    seen_at[place[installs]] = tie_node[installs]
    installed_by[place[installs]] = ties.chain[installs]
    return Assembled(
        graph, chains, nodes, units, unit_first.tolist(), places,
        seen_at.tolist(), installed_by.tolist(), noise, tie_share=ties.share,
    )  # fmt: skip


def _counted(sizes: Iterable[int]) -> Ints:
    """Return where each of several begins, and where the last ends, if they follow each other."""
    return np.concatenate([[0], np.cumsum(list(sizes))])


def _nodes(
    chains: list[Chain],
    tied: tuple[Ints, Ints],
    fixed: tuple[Ints, Ints],
    settings: TeamSettings,
) -> tuple[list[Ints], Ints]:
    """Return each chain's stances that are nodes, those ``tied`` and ``fixed`` among them.

    And where each chain's nodes begin.
    """
    of_chain, stance = np.concatenate([tied, fixed], axis=1)
    nodes = [
        place_nodes(
            chain.time_ns,
            chain.length_m,
            np.unique(np.concatenate([
                [0, chain.time_ns.size - 1], chain.leaps, chain.leaps - 1, stance[of_chain == index]
            ])),
            settings.node_m,
            round(settings.node_s * NS_PER_S),
        )
        for index, chain in enumerate(chains)
    ]  # fmt: skip
    return nodes, _counted(len(each) for each in nodes)


def _tie_rows(chains: list[Chain], ties: Ties) -> Floats:
    """Return ``Graph.tie`` of ties in the order of their chains."""
    rows = np.column_stack([ties.offset_m, ties.sd_m, ties.dof, np.zeros((ties.dof.size, 2))])
    first = np.searchsorted(ties.chain, np.arange(len(chains) + 1))
    for index, chain in enumerate(chains):
        heard = first[index] + np.flatnonzero(ties.dof[first[index] : first[index + 1]])
        rows[heard, 4:] = chain.velocity_m_s(ties.time_ns[heard])
    return rows


def _moves(
    chain: Chain, nodes: Ints, first: int, first_unit: int, noise: Noise
) -> tuple[Floats, Ints]:
    """Return a chain's rows of ``Graph.move`` and ``Graph.move_at``."""
    rows, at = np.empty((len(nodes) - 1, 5)), np.zeros((len(nodes) - 1, 3), np.int64)
    at[:, 0] = np.arange(first, first + len(at))
    at[:, 1] = FIRST_UNIT + 2 * (first_unit + chain.unit[nodes[1:]])
    _write_moves(
        chain.time_ns, chain.way_m, chain.length_m, chain.variance, nodes, chain.leaps,
        chain.links, noise.places, noise.turns, rows,
    )  # fmt: skip
    return rows, at


@compiled
def _write_moves(
    time_ns: Ints, way_m: Floats, length_m: Floats, variance: Floats, nodes: Ints, leaps: Ints,
    links: Ints, places: float, turns: float, rows: Floats,
) -> None:  # fmt: skip
    """Write rows of ``Graph.move`` from each of a chain's ``nodes`` to the next, by its fields.

    Deviations are so many times as wide as told: ``places``, ``turns``.
    """
    leapt = begun = 0
    for row in range(nodes.size - 1):
        one, other = nodes[row], nodes[row + 1]
        place_sd_m = math.sqrt(variance[other, 0] - variance[one, 0])
        turn_sd_rad = math.sqrt(variance[other, 1] - variance[one, 1])
        sd_rad = turns * turn_sd_rad
        if begun < links.size and links[begun] == other:
            begun += 1
            sd_rad = UNKNOWN_TURN_SD_RAD
        if leapt < leaps.size and leaps[leapt] == other:
            leapt += 1
            sd_m = place_sd_m
        else:
            # The turn goes evenly from one end's to the other's; where it did not, the way bends.
            bent_m = 0.29 * (length_m[other] - length_m[one]) * turn_sd_rad
            sd_m = places * (place_sd_m + bent_m)
        rows[row, 0] = way_m[other, 0] - way_m[one, 0]
        rows[row, 1] = way_m[other, 1] - way_m[one, 1]
        rows[row, 2] = (time_ns[other] - time_ns[one]) / NS_PER_S
        rows[row, 3], rows[row, 4] = max(sd_m, 0.01), max(sd_rad, 1e-4)


def _axis(belief: AxisBelief, noise: Noise, settings: TeamSettings) -> Floats:
    told_sd_rad = noise.straights * settings.straight_told_sd_rad
    return np.array([belief.axis_rad, belief.sd_rad, told_sd_rad])


def _straights(
    chains: list[Chain],
    nodes: list[Ints],
    belief: AxisBelief,
    settings: TeamSettings,
) -> tuple[Floats, Ints]:
    """Return the straight moves of those held to the axis, if there is one."""
    rows, at = [np.empty((0, 2))], [np.empty(0, np.int64)]
    row = 0
    for chain, of_chain in zip(chains, nodes, strict=True):
        if belief.mode != "none":
            found, direction_rad = straight_moves(chain, of_chain, belief.units, settings)
            sd_rad = np.full(len(found), settings.straight_sd_rad)
            rows.append(np.column_stack([direction_rad, sd_rad]))
            at.append(row + found)
        row += len(of_chain) - 1
    return np.concatenate(rows), np.concatenate(at)
