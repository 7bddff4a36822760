"""The whole team at once: robust Gauss-Newton on a graph shaped like an arrow.

Iteratively reweighted least squares with Student's t, in numba; ``smoother_plain.py`` says the
same with dense matrices. Chains are eliminated node by node, each carrying only those columns of
the arrow that it has touched so far; what is left is the arrow's own, small, dense system. Every
sum is taken in one fixed order and with our own arithmetic, so that the same graph and start give
the same bits on any machine.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.arithmetic import (
    factorise,
    invert_factorised,
    logarithm,
    sine_cosine,
    solve_factorised,
)
from command_post.fusion.team.graph import LARGEST_TURN_RAD, PLACE_DOF, TURN_DOF, Graph
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]

HALF_PI = math.pi / 2.0
NO_COVARIANCE, ENDS_ONLY, EVERY_NODE = 0, 1, 2


class _System(NamedTuple):
    """The normal equations: blocks of nodes (n, 3, 3), of each with the next, with the arrow.

    ``wing`` is flat: node ``a`` has three rows of ``width[a]`` from ``wing_at[a]``. ``inverse``
    takes the inverses of the eliminated blocks. Of ``arrow`` only the lower triangle counts.
    """

    node: Floats
    link: Floats
    inverse: Floats
    wing: Floats
    wing_at: Ints
    right: Floats
    arrow: Floats
    arrow_right: Floats


class Covariance(NamedTuple):
    """Of nodes (n, 6: nn, ne, ee, turn with turn, north and east) and of the arrow (A, A)."""

    node: Floats
    arrow: Floats


@compiled
def smooth(
    graph: Graph, pose: Floats, arrow: Floats, iterations: int, settled_m: float, covariance: int
) -> tuple[float, int, Floats, Floats]:
    """Improve ``pose`` (n, 3) and ``arrow`` (A,) in place, until no place moves ``settled_m``.

    Returns the cost before the last step (twice the negative log-posterior, up to a constant), the
    iterations made, and covariances as in :class:`Covariance`: none, of each chain's last node
    and the arrow, or of all, as ``covariance`` says. A cost of infinity says that the equations
    could not be solved; pose and arrow are then as they were.
    """
    system = _empty_system(graph, arrow.size)
    ends_at = np.zeros((graph.first.size - 1, 6))
    nothing = np.zeros((0, 0))
    cost = 0.0
    made = 0
    for made in range(1, iterations + 1):
        cost = _linearise(graph, pose, arrow, system)
        _eliminate(graph, system)
        if not factorise(system.arrow):
            return math.inf, made, ends_at, nothing
        solve_factorised(system.arrow, system.arrow_right)
        if _step(graph, system, pose, arrow) < settled_m:
            break
    if covariance == NO_COVARIANCE:
        return cost, made, ends_at, nothing
    shared = invert_factorised(system.arrow)
    return cost, made, _marginals(graph, system, shared, covariance), shared


@compiled
def _empty_system(graph: Graph, arrow_size: int) -> _System:
    n = graph.width.size
    wing_at = np.zeros(n + 1, np.int64)
    for node in range(n):
        wing_at[node + 1] = wing_at[node] + 3 * graph.width[node]
    return _System(
        np.zeros((n, 3, 3)),
        np.zeros((n, 3, 3)),
        np.zeros((n, 3, 3)),
        np.zeros(wing_at[n]),
        wing_at,
        np.zeros((n, 3)),
        np.zeros((arrow_size, arrow_size)),
        np.zeros(arrow_size),
    )


@compiled
def _linearise(graph: Graph, pose: Floats, arrow: Floats, system: _System) -> float:
    """Fill ``system`` with the normal equations about pose and arrow; return the cost there."""
    system.node[:] = 0.0
    system.link[:] = 0.0
    system.wing[:] = 0.0
    system.right[:] = 0.0
    system.arrow[:] = 0.0
    system.arrow_right[:] = 0.0
    cost = _add_moves(graph, pose, arrow, system)
    cost += _add_ties(graph, pose, arrow, system)
    cost += _add_fixes(graph, pose, system)
    cost += _add_turns(graph, pose, system)
    cost += _add_straights(graph, pose, arrow, system)
    return cost + _add_priors(graph, arrow, system)


@compiled
def _robust(squared: float, dof: float, dimension: float) -> tuple[float, float]:
    """Return the weight and the cost of a residual of that squared length, in its own units."""
    if dof <= 0.0:
        return 1.0, squared
    weight = (dof + dimension) / (dof + squared)
    return weight, (dof + dimension) * logarithm(1.0 + squared / dof)


@compiled
def _add_moves(graph: Graph, pose: Floats, arrow: Floats, system: _System) -> float:
    cost = 0.0
    for row in range(graph.move.shape[0]):
        a = graph.move_at[row, 0]
        c = a + 1
        scale = graph.move_at[row, 1]
        north, east, duration_s, sd_m, sd_rad = graph.move[row]
        sine, cosine = sine_cosine(0.5 * (pose[a, 2] + pose[c, 2]))
        vn = cosine * north - sine * east
        ve = sine * north + cosine * east
        un = (1.0 + arrow[scale]) * vn
        ue = (1.0 + arrow[scale]) * ve
        rn = pose[c, 0] - pose[a, 0] - un
        re = pose[c, 1] - pose[a, 1] - ue
        weight, penalty = _robust((rn * rn + re * re) / (sd_m * sd_m), PLACE_DOF, 2.0)
        cost += penalty
        k = weight / (sd_m * sd_m)
        # Derivatives by either end's turn; by the ends' places they are -1 and +1.
        gn = 0.5 * ue
        ge = -0.5 * un
        _add_move_place(graph, system, row, k, (gn, ge, vn, ve, rn, re))
        rt = pose[c, 2] - pose[a, 2] - arrow[scale + 1] * duration_s
        weight, penalty = _robust((rt / sd_rad) ** 2, TURN_DOF, 1.0)
        cost += penalty
        _add_move_turn(graph, system, row, weight / (sd_rad * sd_rad), rt)
    return cost


@compiled
def _add_move_place(
    graph: Graph,
    system: _System,
    row: int,
    k: float,
    terms: tuple[float, float, float, float, float, float],
) -> None:
    """Add a move's two residuals of place, of precision ``k``."""
    gn, ge, vn, ve, rn, re = terms
    a = graph.move_at[row, 0]
    c = a + 1
    scale = graph.move_at[row, 1]
    local = graph.move_at[row, 2]
    gg = k * (gn * gn + ge * ge)
    for node, sign in ((a, -1.0), (c, 1.0)):
        system.node[node, 0, 0] += k
        system.node[node, 1, 1] += k
        system.node[node, 2, 2] += gg
        system.node[node, 0, 2] += sign * k * gn
        system.node[node, 1, 2] += sign * k * ge
        wing = system.wing_at[node] + local
        width = graph.width[node]
        system.wing[wing] -= sign * k * vn
        system.wing[wing + width] -= sign * k * ve
        system.wing[wing + 2 * width] -= k * (gn * vn + ge * ve)
        system.right[node, 0] -= sign * k * rn
        system.right[node, 1] -= sign * k * re
        system.right[node, 2] -= k * (gn * rn + ge * re)
    link = system.link[a]
    link[0, 0] -= k
    link[1, 1] -= k
    link[0, 2] -= k * gn
    link[1, 2] -= k * ge
    link[2, 0] += k * gn
    link[2, 1] += k * ge
    link[2, 2] += gg
    system.arrow[scale, scale] += k * (vn * vn + ve * ve)
    system.arrow_right[scale] += k * (vn * rn + ve * re)


