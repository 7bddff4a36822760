"""Where a crew was held to be some time ago, in place of all that had been heard before (pure).

So a crew's commits take as long in the second day as in the second hour: each way begins anew
where an earlier commit had it, as surely as that commit was, and DAPs stand as surely as they did.
What is lost is how these depended on each other. A small team is solved from as far back as the
horizon is, the crews of a large one from a few minutes ago.
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
from command_post.fusion.team.log import Fix, Height, Installed, Peak, ResponderLog, Start, TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import (
    Anchors,
    ChainSolution,
    Solution,
    Stood,
    Ways,
    overlaid,
)
from command_post.fusion.team.solving import Solved
from command_post.fusion.team.suspicions import UNKNOWN_HEADING_SD_RAD
from command_post.fusion.track import MOST_COORDINATE_M, told_covariance, within
from shared.messages import LocalPosition
from shared.units import NS_PER_S

ANCHORED_WITHIN_HORIZON = 4
"""So often is a small team anchored anew: the more often, the less it is solved beyond that."""

_Timed = TypeVar("_Timed", Start, Peak, Fix, Height, Installed)


def anchored(
    number: int, log: TeamLog, solved: Solved, heights: Heights, solution: Solution,
    before: Solution, settings: TeamSettings, *, of_crowd: bool,
) -> Solution:  # fmt: skip
    """Return a crew's solution at the commit of period ``number``, with what is begun from later.

    Now and then the crew is anchored as it is solved now, and begun from where it was anchored
    once that is long enough ago: so it is always solved from as far back as that, at least.
    """
    every_s, back_s = (
        (settings.anchor_s, settings.anchor_s)
        if of_crowd
        else (settings.horizon_s / ANCHORED_WITHIN_HORIZON, settings.horizon_s)
    )
    begun, to_come, past = before.anchors, before.to_come, before.past
    every = _periods(every_s, settings)
    last = to_come[-1].number if to_come else begun.number
    if number // every > last // every:
        passed = [each for each in to_come if number - each.number >= _periods(back_s, settings)]
        if passed:
            past = _with_pieces(past, solution, begun := overlaid([begun, *passed]))
        fresh = anchors_of(number, log, solved, heights, solution.time_ns, settings)
        to_come = (*to_come[len(passed) :], fresh)
    return solution._replace(anchors=begun, to_come=to_come, past=past)


def _periods(seconds: float, settings: TeamSettings) -> int:
    return max(round(seconds / settings.commit_s), 1)


def _with_pieces(past: Ways, solution: Solution, anchors: Anchors) -> Ways:
    """Return the ways before, with what ``solution`` has of each before the ``anchors``."""
    pieces = dict(past)
    for name, chain in solution.chains.items():
        if name in anchors.starts:
            early = chain.time_ns < anchors.starts[name].time_ns
            if early.any():
                piece = ChainSolution(chain.time_ns[early], chain.pose[early], chain.units)
                pieces[name] = (*pieces.get(name, ()), piece)
    return pieces


def anchors_of(
    number: int, log: TeamLog, solved: Solved, heights: Heights, time_ns: int,
    settings: TeamSettings,
) -> Anchors:  # fmt: skip
    """Return the crew as it was solved at ``time_ns``, for commits to come to begin from.

    Whose heading is not known, for now perhaps, is anchored only once their way begins so long ago
    that it is to be forgotten.
    """
    starts: dict[str, Start] = {}
    long_ago_ns = forgotten_ns(time_ns, settings)
    for index, chain in enumerate(solved.assembled.chains):
        told = solved.tells_turn(index, settings)
        is_sharp = solved.ends[index, 3] < settings.recovered_turn_sd_rad**2
        if (told and is_sharp) or int(chain.time_ns[0]) < long_ago_ns:
            starts[chain.responder_id] = _start(solved, heights, index, told=told)
    return Anchors(
        number, dict.fromkeys(starts, time_ns), starts, _stood(log, solved, heights, time_ns)
    )


def _stood(log: TeamLog, solved: Solved, heights: Heights, time_ns: int) -> dict[str, Stood]:
    """Return where each DAP stands at ``time_ns``: where it stood before, nobody passes it."""
    found: dict[str, Installed] = {}
    for place, place_id in enumerate(solved.assembled.places):
        if place_id[0] == "dap":
            dap_id, since_ns = place_id[1], int(place_id[2])
            said = next(each for each in log.daps[dap_id] if each.time_ns == since_ns)
            installed = Installed(
                since_ns, None, position_of(solved, heights, place), said.said_ns,
                found=not solved.assembled.aside_m2[place],
            )  # fmt: skip
            found[dap_id] = max(found.get(dap_id, installed), installed, key=_since)
    return {
        dap_id: Stood(time_ns, (each, *_taken_up(log.daps[dap_id], each.time_ns, time_ns)))
        for dap_id, each in found.items()
    }


def _taken_up(installs: Sequence[Installed], since_ns: int, until_ns: int) -> list[Installed]:
    """Return that a DAP was taken up in between, if it was."""
    return [each for each in installs if each.is_taken_up and since_ns < each.time_ns <= until_ns]


def _since(installed: Installed) -> int:
    return installed.time_ns


def _start(solved: Solved, heights: Heights, index: int, *, told: bool) -> Start:
    """Return a start as if a chain began at its last stance, where it was held to be.

    Unless it is ``told`` how its unit is turned, it may be turned any way.
    """
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
        int(solved.assembled.chains[index].time_ns[-1]), 0,
        math.sqrt(max(tt, 0.0)) if told else UNKNOWN_HEADING_SD_RAD, position,
        is_loose=solved.assembled.chains[index].starts[-1].is_loose,
        turn_rad=turn_rad, down_sd_m=math.sqrt(max(float(heights.node_m2[end - 1]), LEAST_SD_M**2)),
        tied_ns=tied_ns(solved, index),
    )  # fmt: skip


def cut(log: TeamLog, anchors: Anchors, time_ns: int, settings: TeamSettings) -> TeamLog:
    """Return what counts at ``time_ns``: what was heard since the crew was anchored.

    It is as if all began there. Of who was not, what was heard before twice the horizon counts no
    more either, nor how they moved before twice as long again: only who has no solution is not
    anchored by then. Nor does where a DAP stood before it was set down again.
    """
    since_ns, moved_since_ns = forgotten_ns(time_ns, settings), unanchored_ns(time_ns, settings)
    since = TeamLog()
    since.responders = {
        name: _cut(own, anchors.starts[name], anchors.until_ns[name])
        if name in anchors.starts
        else replace(heard_after(own, since_ns), moves=own.moves.later_than(moved_since_ns))
        for name, own in log.responders.items()
    }
    since.daps = {
        dap_id: [*anchors.stood[dap_id].installed, *after(said, anchors.stood[dap_id].until_ns)]
        if dap_id in anchors.stood
        else last_and_after(said, since_ns)
        for dap_id, said in log.daps.items()
    }
    since.dap_heights = log.dap_heights
    return since


def _cut(own: ResponderLog, start: Start, until_ns: int) -> ResponderLog:
    return replace(
        heard_after(own, until_ns),
        starts=[start, *after(own.starts, until_ns)],
        moves=own.moves.later_than(start.time_ns),
    )


def heard_after(own: ResponderLog, time_ns: int) -> ResponderLog:
    """Return how a responder moved, and what else was heard after ``time_ns``."""
    return replace(
        own,
        peaks=after(own.peaks, time_ns),
        nears=after(own.nears, time_ns),
        contacts=after(own.contacts, time_ns),
        fixes=after(own.fixes, time_ns),
        heights=after(own.heights, time_ns),
    )


def after(events: Sequence[_Timed], time_ns: int) -> list[_Timed]:
    """Return the events after ``time_ns``."""
    return list(events[bisect_right(events, time_ns, key=lambda each: each.time_ns) :])


def last_and_after(events: Sequence[_Timed], time_ns: int) -> list[_Timed]:
    """Return the last event by ``time_ns``, and those after."""
    at = bisect_right(events, time_ns, key=lambda each: each.time_ns)
    return list(events[max(at - 1, 0) :])


def forgotten_ns(time_ns: int, settings: TeamSettings) -> int:
    """Return until when nothing counts any more at ``time_ns`` of whoever was not anchored."""
    return time_ns - round(2.0 * settings.horizon_s * NS_PER_S)


def unanchored_ns(time_ns: int, settings: TeamSettings) -> int:
    """Return until when not even moves count at ``time_ns`` of whoever was not anchored."""
    return time_ns - round(4.0 * settings.horizon_s * NS_PER_S)


def with_past(solution: Solution) -> Solution:
    """Return a solution with the ways before it was anchored, as they were held to be."""
    chains: dict[str, ChainSolution] = {}
    for name, chain in solution.chains.items():
        begin_ns = int(chain.time_ns[0])
        whole = [
            ChainSolution(each.time_ns[early], each.pose[early], each.units)
            for each in solution.past.get(name, ())
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
