"""Where a crew of a large team was held to be some minutes ago, in place of all before (pure).

So a crew's commits take as long in the second hour as after a few minutes: each way begins anew
where an earlier commit had it, as surely as that commit was, and DAPs stand as surely as they did.
What is lost is how these depended on each other.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from command_post.fusion.team.dap_places import position_of
from command_post.fusion.team.estimates import tied_ns
from command_post.fusion.team.height_assembly import LEAST_SD_M, Heights
from command_post.fusion.team.log import (
    Fix,
    Height,
    Installed,
    Peak,
    ResponderLog,
    Start,
    TeamLog,
)
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import Anchors, ChainSolution, Solution, Stood
from command_post.fusion.team.solving import Solved
from command_post.fusion.track import MOST_COORDINATE_M, told_covariance, within
from shared.messages import LocalPosition

_Timed = TypeVar("_Timed", Start, Peak, Fix, Height, Installed)


def anchors_of(
    log: TeamLog, solved: Solved, heights: Heights, solution: Solution, settings: TeamSettings
) -> Anchors:
    """Return the crew as it was solved, for commits to come to begin from.

    Whose heading is not known is not anchored again. ``solution`` has what was anchored before.
    """
    time_ns = solution.time_ns
    before = solution.next_anchors
    starts, until_ns, past = dict(before.starts), dict(before.until_ns), dict(before.past)
    for index, chain in enumerate(solved.assembled.chains):
        told = solved.tells_turn(index, settings)
        if told and solved.ends[index, 3] < settings.recovered_turn_sd_rad**2:
            name = chain.responder_id
            starts[name] = _start(solved, heights, index)
            until_ns[name] = time_ns
            past[name] = (*past.get(name, ()), solution.chains[name])
    stood: dict[str, Stood] = {}
    for place, place_id in enumerate(solved.assembled.places):
        if place_id[0] == "dap":
            dap_id, since_ns = place_id[1], int(place_id[2])
            said = next(each for each in log.daps[dap_id] if each.time_ns == since_ns)
            found = Installed(
                since_ns, None, position_of(solved, heights, place), said.said_ns,
                found=not solved.assembled.aside_m2[place],
            )  # fmt: skip
            others = stood[dap_id].installed if dap_id in stood else ()
            stood[dap_id] = Stood(time_ns, tuple(sorted((*others, found), key=_since)))
    for dap_id, each in stood.items():
        taken_up = (one for one in log.daps[dap_id] if one.is_taken_up and one.time_ns <= time_ns)
        installed = tuple(sorted((*each.installed, *taken_up), key=_since))
        stood[dap_id] = each._replace(installed=installed)
    return Anchors(until_ns, starts, stood, past)


def _since(installed: Installed) -> int:
    return installed.time_ns


def _start(solved: Solved, heights: Heights, index: int) -> Start:
    """Return a start as if a chain began at its last stance, where it was held to be."""
    end = int(solved.assembled.graph.first[index + 1])
    north_m, east_m, turn_rad = solved.pose[end - 1].tolist()
    nn, ne, ee, tt = solved.ends[index, :4].tolist()
    position = LocalPosition(
        north_m=within(north_m, MOST_COORDINATE_M),
        east_m=within(east_m, MOST_COORDINATE_M),
        down_m=within(float(heights.node_m[end - 1]), MOST_COORDINATE_M),
        covariance_m2=told_covariance(nn, ne, ee),
    )
    return Start(
        int(solved.assembled.chains[index].time_ns[-1]), 0, math.sqrt(max(tt, 0.0)), position,
        is_loose=solved.assembled.chains[index].starts[-1].is_loose,
        turn_rad=turn_rad, down_sd_m=math.sqrt(max(float(heights.node_m2[end - 1]), LEAST_SD_M**2)),
        tied_ns=tied_ns(solved, index),
    )  # fmt: skip


def cut(log: TeamLog, anchors: Anchors) -> TeamLog:
    """Return what was heard since the crew was anchored, as if all began there."""
    if not anchors.starts:
        return log
    since = TeamLog()
    since.responders = {
        name: _cut(own, anchors.starts[name], anchors.until_ns[name])
        if name in anchors.starts
        else own
        for name, own in log.responders.items()
    }
    since.daps = {
        dap_id: [*anchors.stood[dap_id].installed, *_after(said, anchors.stood[dap_id].until_ns)]
        if dap_id in anchors.stood
        else said
        for dap_id, said in log.daps.items()
    }
    since.dap_heights = log.dap_heights
    return since


def _cut(own: ResponderLog, start: Start, until_ns: int) -> ResponderLog:
    return replace(
        own,
        starts=[start, *_after(own.starts, until_ns)],
        moves=own.moves.later_than(start.time_ns),
        peaks=_after(own.peaks, until_ns),
        nears=_after(own.nears, until_ns),
        contacts=_after(own.contacts, until_ns),
        fixes=_after(own.fixes, until_ns),
        heights=_after(own.heights, until_ns),
    )


def _after(events: Sequence[_Timed], time_ns: int) -> list[_Timed]:
    return list(events[bisect_right(events, time_ns, key=lambda each: each.time_ns) :])


def with_past(solution: Solution) -> Solution:
    """Return a solution with the ways before it was anchored, as they were held to be."""
    chains: dict[str, ChainSolution] = {}
    for name, chain in solution.chains.items():
        begin_ns = int(chain.time_ns[0])
        whole = [
            ChainSolution(each.time_ns[early], each.pose[early], each.units)
            for each in solution.next_anchors.past.get(name, ())
            if (early := each.time_ns < begin_ns).any()
        ] + [chain]
        chains[name] = _joined(whole)
    return solution._replace(chains=chains)


def _joined(chains: list[ChainSolution]) -> ChainSolution:
    """Return one way of pieces in the order of time; where two overlap the later one counts."""
    pieces = []
    for each, following in zip(chains, [*chains[1:], None], strict=True):
        end_ns = following.time_ns[0] if following is not None else None
        kept = slice(None) if end_ns is None else each.time_ns < end_ns
        pieces.append((each.time_ns[kept], each.pose[kept]))
    return ChainSolution(
        np.concatenate([time_ns for time_ns, _ in pieces]),
        np.concatenate([pose for _, pose in pieces]),
        chains[0].units,
    )