@compiled
def _add_move_turn(graph: Graph, system: _System, row: int, k: float, residual: float) -> None:
    """Add a move's residual of turn, of precision ``k``."""
    a = graph.move_at[row, 0]
    c = a + 1
    drift = graph.move_at[row, 1] + 1
    local = graph.move_at[row, 2] + 1
    duration_s = graph.move[row, 2]
    system.node[a, 2, 2] += k
    system.node[c, 2, 2] += k
    system.link[a, 2, 2] -= k
    system.wing[system.wing_at[a] + 2 * graph.width[a] + local] += k * duration_s
    system.wing[system.wing_at[c] + 2 * graph.width[c] + local] -= k * duration_s
    system.right[a, 2] += k * residual
    system.right[c, 2] -= k * residual
    system.arrow[drift, drift] += k * duration_s * duration_s
    system.arrow_right[drift] += k * duration_s * residual


@compiled
def _add_point(
    system: _System, node: int, k: float, gn: float, ge: float, rn: float, re: float
) -> None:
    """Add residuals of a point carried along with a node, of derivatives 1 and (gn, ge)."""
    system.node[node, 0, 0] += k
    system.node[node, 1, 1] += k
    system.node[node, 0, 2] += k * gn
    system.node[node, 1, 2] += k * ge
    system.node[node, 2, 2] += k * (gn * gn + ge * ge)
    system.right[node, 0] -= k * rn
    system.right[node, 1] -= k * re
    system.right[node, 2] -= k * (gn * rn + ge * re)


