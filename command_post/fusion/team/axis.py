"""What straight moves say of a building's axis: where it lies, and whether there is one (pure).

Directions are taken modulo a right angle. Moves one after another in one direction are one *leg*:
they show how somebody is headed all along it, but of a building no more than that one way of theirs
goes there. Legs in one strip of ground, whoever's, to or fro, are of one *corridor*: they agree
whatever the building is like, and only one of them is a witness of its axis.
"""

from __future__ import annotations

import math
from collections.abc import Set as AbstractSet

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.arithmetic import logarithm, nearest_right_angle
from command_post.fusion.team.assembly import Assembled
from command_post.fusion.team.chain import UnitName, straight_moves
from command_post.fusion.team.graph import AXIS, Graph
from command_post.fusion.team.move_log import Floats, Ints
from command_post.fusion.team.settings import TeamSettings
from shared.compiled import compiled
from shared.maths.angles import HALF_PI, nearest_right_angle_rad

AXIS_GRID = 45
BEND_RAD = math.radians(10.0)
"""A move of a leg goes no further off the one before."""
STRIP_M = 1.5
ALONG_COSINE = 0.985
"""A leg of a corridor is no further aside of its first one, in the middle, and 10 degrees off."""
SHORTEST_M = 1e-6
"""What is shorter goes nowhere."""
TURN = 2.0 * math.pi
MOST_ODDS = 1e100


def directions(
    assembled: Assembled, pose: Floats, held: AbstractSet[UnitName], settings: TeamSettings
) -> Floats:
    """Return the ways (k,), in rad in the incident's frame, that legs of ``held`` units go.

    Of who is alone a leg back along the one before shows no other way, and is left out.
    """
    found = [np.empty(0)]
    for index, chain in enumerate(assembled.chains):
        straight, own_rad = straight_moves(chain, assembled.nodes[index], held, settings)
        at = int(assembled.graph.first[index]) + straight
        leg = legs(straight, own_rad)
        along_rad = _means(own_rad + 0.5 * (pose[at, 2] + pose[at + 1, 2]), leg)
        is_alone = len(assembled.chains) == 1
        found.append(along_rad[_turns_off(along_rad)] if is_alone else along_rad)
    return np.concatenate(found)


def _turns_off(direction_rad: Floats) -> NDArray[np.bool_]:
    """Return of each leg (k,) whether it goes neither on nor back along the one before."""
    bend_rad = np.diff(direction_rad)
    bend_rad -= math.pi * np.floor(bend_rad / math.pi + 0.5)
    return np.concatenate([[True], np.abs(bend_rad) > BEND_RAD])[: direction_rad.size]


def legs(node: Ints, direction_rad: Floats) -> Ints:
    """Return which leg (k,) each straight move is of, from the nodes (k,) that moves begin at."""
    bends = np.abs(_wrapped(np.diff(direction_rad))) > BEND_RAD
    begins = np.concatenate([[True], bends | (np.diff(node) != 1)])[: node.size]
    return np.cumsum(begins) - 1


def _means(direction_rad: Floats, leg: Ints) -> Floats:
    """Return the mean direction of each leg, from its moves' own (k,)."""
    first_rad = direction_rad[np.searchsorted(leg, np.arange(leg[-1] + 1 if leg.size else 0))]
    off_rad = np.bincount(leg, _wrapped(direction_rad - first_rad[leg])) if leg.size else first_rad
    return first_rad + off_rad / np.maximum(np.bincount(leg), 1)


def _wrapped(angle_rad: Floats) -> Floats:
    return np.asarray(angle_rad - 2.0 * math.pi * np.floor(angle_rad / (2.0 * math.pi) + 0.5))


def witnesses(graph: Graph, pose: Floats) -> Graph:
    """Return the graph with the straight moves alone of the first leg of each corridor.

    So many walkers as have gone one way agree with each other, and show that the building has that
    way, but no more of an axis than one of them does. Floors lie above each other, and so do their
    corridors.
    """
    nodes = graph.move_at[graph.straight_at, 0]
    leg = legs(nodes, graph.straight[:, 0])
    begins = np.flatnonzero(np.diff(leg, prepend=-1))
    ends = np.append(begins[1:], leg.size)[: begins.size] - 1
    firsts = first_of_corridor(pose[nodes[begins], :2], pose[nodes[ends] + 1, :2])
    is_witness = (firsts == np.arange(firsts.size))[leg]
    return graph._replace(
        straight=graph.straight[is_witness], straight_at=graph.straight_at[is_witness]
    )


