"""Everybody's whole way, stance by stance and rest by rest, from a solved team (pure)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from command_post.fusion.interface import SmoothedTrack
from command_post.fusion.team.arithmetic import rotated
from command_post.fusion.team.chain import Chain
from command_post.fusion.team.height_assembly import Heights
from command_post.fusion.team.marginals import EVERY_NODE
from command_post.fusion.team.move_log import Floats, Ints
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.smoother import smooth
from command_post.fusion.team.solving import Solved
from shared.units import NS_PER_S

REST_NS = NS_PER_S
"""Who moves on so long after their last stance has stood there until then."""


def smoothed_tracks(
    solved: Solved, heights: Heights, ahead_ns: Mapping[str, int], settings: TeamSettings
) -> dict[str, SmoothedTrack]:
    """Return the ways of a solution, with covariances; some clocks are ahead by ``ahead_ns``.

    Held to an axis that is given, covariances are told ``given_axis_factor`` times as wide. Those
    of a group whose map may be turned are mean squares about the first of its turns.
    """
    tracks = _tracks(solved, heights, ahead_ns, settings)
    for turns in solved.turns:
        names = [solved.assembled.chains[index].responder_id for index in turns.chains]
        spread = {name: np.zeros_like(tracks[name].covariance_m2) for name in names}
        for number, (share, way) in enumerate(turns.ways):
            turned = _tracks(way, heights, ahead_ns, settings)
            for name in names if number == 0 else ():
                tracks[name] = turned[name]
            for name in names:
                n, e, _ = (turned[name].position_m - tracks[name].position_m).T
                apart = np.column_stack([n * n, n * e, e * e])
                spread[name] += share * (turned[name].covariance_m2 + apart)
        for name in names:
            tracks[name] = tracks[name]._replace(covariance_m2=spread[name])
    return tracks


def _tracks(
    solved: Solved, heights: Heights, ahead_ns: Mapping[str, int], settings: TeamSettings
) -> dict[str, SmoothedTrack]:
    """Return the ways of one solution as if there were no other.

    Between two nodes a way goes as the unit said, turned by the mean of their turns; what is then
    missing to the next node is shared out evenly.
    """
    graph, pose, arrow = solved.assembled.graph, solved.pose.copy(), solved.arrow.copy()
    _, _, covariance, _ = smooth(
        graph, pose, arrow, settings.commit_iterations, settings.settled_m, EVERY_NODE
    )
    factor = settings.covariance_factor
    if solved.belief.mode == "given":
        factor *= settings.given_axis_factor
    tracks = {}
    for index, chain in enumerate(solved.assembled.chains):
        nodes = solved.assembled.nodes[index]
        first = int(graph.first[index])
        own = slice(first, first + len(nodes))
        scale = arrow[solved.assembled.unit_column(index) + 2 * chain.unit]
        place_m, share, before, after = _ways(chain, nodes, pose[own], scale)
        spread = (1.0 - share) * covariance[own, :3][before] + share * covariance[own, :3][after]
        off_m = heights.node_m[own] - chain.rise[nodes, 0]
        down_m = chain.rise[:, 0] + np.interp(np.arange(chain.time_ns.size), nodes, off_m)
        time_ns, stance = _with_rests(chain)
        tracks[chain.responder_id] = SmoothedTrack(
            (time_ns - ahead_ns.get(chain.responder_id, 0)) / NS_PER_S,
            np.column_stack([place_m, down_m])[stance],
            spread[stance] * factor,
        )
    return tracks


def _with_rests(chain: Chain) -> tuple[Ints, Ints]:
    """Return the times (k,) at which a way is told, and each one's stance.

    They are those of all stances, and of the end of each rest: who sets out, or rides off in a
    lift, was until then where they stood.
    """
    rested = np.flatnonzero(chain.begin_ns[1:] - chain.time_ns[:-1] > REST_NS)
    # Of some stances nobody knows how they were come to.
    rested = rested[~np.isin(rested + 1, chain.leaps)]
    time_ns = np.insert(chain.time_ns, rested + 1, chain.begin_ns[rested + 1])
    return time_ns, np.sort(np.concatenate([np.arange(chain.time_ns.size), rested]))


def _ways(
    chain: Chain, nodes: Ints, poses: Floats, scale: Floats
) -> tuple[Floats, Floats, Ints, Ints]:
    """Return places (k, 2) of all stances, and how far each is between which nodes (by index)."""
    stance = np.arange(chain.time_ns.size)
    before = np.maximum(np.searchsorted(nodes, stance, side="left") - 1, 0)
    after = np.minimum(before + 1, len(nodes) - 1)
    one, other = nodes[before], nodes[after]
    turn_rad = 0.5 * (poses[before, 2] + poses[after, 2])
    place_m = poses[before, :2] + _turned(turn_rad, scale, chain.way_m - chain.way_m[one])
    there_m = poses[before, :2] + _turned(turn_rad, scale, chain.way_m[other] - chain.way_m[one])
    share = ((stance - one) / np.maximum(other - one, 1))[:, None]
    return place_m + share * (poses[after, :2] - there_m), share, before, after


def _turned(turn_rad: Floats, scale: Floats, way_m: Floats) -> Floats:
    rows = np.column_stack([turn_rad, way_m * (1.0 + scale)[:, None]])
    return np.array([rotated(*row) for row in rows.tolist()])