@compiled
def _add_ties(graph: Graph, pose: Floats, arrow: Floats, system: _System) -> float:
    cost = 0.0
    for row in range(graph.tie.shape[0]):
        a = graph.tie_at[row, 0]
        place = graph.tie_at[row, 1]
        north, east, sd_m, dof = graph.tie[row]
        sine, cosine = sine_cosine(pose[a, 2])
        on = cosine * north - sine * east
        oe = sine * north + cosine * east
        rn = pose[a, 0] + on - arrow[place]
        re = pose[a, 1] + oe - arrow[place + 1]
        weight, penalty = _robust((rn * rn + re * re) / (sd_m * sd_m), dof, 2.0)
        cost += penalty
        k = weight / (sd_m * sd_m)
        _add_point(system, a, k, -oe, on, rn, re)
        width = graph.width[a]
        wing = system.wing_at[a] + graph.tie_at[row, 2]
        system.wing[wing] -= k
        system.wing[wing + width + 1] -= k
        system.wing[wing + 2 * width] += k * oe
        system.wing[wing + 2 * width + 1] -= k * on
        system.arrow[place, place] += k
        system.arrow[place + 1, place + 1] += k
        system.arrow_right[place] += k * rn
        system.arrow_right[place + 1] += k * re
    return cost


@compiled
def _add_fixes(graph: Graph, pose: Floats, system: _System) -> float:
    cost = 0.0
    for row in range(graph.fix.shape[0]):
        a = graph.fix_at[row]
        north, east, place_north, place_east, sd_m, dof = graph.fix[row]
        sine, cosine = sine_cosine(pose[a, 2])
        on = cosine * north - sine * east
        oe = sine * north + cosine * east
        rn = pose[a, 0] + on - place_north
        re = pose[a, 1] + oe - place_east
        weight, penalty = _robust((rn * rn + re * re) / (sd_m * sd_m), dof, 2.0)
        cost += penalty
        _add_point(system, a, weight / (sd_m * sd_m), -oe, on, rn, re)
    return cost


@compiled
def _add_turns(graph: Graph, pose: Floats, system: _System) -> float:
    cost = 0.0
    for row in range(graph.turn.shape[0]):
        a = graph.turn_at[row]
        turn_rad, sd_rad = graph.turn[row]
        off_rad = pose[a, 2] - turn_rad
        off_rad -= 2.0 * math.pi * math.floor(off_rad / (2.0 * math.pi) + 0.5)
        k = 1.0 / (sd_rad * sd_rad)
        cost += k * off_rad * off_rad
        system.node[a, 2, 2] += k
        system.right[a, 2] -= k * off_rad
    return cost


@compiled
def _add_straights(graph: Graph, pose: Floats, arrow: Floats, system: _System) -> float:
    """Straight moves follow the axis, or are square to it; Cauchy, for many do not."""
    cost = 0.0
    for row in range(graph.straight.shape[0]):
        a = graph.move_at[graph.straight_at[row], 0]
        c = a + 1
        direction_rad, sd_rad = graph.straight[row]
        off_rad = 0.5 * (pose[a, 2] + pose[c, 2]) + direction_rad - arrow[0]
        off_rad -= HALF_PI * math.floor(off_rad / HALF_PI + 0.5)
        weight, penalty = _robust((off_rad / sd_rad) ** 2, 1.0, 1.0)
        cost += penalty
        k = weight / (sd_rad * sd_rad)
        for node in (a, c):
            system.node[node, 2, 2] += 0.25 * k
            system.right[node, 2] -= 0.5 * k * off_rad
            system.wing[system.wing_at[node] + 2 * graph.width[node]] -= 0.5 * k
        system.link[a, 2, 2] += 0.25 * k
        system.arrow[0, 0] += k
        system.arrow_right[0] += k * off_rad
    return cost


@compiled
def _add_priors(graph: Graph, arrow: Floats, system: _System) -> float:
    k = 1.0 / graph.axis[1] ** 2
    off_rad = arrow[0] - graph.axis[0]
    cost = k * off_rad * off_rad
    system.arrow[0, 0] += k
    system.arrow_right[0] -= k * off_rad
    places_from = arrow.size - 2 * graph.place.shape[0]
    for column in range(1, places_from):
        k = 1.0 / graph.unit_sd[(column - 1) % 2] ** 2
        cost += k * arrow[column] ** 2
        system.arrow[column, column] += k
        system.arrow_right[column] -= k * arrow[column]
    for place in range(graph.place.shape[0]):
        k = 1.0 / graph.place[place, 2] ** 2
        for axis in range(2):
            column = places_from + 2 * place + axis
            off_m = arrow[column] - graph.place[place, axis]
            cost += k * off_m * off_m
            system.arrow[column, column] += k
            system.arrow_right[column] -= k * off_m
    return cost


