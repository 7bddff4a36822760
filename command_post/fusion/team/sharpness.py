"""How sharp peaks are where the team is: one scale of their standard deviations, learnt (pure).

A peak of one height says less where power falls slowly with range than where it falls steeply. How
far the passes lie from their DAPs, once all is solved, tells which: the scale is that of Student's
t, found by expectation and maximisation (Lange, Little, Taylor, "Robust statistical modeling using
the t distribution", 1989), and held to 1 by as many passes as ``scale_prior_ties`` says. A solution
follows its passes, and so makes them seem sharper than they are: as many as it follows count for
none (restricted likelihood; Patterson, Thompson, "Recovery of inter-block information when block
sizes are unequal", 1971).
"""

from __future__ import annotations

import math

import numpy as np

from command_post.fusion.team.arithmetic import carried, logarithm
from command_post.fusion.team.assembly import Assembled
from command_post.fusion.team.graph import LEAD, Floats, Graph, Ints
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.smoother import log_determinant
from shared.compiled import compiled

SHARPER = 1e-3
LEAST_SCALE, MOST_SCALE = 0.5, 6.0
"""Peaks are held to be no more than twice as sharp as told: passes may err alike, unseen."""

ROUNDS = 30


def learnt_scale(
    assembled: Assembled, pose: Floats, arrow: Floats, settings: TeamSettings
) -> float:
    """Return the scale of the ties to DAPs that a solved graph speaks for."""
    graph, base = assembled.graph, assembled.place_column(0)
    stands = arrow.copy()
    for known in np.flatnonzero(assembled.aside_m2).tolist():
        stands[base + 2 * known : base + 2 * known + 2] = graph.place[known, :2]
    is_dap = np.array([place[0] == "dap" for place in assembled.places], np.bool_)
    place = (graph.tie_at[:, 1] - base) // 2
    passed = np.flatnonzero(is_dap[place] & (graph.tie[:, 3] > 0.0))
    if not passed.size:
        return 1.0
    off2 = _squared(graph.tie, graph.tie_at, passed, pose, stands) * assembled.tie_scale**2
    share = assembled.tie_share[passed]
    taken_up = min(_taken_up(graph, pose, arrow, passed), math.fsum(share))
    return _scale(off2, share, taken_up, settings.sharpness.dof, settings.scale_prior_ties)


def _taken_up(graph: Graph, pose: Floats, arrow: Floats, passed: Ints) -> float:
    """Return by how many residuals, of two each, the solution follows its passes.

    It is the trace of what they add to the normal matrix over all of it, as the logarithm of its
    determinant grows with them.
    """
    sharper = graph.tie.copy()
    sharper[passed, 2] *= 1.0 - SHARPER
    grown = log_determinant(graph._replace(tie=sharper), pose, arrow) - log_determinant(
        graph, pose, arrow
    )
    if not math.isfinite(grown):
        return 0.0
    return 0.25 * grown / logarithm(1.0 / (1.0 - SHARPER))


@compiled
def _squared(tie: Floats, tie_at: Ints, rows: Ints, pose: Floats, arrow: Floats) -> Floats:
    """Return the squares of how far ties are off, over their variances."""
    off2 = np.zeros(rows.size)
    for k in range(rows.size):
        north, east, sd_m, _, fast_north, fast_east = tie[rows[k]]
        node, place, _, _ = tie_at[rows[k]]
        at_north, at_east = carried(
            pose[node], north + arrow[LEAD] * fast_north, east + arrow[LEAD] * fast_east
        )
        off_north = at_north - arrow[place]
        off_east = at_east - arrow[place + 1]
        off2[k] = (off_north * off_north + off_east * off_east) / (sd_m * sd_m)
    return off2


@compiled
def _scale(off2: Floats, share: Floats, taken_up: float, dof: float, prior: float) -> float:
    """Return the scale of two-dimensional Student's t that squares (n,) speak for.

    Each is ``share`` (n,) of what it would be by itself, and counts for as much; so many in all,
    ``taken_up``, are nought because the solution follows them.
    """
    scale2, counted = 1.0, share.sum()
    for _ in range(ROUNDS):
        total = prior
        for k in range(off2.size):
            total += 0.5 * off2[k] * (dof + 2.0) / (dof + off2[k] / (share[k] * scale2))
        scale2 = total / (prior + counted - taken_up)
    return math.sqrt(min(max(scale2, LEAST_SCALE**2), MOST_SCALE**2))
