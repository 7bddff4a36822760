"""Dropping of a team's log what no solution reads any more (pure)."""

from __future__ import annotations

from command_post.fusion.team.anchors import (
    after,
    forgotten_ns,
    heard_after,
    last_and_after,
    unanchored_ns,
)
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import Anchors


def forget(log: TeamLog, anchors: Anchors, begin_ns: int, settings: TeamSettings) -> None:
    """Drop of ``log`` what is not read from ``begin_ns`` on, by who begins from ``anchors``.

    Of who was not anchored more is kept, as ``cut`` has it. It is known still how each responder's
    last moves were, and of each DAP where it stood first and by then.
    """
    since_ns = forgotten_ns(begin_ns, settings)
    for name, own in log.responders.items():
        start = anchors.starts.get(name)
        until_ns = since_ns if start is None else anchors.until_ns[name]
        kept = heard_after(own, until_ns)
        if start is not None:
            kept.starts = after(own.starts, until_ns)
            kept.moves.forget(start.time_ns)
        else:
            kept.moves.forget(unanchored_ns(begin_ns, settings))
        kept.known.forget(until_ns)
        log.responders[name] = kept
    for dap_id, said in log.daps.items():
        # That it was set down first says whether anybody is tied to who did that.
        first = next((at for at, each in enumerate(said) if not each.is_taken_up), len(said)) + 1
        log.daps[dap_id] = [*said[:first][-1:], *last_and_after(said[first:], since_ns)]
    for dap_id, heights in log.dap_heights.items():
        log.dap_heights[dap_id] = last_and_after(heights, since_ns)