@compiled
def _invert_block(block: Floats, inverse: Floats) -> None:
    """Write the inverse of a symmetric (3, 3) ``block``, given by its upper triangle."""
    a, b, c = block[0, 0], block[0, 1], block[0, 2]
    d, e, f = block[1, 1], block[1, 2], block[2, 2]
    p = d * f - e * e
    q = c * e - b * f
    r = b * e - c * d
    over = 1.0 / (a * p + b * q + c * r)
    inverse[0, 0] = p * over
    inverse[0, 1] = inverse[1, 0] = q * over
    inverse[0, 2] = inverse[2, 0] = r * over
    inverse[1, 1] = (a * f - c * c) * over
    inverse[1, 2] = inverse[2, 1] = (b * c - a * e) * over
    inverse[2, 2] = (a * d - b * b) * over


@compiled
def _times(one: Floats, other: Floats) -> Floats:
    """Return the product of (3, 3) and (3, k), summed in one order, as a library's need not be."""
    product = np.zeros((3, other.shape[1]))
    for row in range(3):
        for column in range(other.shape[1]):
            for k in range(3):
                product[row, column] += one[row, k] * other[k, column]
    return product


@compiled
def _eliminate(graph: Graph, system: _System) -> None:
    """Eliminate all nodes, chain by chain, into the arrow's own equations."""
    for chain in range(graph.first.size - 1):
        start, end = graph.first[chain], graph.first[chain + 1]
        columns = graph.columns[graph.columns_first[chain] : graph.columns_first[chain + 1]]
        schur = np.zeros((columns.size, columns.size))
        right = np.zeros(columns.size)
        share = np.zeros((3, columns.size))
        for a in range(start, end):
            _invert_block(system.node[a], system.inverse[a])
            inverse = system.inverse[a]
            width = graph.width[a]
            wing = system.wing[system.wing_at[a] : system.wing_at[a + 1]].reshape(3, width)
            for row in range(3):
                i0, i1, i2 = inverse[row]
                for column in range(width):
                    share[row, column] = (
                        i0 * wing[0, column] + i1 * wing[1, column] + i2 * wing[2, column]
                    )
            y = _times(inverse, system.right[a].reshape(3, 1))[:, 0]
            for row in range(width):
                w0, w1, w2 = wing[0, row], wing[1, row], wing[2, row]
                right[row] -= w0 * y[0] + w1 * y[1] + w2 * y[2]
                for column in range(row + 1):
                    schur[row, column] -= (
                        w0 * share[0, column] + w1 * share[1, column] + w2 * share[2, column]
                    )
            if a + 1 < end:
                _carry_on(graph, system, a, y, share)
        for row in range(columns.size):
            system.arrow_right[columns[row]] += right[row]
            for column in range(row + 1):
                low = max(columns[row], columns[column])
                high = min(columns[row], columns[column])
                system.arrow[low, high] += schur[row, column]


@compiled
def _carry_on(graph: Graph, system: _System, a: int, y: Floats, share: Floats) -> None:
    """Take what node ``a`` knew over to the next node of its chain."""
    link = system.link[a]
    inverse = system.inverse[a]
    onward = system.wing[system.wing_at[a + 1] :]
    onward_width = graph.width[a + 1]
    for row in range(3):
        l0, l1, l2 = link[0, row], link[1, row], link[2, row]
        system.right[a + 1, row] -= l0 * y[0] + l1 * y[1] + l2 * y[2]
        for column in range(3):
            total = 0.0
            for k in range(3):
                total += (
                    l0 * inverse[0, k] + l1 * inverse[1, k] + l2 * inverse[2, k]
                ) * link[k, column]
            system.node[a + 1, row, column] -= total
        for column in range(graph.width[a]):
            onward[row * onward_width + column] -= (
                l0 * share[0, column] + l1 * share[1, column] + l2 * share[2, column]
            )


