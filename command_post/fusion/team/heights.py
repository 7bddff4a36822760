"""How high everybody is: apart from the plane, and linear but for its outliers (pure).

A boot's rises add up and drift; what ties them are starts at a known height, somebody's word for a
floor, and DAPs: who passes one so near that its signal peaks is on its floor. All heights are
solved at once, DAPs' with them, by the same elimination as in the plane, on scalars.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.arithmetic import (
    factorise,
    invert_factorised,
    solve_factorised,
)
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]

ITERATIONS = 4
TIE_DOF = 2.0
BIN_M = 0.25
REACH = 3
"""Bins to either side of a storey's height that belong to it."""

LEAST_WALKED_M = 4.0
STOREY_AT_LEAST_M = 2.0


class HeightGraph(NamedTuple):
    """What ties heights together, all in metres down.

    Nodes and chains as in ``Graph``: ``first`` (R + 1,). ``move`` (m, 2) is a node's way down to
    the next and its standard deviation, ``move_at`` (m,) that node. ``tie_sd`` (t,) is how far off
    a place's floor one may pass it, ``tie_at`` (t, 2) node and place. ``fix`` (f, 2) is a height
    and its standard deviation, ``fix_at`` (f,) its node. ``place`` (p, 2) is what is known of
    each place beforehand.
    """

    first: Ints
    move: Floats
    move_at: Ints
    tie_sd: Floats
    tie_at: Ints
    fix: Floats
    fix_at: Ints
    place: Floats


@compiled
def smooth_heights(graph: HeightGraph) -> tuple[Floats, Floats, Floats, Floats]:
    """Return nodes' heights and variances (n,), and places' (p,): m down, m².

    Ties are weighed anew a few times, Student's t: through a ceiling a signal may peak as well.
    """
    n = graph.first[-1]
    p = graph.place.shape[0]
    node = np.zeros(n)
    place = graph.place[:, 0].copy()
    shared = np.zeros((p, p))
    inverse = np.zeros(n)
    link = np.zeros(n)
    wing = np.zeros((n, p))
    weight = np.ones(graph.tie_sd.size)
    for _ in range(ITERATIONS):
        diagonal, link, wing, right, arrow, arrow_right = _equations(graph, weight)
        inverse = _eliminate_all(graph, diagonal, link, wing, right, arrow, arrow_right)
        if p and not factorise(arrow):
            return node, np.full(n, math.inf), place, np.full(p, math.inf)
        if p:
            solve_factorised(arrow, arrow_right)
            place = arrow_right
            shared = invert_factorised(arrow)
        _go_back(graph, inverse, link, wing, right, place, node)
        for row in range(weight.size):
            off = node[graph.tie_at[row, 0]] - place[graph.tie_at[row, 1]]
            weight[row] = (TIE_DOF + 1.0) / (TIE_DOF + (off / graph.tie_sd[row]) ** 2)
    variance = _variances(graph, inverse, link, wing, shared)
    return node, variance, place, np.diag(shared).copy()


@compiled
def _eliminate_all(
    graph: HeightGraph, diagonal: Floats, link: Floats, wing: Floats, right: Floats,
    arrow: Floats, arrow_right: Floats,
) -> Floats:  # fmt: skip
    """Eliminate all nodes into the arrow's equations; return their inverses (n,)."""
    inverse = np.zeros(diagonal.size)
    for chain in range(graph.first.size - 1):
        for a in range(graph.first[chain], graph.first[chain + 1]):
            inverse[a] = 1.0 / diagonal[a]
            _eliminate(a, inverse[a], wing, right, arrow, arrow_right)
            if a + 1 < graph.first[chain + 1]:
                share = link[a] * inverse[a]
                diagonal[a + 1] -= share * link[a]
                right[a + 1] -= share * right[a]
                for k in range(wing.shape[1]):
                    wing[a + 1, k] -= share * wing[a, k]
    return inverse


@compiled
def _go_back(
    graph: HeightGraph, inverse: Floats, link: Floats, wing: Floats, right: Floats,
    place: Floats, node: Floats,
) -> None:  # fmt: skip
    """Write all nodes' heights, from each chain's last to its first."""
    for chain in range(graph.first.size - 1):
        for a in range(graph.first[chain + 1] - 1, graph.first[chain] - 1, -1):
            total = right[a]
            if a + 1 < graph.first[chain + 1]:
                total -= link[a] * node[a + 1]
            for k in range(place.size):
                total -= wing[a, k] * place[k]
            node[a] = total * inverse[a]


