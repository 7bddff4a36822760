"""Passes and meetings count where both are on one floor: a signal may peak through a slab (pure).

Heights are solved apart from the plane, from rises, starts and words, and from the passes
themselves, robustly. Of a pass whose two heights lie further apart than a person's own height
could explain, given how well both are known, the standard deviation is widened.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from command_post.fusion.team.assembly import Assembled
from command_post.fusion.team.height_assembly import solve_heights
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.move_log import Floats
from command_post.fusion.team.settings import TeamSettings

SAME_FLOOR_M = 1.5
"""So far apart may heights be on one floor, by steps, ramps and drift: half a storey."""

LEAST_SHARE = 1e-4


def by_floor(
    log: TeamLog, assembled: Assembled, until_ns: int, settings: TeamSettings
) -> Assembled:
    """Return the same, with what was heard from another floor counting less, or not at all."""
    graph = assembled.graph
    heard = np.flatnonzero(graph.tie[:, 3] > 0.0)
    if not heard.size:
        return assembled
    node = graph.tie_at[heard, 0]
    place = (graph.tie_at[heard, 1] - assembled.place_column(0)) // 2
    is_meeting = np.array([each[0] == "meeting" for each in assembled.places], np.bool_)
    # Two who met would be drawn to one height, of which nobody else knows anything.
    apart = ~is_meeting[(graph.tie_at[:, 1] - assembled.place_column(0)) // 2]
    tied = graph._replace(tie=graph.tie[apart], tie_at=graph.tie_at[apart])
    heights = solve_heights(log, replace(assembled, graph=tied), until_ns, settings)
    if not heights.is_sound:
        return assembled
    off_m = np.abs(heights.node_m[node] - heights.place_m[place])
    variance_m2 = heights.node_m2[node] + heights.place_m2[place]
    of_meetings = np.flatnonzero(is_meeting[place])
    met = of_meetings[np.argsort(place[of_meetings], kind="stable")].reshape(-1, 2)
    one, other = node[met].T
    off_m[met] = np.abs(heights.node_m[one] - heights.node_m[other])[:, None]
    variance_m2[met] = (heights.node_m2[one] + heights.node_m2[other])[:, None]
    share = _share(off_m, variance_m2 + settings.passed_height_sd_m**2)
    if (share == 1.0).all():
        return assembled
    tie, tie_share = graph.tie.copy(), assembled.tie_share.copy()
    tie[heard, 2] /= np.sqrt(share)
    tie_share[heard] *= share
    return replace(assembled, graph=graph._replace(tie=tie), tie_share=tie_share)


def _share(off_m: Floats, variance_m2: Floats) -> Floats:
    """Return how much passes count whose two heights are so far apart: 1 down to all but nothing.

    That falls as a Gaussian of how far they are apart beyond ``SAME_FLOOR_M``.
    """
    beyond_m = np.maximum(off_m - SAME_FLOOR_M, 0.0)
    return np.asarray(np.maximum(np.exp(-0.5 * beyond_m**2 / variance_m2), LEAST_SHARE))
