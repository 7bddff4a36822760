"""What straight moves say of a building's axis: where it lies, and whether there is one (pure).

Directions are taken modulo a right angle. Moves one after another in one direction are one *leg*:
they show how somebody is headed all along it, but of a building no more than that one way of theirs
goes there.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from collections.abc import Set as AbstractSet

import numpy as np

from command_post.fusion.team.arithmetic import logarithm, nearest_right_angle
from command_post.fusion.team.assembly import Assembled
from command_post.fusion.team.chain import UnitName, straight_moves
from command_post.fusion.team.graph import AXIS, Graph
from command_post.fusion.team.log import Floats, Ints
from command_post.fusion.team.settings import TeamSettings
from shared.compiled import compiled
from shared.maths.angles import HALF_PI, nearest_right_angle_rad

AXIS_GRID = 45
ALONG_RAD = math.radians(10.0)
"""A move along an axis is off it by no more."""


def directions(
    assembled: Assembled, pose: Floats, held: AbstractSet[UnitName], settings: TeamSettings
) -> list[Floats]:
    """Return the ways (rad, in the incident's frame) that legs of ``held`` units go.

    They are by responder.
    """
    found = []
    for index, chain in enumerate(assembled.chains):
        straight, own_rad = straight_moves(chain, assembled.nodes[index], held, settings)
        at = int(assembled.graph.first[index]) + straight
        leg = legs(straight, own_rad)
        found.append(_means(own_rad + 0.5 * (pose[at, 2] + pose[at + 1, 2]), leg))
    return found


def legs(node: Ints, direction_rad: Floats) -> Ints:
    """Return which leg (k,) each straight move is of, from the nodes (k,) that moves begin at."""
    bends = np.abs(_wrapped(np.diff(direction_rad))) > ALONG_RAD
    begins = np.concatenate([[True], bends | (np.diff(node) != 1)])[: node.size]
    return np.cumsum(begins) - 1


def _means(direction_rad: Floats, leg: Ints) -> Floats:
    """Return the mean direction of each leg, from its moves' own (k,)."""
    first_rad = direction_rad[np.searchsorted(leg, np.arange(leg[-1] + 1 if leg.size else 0))]
    off_rad = np.bincount(leg, _wrapped(direction_rad - first_rad[leg])) if leg.size else first_rad
    return first_rad + off_rad / np.maximum(np.bincount(leg), 1)


def _wrapped(angle_rad: Floats) -> Floats:
    return np.asarray(angle_rad - 2.0 * math.pi * np.floor(angle_rad / (2.0 * math.pi) + 0.5))


def by_leg(graph: Graph, pose: Floats, arrow: Floats) -> tuple[int, float]:
    """Return how many legs are held to the axis, and what moves cost beyond one of each leg's."""
    nodes = graph.move_at[graph.straight_at, 0]
    leg = legs(nodes, graph.straight[:, 0])
    if not leg.size:
        return 0, 0.0
    cost = np.array(
        [
            2.0 * logarithm(1.0 + off2)
            for off2 in (
                (_off_axis(graph, pose, arrow, nodes) / graph.straight[:, 1]) ** 2
            ).tolist()
        ]
    )
    count = int(leg[-1]) + 1
    return count, math.fsum(cost.tolist()) - math.fsum(
        (np.bincount(leg, cost) / np.bincount(leg)).tolist()
    )


def _off_axis(graph: Graph, pose: Floats, arrow: Floats, nodes: Ints) -> Floats:
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


def share_along(several_rad: Collection[Floats], sd_rad: float) -> float:
    """Return which share of directions lies along the axis that suits each responder's own best.

    In a building with an axis that is most of them; where ways bend or go anywhere, little more
    than chance makes it. 0 if there are none.
    """
    along = 0
    for directions_rad in several_rad:
        off_rad = _off_rad(directions_rad, likely_axis(directions_rad, sd_rad))
        along += int((np.abs(off_rad) < ALONG_RAD).sum())
    return along / max(sum(each.size for each in several_rad), 1)


def _off_rad(directions_rad: Floats, axis_rad: float) -> Floats:
    off_rad = directions_rad - axis_rad
    return off_rad - nearest_right_angle_rad(off_rad)
