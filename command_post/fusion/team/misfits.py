"""How well a solved team explains each pass: what stands out, and where it would fit (pure)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from command_post.fusion.team.arithmetic import carried, logarithm
from command_post.fusion.team.graph import LEAD, PLACE_DOF, TURN_DOF, Floats, Ints
from command_post.fusion.team.log import ResponderLog
from command_post.fusion.team.residuals import longer, off_move, squared_over
from command_post.fusion.team.solving import Solved
from command_post.fusion.team.ties import PlaceId, level_sd_m
from shared.compiled import compiled
from shared.units import NS_PER_S

EXPECTED_COST = 3.0
"""Of a residual in the plane with Student's t of 4 degrees of freedom, on average."""

STANDS_OUT = 9.0
"""As much a residual of a move costs once in fifty at most."""

LEANS_S = 0.5
AHEAD_S = tuple(
    sign * each
    for sign in (-1.0, 1.0)
    for each in (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0)
)


class Pass(NamedTuple):
    """A place passed: by which chain, when, where that puts the place (m), and what it costs."""

    chain: int
    time_ns: int
    place: PlaceId
    north_m: float
    east_m: float
    sd_m: float
    dof: float
    cost: float


def passes_of(solved: Solved) -> list[Pass]:
    """Return all ties of a solution, with their costs, in the graph's order."""
    graph = solved.assembled.graph
    lead_s = float(solved.arrow[LEAD])
    arrow, base = solved.arrow.tolist(), solved.assembled.place_column(0)
    of_chain = np.searchsorted(graph.first, graph.tie_at[:, 0], side="right") - 1
    found = []
    for chain, (node, column, *_), row in zip(
        of_chain.tolist(), graph.tie_at.tolist(), graph.tie.tolist(), strict=True
    ):
        north_m, east_m, sd_m, dof, fast_north, fast_east = row
        stance = solved.assembled.nodes[chain][node - int(graph.first[chain])]
        north, east = carried(
            solved.pose[node], north_m + lead_s * fast_north, east_m + lead_s * fast_east
        )
        off2 = ((north - arrow[column]) ** 2 + (east - arrow[column + 1]) ** 2) / sd_m**2
        place = solved.assembled.places[(column - base) // 2]
        time_ns = int(solved.assembled.chains[chain].time_ns[stance])
        found.append(
            Pass(chain, time_ns, place, north, east, sd_m, dof, robust_cost(off2, dof, 2.0))
        )
    return found


def robust_cost(squared: float, dof: float, dimension: float) -> float:
    """Return twice the negative log-likelihood of a residual, up to a constant."""
    return (dof + dimension) * logarithm(1.0 + squared / dof) if dof else squared


def scale_off(solved: Solved, own: int) -> float:
    """Return by how much the scale of a chain's last unit is off the mean of the others'."""
    scales = [
        float(solved.arrow[solved.assembled.unit_column(index, int(chain.unit[-1]))])
        for index, chain in enumerate(solved.assembled.chains)
    ]
    others = [*scales[:own], *scales[own + 1 :]] or [0.0]
    return abs(scales[own] - math.fsum(others) / len(others))


class Bend(NamedTuple):
    """A move that does not turn as its unit said, by the time of its end, and what that costs.

    ``leap_cost`` is what the move costs that does not go where its unit said.
    """

    time_ns: int
    cost: float
    leap_cost: float


def worst_bend(solved: Solved, chain: int) -> Bend:
    """Return the move of a responder whose turn costs most."""
    graph, assembled = solved.assembled.graph, solved.assembled
    first, end = graph.first[chain : chain + 2].tolist()
    rows = slice(first - chain, end - 1 - chain)
    at, cost, leap_cost = _worst_bend(
        graph.move[rows], graph.move_at[rows], graph.unit_sd, solved.pose, solved.arrow
    )
    if at < 0:
        return Bend(0, 0.0, leap_cost)
    one, other = assembled.nodes[chain][at : at + 2].tolist()
    times = assembled.chains[chain].time_ns
    return Bend((int(times[one]) + int(times[other])) // 2, cost, leap_cost)


def worst_fix(solved: Solved, chain: int, own: ResponderLog) -> tuple[float, int]:
    """Return what the word for a responder's place costs that fits least, and when it was said."""
    worst = 0.0, 0
    for fix in own.fixes:
        if fix.time_ns <= int(solved.assembled.chains[chain].time_ns[-1]):
            north_m, east_m = place_at(solved, chain, fix.time_ns)
            off_m = math.hypot(north_m - fix.position.north_m, east_m - fix.position.east_m)
            squared = (off_m / level_sd_m(fix.position)) ** 2
            worst = max(worst, (robust_cost(squared, PLACE_DOF, 2.0), fix.time_ns))
    return worst


@compiled
def _worst_bend(
    move: Floats, move_at: Ints, unit_sd: Floats, pose: Floats, arrow: Floats
) -> tuple[int, float, float]:
    """Return which of some moves (m, 5) turned worst, the first of those, and what that costs.

    And what that costs which went worst.
    """
    worst, most, leap = -1, 0.0, 0.0
    for row in range(move_at.shape[0]):
        node, scale, _ = move_at[row]
        turned_rad = pose[node + 1, 2] - pose[node, 2]
        off = (turned_rad - arrow[scale + 1] * move[row, 2]) / move[row, 4]
        cost = (TURN_DOF + 1.0) * logarithm(1.0 + off * off / TURN_DOF)
        if cost > most:
            worst, most = row, cost
        _, _, north_m, east_m = off_move(move, row, pose, node, 1.0 + arrow[scale])
        squared = squared_over(north_m, east_m, move[row, 3] * longer(unit_sd, arrow, scale))
        leap = max(leap, (PLACE_DOF + 2.0) * logarithm(1.0 + squared / PLACE_DOF))
    return worst, most, leap


def scatter(passes: Sequence[Pass]) -> float:
    """Return what passes of one place cost about the place that suits them best."""
    if len(passes) < 2:
        return 0.0
    weight = [1.0 / each.sd_m**2 for each in passes]
    off2: list[float] = []
    for _ in range(6):
        whole = math.fsum(weight)
        north = math.fsum(w * p.north_m for w, p in zip(weight, passes, strict=True)) / whole
        east = math.fsum(w * p.east_m for w, p in zip(weight, passes, strict=True)) / whole
        off2 = [((p.north_m - north) ** 2 + (p.east_m - east) ** 2) / p.sd_m**2 for p in passes]
        weight = [
            6.0 / (PLACE_DOF + squared) / p.sd_m**2 for squared, p in zip(off2, passes, strict=True)
        ]
    return math.fsum(robust_cost(squared, PLACE_DOF, 2.0) for squared in off2)


def best_split(passes: Sequence[Pass]) -> tuple[int, float] | None:
    """Return where passes of a place, in order of time, split into two best, and what that gains.

    Two at least must be on the later side.
    """
    best: tuple[int, float] | None = None
    whole = scatter(passes)
    for at in range(1, len(passes) - 1):
        gain = whole - scatter(passes[:at]) - scatter(passes[at:])
        if passes[at].time_ns > passes[at - 1].time_ns and (best is None or gain > best[1]):
            best = (at, gain)
    return best


def best_since(passes: Sequence[Pass]) -> int:
    """Return the first of the passes, in order of time, from which on they cost too much."""
    best, most, summed = 0, -math.inf, 0.0
    for at in range(len(passes) - 1, -1, -1):
        summed += passes[at].cost - 2.0 * EXPECTED_COST
        if summed > most:
            best, most = at, summed
    return best


def best_ahead_s(solved: Solved, passes: Sequence[Pass], *, of_responder: bool) -> float:
    """Return by how much a clock may be ahead, from the ways as solved.

    A DAP's peaks happened that much earlier; what is said of a responder is that much later on
    their own clock.
    """
    sign = 1.0 if of_responder else -1.0

    def cost(ahead_s: float) -> float:
        """Return how badly the passes agree, were the clock ahead by so much."""
        shifted = _later(solved, passes, sign * ahead_s)
        if not of_responder:
            return scatter(shifted)
        return math.fsum(_off_cost(solved, each) for each in shifted)

    return min(AHEAD_S, key=cost)


def leans(solved: Solved, passes: Sequence[Pass]) -> float:
    """Return by how much cheaper a responder's passes would be a little sooner, or later.

    A way bends to a clock that is wrong until no pass stands out; but all of them pull one way.
    """
    now, *others = (
        math.fsum(_off_cost(solved, each) for each in _later(solved, passes, by_s))
        for by_s in (0.0, -LEANS_S, LEANS_S)
    )
    return now - min(others)


def _later(solved: Solved, passes: Sequence[Pass], by_s: float) -> list[Pass]:
    """Return passes as they would be by the ways as solved, ``by_s`` later."""
    by_ns = round(by_s * NS_PER_S)
    places = [place_at(solved, each.chain, each.time_ns + by_ns) for each in passes]
    return [
        each._replace(north_m=north_m, east_m=east_m)
        for each, (north_m, east_m) in zip(passes, places, strict=True)
    ]


def _off_cost(solved: Solved, passed: Pass) -> float:
    column = solved.assembled.place_column(solved.assembled.places.index(passed.place))
    north_m, east_m = solved.arrow[column : column + 2].tolist()
    off2 = ((passed.north_m - north_m) ** 2 + (passed.east_m - east_m) ** 2) / passed.sd_m**2
    return robust_cost(off2, PLACE_DOF, 2.0)


def place_at(solved: Solved, index: int, time_ns: int) -> tuple[float, float]:
    """Return where a responder was (m) by the solution."""
    chain, nodes = solved.assembled.chains[index], solved.assembled.nodes[index]
    stance, north_m, east_m = chain.nearest(time_ns)
    at = max(int(np.searchsorted(nodes, stance, side="right")) - 1, 0)
    column = solved.assembled.unit_column(index, int(chain.unit[stance]))
    longer = 1.0 + float(solved.arrow[column])
    way_n, way_e = (chain.way_m[stance] - chain.way_m[nodes[at]]).tolist()
    north_m, east_m = longer * (north_m + way_n), longer * (east_m + way_e)
    node = int(solved.assembled.graph.first[index]) + at
    return carried(solved.pose[node], north_m, east_m)


def by_key(passes: Sequence[Pass], key: Callable[[Pass], str]) -> dict[str, list[Pass]]:
    """Return passes by what ``key`` makes of them, each in the order of time."""
    found: dict[str, list[Pass]] = {}
    for each in sorted(passes, key=lambda each: (each.time_ns, each.chain, each.place)):
        found.setdefault(key(each), []).append(each)
    return found