@compiled
def _equations(
    graph: HeightGraph, weight: Floats
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    """Return diagonal (n,), link to the next (n,), wing (n, p), right (n,), arrow and its right."""
    n = graph.first[-1]
    p = graph.place.shape[0]
    diagonal = np.zeros(n)
    link = np.zeros(n)
    wing = np.zeros((n, p))
    right = np.zeros(n)
    arrow = np.zeros((p, p))
    arrow_right = np.zeros(p)
    for row in range(graph.move_at.size):
        a = graph.move_at[row]
        down_m, sd_m = graph.move[row]
        k = 1.0 / (sd_m * sd_m)
        diagonal[a] += k
        diagonal[a + 1] += k
        link[a] -= k
        right[a] -= k * down_m
        right[a + 1] += k * down_m
    for row in range(graph.tie_sd.size):
        a, place = graph.tie_at[row]
        k = weight[row] / graph.tie_sd[row] ** 2
        diagonal[a] += k
        wing[a, place] -= k
        arrow[place, place] += k
    for row in range(graph.fix_at.size):
        k = 1.0 / graph.fix[row, 1] ** 2
        diagonal[graph.fix_at[row]] += k
        right[graph.fix_at[row]] += k * graph.fix[row, 0]
    for place in range(p):
        k = 1.0 / graph.place[place, 1] ** 2
        arrow[place, place] += k
        arrow_right[place] += k * graph.place[place, 0]
    return diagonal, link, wing, right, arrow, arrow_right


@compiled
def _eliminate(
    a: int, inverse: float, wing: Floats, right: Floats, arrow: Floats, arrow_right: Floats
) -> None:
    """Take node ``a`` out of the arrow's equations."""
    for row in range(wing.shape[1]):
        weight = wing[a, row] * inverse
        if weight != 0.0:
            arrow_right[row] -= weight * right[a]
            for column in range(row + 1):
                arrow[row, column] -= weight * wing[a, column]


@compiled
def _variances(
    graph: HeightGraph, inverse: Floats, link: Floats, wing: Floats, shared: Floats
) -> Floats:
    """Return the variance of every node (n,), found from each chain's last to its first."""
    p = wing.shape[1]
    found = np.zeros(inverse.size)
    cross = np.zeros(p)
    onward = np.zeros(p)
    for chain in range(graph.first.size - 1):
        # Nothing follows a chain's last node: its link is nought, and so is what comes of it.
        cross[:] = 0.0
        following = 0.0
        for a in range(graph.first[chain + 1] - 1, graph.first[chain] - 1, -1):
            f = inverse[a] * link[a]
            to_next = -f * following
            for column in range(p):
                onward[column] = -f * cross[column]
                for k in range(p):
                    onward[column] -= inverse[a] * wing[a, k] * shared[k, column]
            following = inverse[a]
            for k in range(p):
                following -= onward[k] * inverse[a] * wing[a, k]
                to_next -= inverse[a] * wing[a, k] * cross[k]
            following -= to_next * f
            found[a] = following
            cross[:] = onward
    return found


def storeys(down_m: Floats, walked_m: Floats) -> Floats:
    """Return the heights (k,) on which people have walked, ascending; none if nobody has.

    ``walked_m`` (n,) is how far on the level at each of ``down_m`` (n,). The height about which
    most was walked is a storey, then the one with most of what is left a storey's height away.
    """
    bins = np.floor(down_m / BIN_M + 0.5).astype(np.int64)
    order = np.argsort(bins, kind="stable")
    numbers, first = np.unique(bins[order], return_index=True)
    of_bin = dict(zip(numbers.tolist(), pairwise([*first.tolist(), bins.size]), strict=True))
    lengths_m, moments = walked_m[order].tolist(), (walked_m * down_m)[order].tolist()
    left = {each: math.fsum(lengths_m[slice(*rows)]) for each, rows in of_bin.items()}
    found: list[float] = []
    while left:
        about = {
            each: math.fsum(left.get(each + off, 0.0) for off in range(-REACH, REACH + 1))
            for each in left
        }
        best = max(about, key=lambda each: (about[each], -abs(each)))
        if about[best] < LEAST_WALKED_M:
            break
        near = [each for each in left if abs(each - best) <= REACH]
        level_m = math.fsum(m for each in near for m in moments[slice(*of_bin[each])]) / about[best]
        if all(abs(level_m - other_m) >= STOREY_AT_LEAST_M for other_m in found):
            found.append(level_m)
        left = {e: w for e, w in left.items() if abs(e - best) > REACH}
    return np.array(sorted(found))


def with_known(levels_m: Sequence[float], known_m: Sequence[float]) -> list[float]:
    """Return storeys (ascending) together with those known before that none of them is."""
    others = [
        known for known in known_m
        if all(abs(known - level_m) >= STOREY_AT_LEAST_M for level_m in levels_m)
    ]  # fmt: skip
    return sorted([*levels_m, *others])


def storey_shares(
    down_m: float, sd_m: float, levels_m: Sequence[float]
) -> list[tuple[float, float]]:
    """Return each storey and the probability of being on it, likeliest first.

    The normal density of the height, cut half-way between neighbouring storeys.
    """
    if len(levels_m) < 2:
        return [(level_m, 1.0) for level_m in levels_m]
    cuts = ((high + low) / 2.0 for low, high in pairwise(levels_m))
    below = [0.0, *(_normal((cut - down_m) / max(sd_m, 1e-3)) for cut in cuts), 1.0]
    shares = [high - low for low, high in pairwise(below)]
    return sorted(zip(levels_m, shares, strict=True), key=lambda each: (-each[1], each[0]))


def _normal(deviations: float) -> float:
    return 0.5 * (1.0 + math.erf(deviations / math.sqrt(2.0)))