@compiled
def first_of_corridor(begin_m: Floats, end_m: Floats) -> Ints:
    """Return for legs from (k, 2) to (k, 2) which leg before is the first of their corridor.

    It is the first in whose strip they lie, beside it at least in part; if there is none, itself.
    """
    first = np.arange(begin_m.shape[0])
    along = end_m - begin_m
    length_m = np.zeros(first.size)
    for leg in range(first.size):
        north_m, east_m = along[leg]
        length_m[leg] = max(math.sqrt(north_m * north_m + east_m * east_m), SHORTEST_M)
        along[leg, 0] /= length_m[leg]
        along[leg, 1] /= length_m[leg]
        for other in range(leg):
            north, east = along[other]
            cosine = along[leg, 0] * north + along[leg, 1] * east
            if first[other] != other or abs(cosine) < ALONG_COSINE:
                continue
            off_north_m = begin_m[leg, 0] - begin_m[other, 0]
            off_east_m = begin_m[leg, 1] - begin_m[other, 1]
            begun_m = off_north_m * north + off_east_m * east
            ended_m = begun_m + length_m[leg] * cosine
            aside_m = (off_east_m + 0.5 * east_m) * north - (off_north_m + 0.5 * north_m) * east
            is_beside = max(begun_m, ended_m) > 0.0 and min(begun_m, ended_m) < length_m[other]
            if is_beside and abs(aside_m) < STRIP_M:
                first[leg] = other
                break
    return first


def told_by_legs(graph: Graph, pose: Floats, arrow: Floats, share: float) -> tuple[float, float]:
    """Return what straight moves cost in the graph, and what their legs cost as they really count.

    Both are twice negative logarithms of likelihoods, the second against legs that go anywhere. By
    the probability ``share`` a leg goes along the axis, and each move is off it as by a Cauchy
    density; else it goes anywhere, each move off the one before as by such a density. So however
    long a leg is, it says no more against an axis than one that is aside of it may.
    """
    nodes = graph.move_at[graph.straight_at, 0]
    off_rad = off_axis_rad(graph, pose, arrow)
    return cost_of_legs(graph.straight, off_rad, legs(nodes, graph.straight[:, 0]), share)


@compiled
def cost_of_legs(straight: Floats, off_rad: Floats, leg: Ints, share: float) -> tuple[float, float]:
    """Return the two costs of :func:`told_by_legs`, of moves (k,) by leg, so far off the axis."""
    of_moves, of_legs, odds = 0.0, 0.0, 1.0
    for row in range(leg.size):
        direction_rad, sd_rad = straight[row]
        off = off_rad[row] / sd_rad
        of_moves += 2.0 * logarithm(1.0 + off * off)
        if row == 0 or leg[row] != leg[row - 1]:
            # A Cauchy density at its middle, over that of a direction anywhere in a right angle.
            odds = 0.5 / sd_rad
        else:
            bend_rad = direction_rad - straight[row - 1, 0]
            bend = (bend_rad - TURN * math.floor(bend_rad / TURN + 0.5)) / sd_rad
            odds = min(odds * (1.0 + bend * bend), MOST_ODDS)
        odds /= 1.0 + off * off
        if row + 1 == leg.size or leg[row + 1] != leg[row]:
            of_legs -= 2.0 * logarithm(share * odds + 1.0 - share)
    return of_moves, of_legs


def off_axis_rad(graph: Graph, pose: Floats, arrow: Floats) -> Floats:
    """Return how far each straight move (s,) is off the axis, or off what is square to it (rad)."""
    nodes = graph.move_at[graph.straight_at, 0]
    along_rad = 0.5 * (pose[nodes, 2] + pose[nodes + 1, 2]) + graph.straight[:, 0]
    off_rad = along_rad - arrow[AXIS]
    return np.asarray(off_rad - nearest_right_angle_rad(off_rad))


def likely_axis(directions_rad: Floats, sd_rad: float) -> float:
    """Return the axis in [0, π/2) that suits directions best, by a grid; 0 if there are none.

    They are off it as by a Cauchy density of that width.
    """
    best_rad, best = 0.0, math.inf
    for step in range(AXIS_GRID if directions_rad.size else 0):
        axis_rad = HALF_PI * step / AXIS_GRID
        cost = _cauchy_cost(directions_rad, axis_rad, sd_rad)
        if cost < best:
            best_rad, best = axis_rad, cost
    return best_rad


@compiled
def _cauchy_cost(directions_rad: Floats, axis_rad: float, sd_rad: float) -> float:
    cost = 0.0
    for direction_rad in directions_rad:
        off_rad = direction_rad - axis_rad
        off = (off_rad - nearest_right_angle(off_rad)) / sd_rad
        cost += logarithm(1.0 + off * off)
    return cost