@compiled
def _step(graph: Graph, system: _System, pose: Floats, arrow: Floats) -> float:
    """Go back through the chains and take the step; return how far it moves a place at most."""
    change = np.zeros((graph.width.size, 3))
    furthest_m = 0.0
    furthest_rad = 0.0
    for chain in range(graph.first.size - 1):
        start, end = graph.first[chain], graph.first[chain + 1]
        columns = graph.columns[graph.columns_first[chain] : graph.columns_first[chain + 1]]
        rest = np.zeros(3)
        for a in range(end - 1, start - 1, -1):
            width = graph.width[a]
            wing = system.wing[system.wing_at[a] : system.wing_at[a + 1]].reshape(3, width)
            for row in range(3):
                total = system.right[a, row]
                for column in range(width):
                    total -= wing[row, column] * system.arrow_right[columns[column]]
                if a + 1 < end:
                    for k in range(3):
                        total -= system.link[a, row, k] * change[a + 1, k]
                rest[row] = total
            for row in range(3):
                i0, i1, i2 = system.inverse[a, row]
                change[a, row] = i0 * rest[0] + i1 * rest[1] + i2 * rest[2]
            furthest_m = max(furthest_m, abs(change[a, 0]), abs(change[a, 1]))
            furthest_rad = max(furthest_rad, abs(change[a, 2]))
    share = 1.0
    if furthest_rad > LARGEST_TURN_RAD:
        share = LARGEST_TURN_RAD / furthest_rad
    for a in range(change.shape[0]):
        for row in range(3):
            pose[a, row] += share * change[a, row]
    for column in range(arrow.size):
        arrow[column] += share * system.arrow_right[column]
    return furthest_m


@compiled
def _marginals(graph: Graph, system: _System, shared: Floats, which: int) -> Floats:
    """Return nodes' covariances (see :class:`Covariance`): (R, 6) of the ends, or (n, 6) of all."""
    chains = graph.first.size - 1
    found = np.zeros((graph.width.size if which == EVERY_NODE else chains, 6))
    for chain in range(chains):
        start, end = graph.first[chain], graph.first[chain + 1]
        columns = graph.columns[graph.columns_first[chain] : graph.columns_first[chain + 1]]
        own = np.zeros((columns.size, columns.size))
        for row in range(columns.size):
            for column in range(columns.size):
                own[row, column] = shared[columns[row], columns[column]]
        node = np.zeros((3, 3))
        cross = np.zeros((3, columns.size))
        last = start if which == EVERY_NODE else end - 1
        for a in range(end - 1, last - 1, -1):
            _marginal(graph, system, own, a, a + 1 < end, node, cross)
            row = a if which == EVERY_NODE else chain
            found[row, 0] = node[0, 0]
            found[row, 1] = node[0, 1]
            found[row, 2] = node[1, 1]
            found[row, 3] = node[2, 2]
            found[row, 4] = node[0, 2]
            found[row, 5] = node[1, 2]
    return found


@compiled
def _marginal(
    graph: Graph,
    system: _System,
    own: Floats,
    a: int,
    has_next: bool,
    node: Floats,
    cross: Floats,
) -> None:
    """Go from the next node's covariance to ``a``'s: ``node`` its own, ``cross`` with the arrow.

    A node is what is left to it, less G times the arrow and F times the next node, so that its
    covariance is D⁻¹ + [G F] Σ [G F]ᵀ.
    """
    width = graph.width[a]
    inverse = system.inverse[a]
    wing = system.wing[system.wing_at[a] : system.wing_at[a + 1]].reshape(3, width)
    g = np.zeros((3, width))
    for row in range(3):
        i0, i1, i2 = inverse[row]
        for column in range(width):
            g[row, column] = i0 * wing[0, column] + i1 * wing[1, column] + i2 * wing[2, column]
    to_arrow = np.zeros((3, width))
    for row in range(3):
        for k in range(width):
            weight = g[row, k]
            if weight != 0.0:
                for column in range(width):
                    to_arrow[row, column] -= weight * own[k, column]
    to_next = np.zeros((3, 3))
    f = np.zeros((3, 3))
    if has_next:
        f = _times(inverse, system.link[a])
        to_next = -_times(f, node)
        for row in range(3):
            for column in range(3):
                for k in range(width):
                    to_next[row, column] -= g[row, k] * cross[column, k]
            for column in range(width):
                for k in range(3):
                    to_arrow[row, column] -= f[row, k] * cross[k, column]
    for row in range(3):
        for column in range(3):
            total = inverse[row, column]
            for k in range(width):
                total -= to_arrow[row, k] * g[column, k]
            for k in range(3):
                total -= to_next[row, k] * f[column, k]
            node[row, column] = total
    for row in range(3):
        for column in range(width):
            cross[row, column] = to_arrow[row, column]
