"""How high everybody is: apart from the plane, and linear but for its outliers (pure).

A boot's rises add up and drift; what ties them are starts at a known height, somebody's word for a
floor, and DAPs: who passes one so near that its signal peaks is on its floor. All heights are
solved at once, DAPs' with them, by the same elimination as in the plane, on scalars.
"""

from __future__ import annotations

import math
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
    node_variance = np.zeros(n)
    place_variance = np.zeros(p)
    weight = np.ones(graph.tie_sd.size)
    for iteration in range(ITERATIONS):
        diagonal, link, wing, right, arrow, arrow_right = _equations(graph, weight)
        inverse = np.zeros(n)
        for chain in range(graph.first.size - 1):
            for a in range(graph.first[chain], graph.first[chain + 1]):
                inverse[a] = 1.0 / diagonal[a]
                _eliminate(a, inverse[a], wing, right, arrow, arrow_right)
                if a + 1 < graph.first[chain + 1]:
                    share = link[a] * inverse[a]
                    diagonal[a + 1] -= share * link[a]
                    right[a + 1] -= share * right[a]
                    for k in range(p):
                        wing[a + 1, k] -= share * wing[a, k]
        if p and not factorise(arrow):
            return node, np.full(n, math.inf), place, np.full(p, math.inf)
        if p:
            solve_factorised(arrow, arrow_right)
            place = arrow_right
        for chain in range(graph.first.size - 1):
            for a in range(graph.first[chain + 1] - 1, graph.first[chain] - 1, -1):
                total = right[a]
                if a + 1 < graph.first[chain + 1]:
                    total -= link[a] * node[a + 1]
                for k in range(p):
                    total -= wing[a, k] * place[k]
                node[a] = total * inverse[a]
        for row in range(weight.size):
            off = node[graph.tie_at[row, 0]] - place[graph.tie_at[row, 1]]
            squared = (off / graph.tie_sd[row]) ** 2
            weight[row] = (TIE_DOF + 1.0) / (TIE_DOF + squared)
        if iteration == ITERATIONS - 1:
            shared = invert_factorised(arrow) if p else np.zeros((0, 0))
            place_variance = np.diag(shared).copy()
            _variances(graph, inverse, link, wing, shared, node_variance)
    return node, node_variance, place, place_variance


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
    graph: HeightGraph, inverse: Floats, link: Floats, wing: Floats, shared: Floats, found: Floats
) -> None:
    """Write the variance of every node, from each chain's last to its first."""
    p = wing.shape[1]
    cross = np.zeros(p)
    onward = np.zeros(p)
    for chain in range(graph.first.size - 1):
        for a in range(graph.first[chain + 1] - 1, graph.first[chain] - 1, -1):
            has_next = a + 1 < graph.first[chain + 1]
            f = inverse[a] * link[a] if has_next else 0.0
            for column in range(p):
                total = -f * cross[column] if has_next else 0.0
                for k in range(p):
                    total -= inverse[a] * wing[a, k] * shared[k, column]
                onward[column] = total
            variance = inverse[a]
            to_next = -f * found[a + 1] if has_next else 0.0
            for k in range(p):
                g = inverse[a] * wing[a, k]
                variance -= onward[k] * g
                if has_next:
                    to_next -= g * cross[k]
            found[a] = variance - to_next * f
            cross[:] = onward


def storeys(down_m: Floats, weight_m: Floats, apart_m: float, least_m: float) -> Floats:
    """Return the heights (k,) at which people have walked, from the lowest number up.

    ``down_m`` (n,) with ``weight_m`` walked there. The height with most walked about it is a
    storey, then the one with most of what is left at least ``apart_m`` away, down to ``least_m``.
    """
    left = weight_m.copy()
    found: list[float] = []
    while found == [] or left.max(initial=0.0) > 0.0:
        near = np.abs(down_m[:, None] - down_m[None, :]) < 0.25 * apart_m
        about_m = (near * left[None, :]).sum(axis=1)
        best = int(np.argmax(about_m))
        if found and about_m[best] < least_m:
            break
        members = near[best] & (left > 0.0)
        if not members.any():
            break
        level_m = float((down_m[members] * left[members]).sum() / left[members].sum())
        if all(abs(level_m - other) >= 0.75 * apart_m for other in found):
            found.append(level_m)
        left[np.abs(down_m - down_m[best]) < 0.5 * apart_m] = 0.0
    return np.array(sorted(found))


def storey_shares(down_m: float, sd_m: float, levels_m: Floats) -> list[tuple[float, float]]:
    """Return each storey and the probability of being on it, likeliest first.

    The normal density of the height, cut half-way between neighbouring storeys.
    """
    cuts = [-math.inf, *((levels_m[1:] + levels_m[:-1]) / 2.0).tolist(), math.inf]
    below = [_normal((cut - down_m) / max(sd_m, 1e-3)) for cut in cuts]
    shares = [high - low for low, high in zip(below[:-1], below[1:], strict=True)]
    return sorted(
        zip(levels_m.tolist(), shares, strict=True), key=lambda each: (-each[1], each[0])
    )


def _normal(deviations: float) -> float:
    return 0.5 * (1.0 + math.erf(deviations / math.sqrt(2.0)))
