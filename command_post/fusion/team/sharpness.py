"""How far passes and moves scatter where the team is: four scales of what is told, learnt (pure).

A peak of one height says less where power falls slowly with range than where it falls steeply, and
strides are surer of some feet, and on some floors, than of others. How far the passes lie from
their DAPs, once all is solved, and how far moves had to bend, tells which: each scale is that of
Student's t, found by expectation and maximisation (Lange, Little, Taylor, "Robust statistical
modeling using the t distribution", 1989), and held to 1 by as many as ``noise_prior_passes`` and
``noise_prior_moves`` say. A solution follows what it is told, and so makes that seem sharper than
it is: as many as it follows count for none (restricted likelihood; Patterson, Thompson, "Recovery
of inter-block information when block sizes are unequal", 1971). What lasts, scales and drifts and
where DAPs stand, is solved for with the ways, and is not taken for scatter.
"""

from __future__ import annotations

import math

import numpy as np

from command_post.fusion.team.arithmetic import carried, logarithm, rotated
from command_post.fusion.team.assembly import UNKNOWN_TURN_SD_RAD, Assembled, Noise
from command_post.fusion.team.axis import off_axis_rad
from command_post.fusion.team.graph import LEAD, PLACE_DOF, TURN_DOF, Floats, Graph, Ints
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.smoother import log_determinant
from shared.compiled import compiled

SHARPER = 1e-3
LEAST_SCALE, MOST_SCALE = 0.5, 6.0
"""Peaks are held to be no more than twice as sharp as told: passes may err alike, unseen."""

LEAST_OF_MOVES, MOST_OF_MOVES = 0.5, 3.0

ROUNDS = 30


def learnt_noise(
    assembled: Assembled, pose: Floats, arrow: Floats, settings: TeamSettings
) -> Noise:
    """Return the scales that a solved graph speaks for: of passes of DAPs, and of moves."""
    graph, told = assembled.graph, assembled.noise
    passed = _passes(assembled)
    moved = np.flatnonzero(graph.move[:, 4] < UNKNOWN_TURN_SD_RAD)
    straight = np.arange(len(graph.straight))
    determinant = log_determinant(graph, pose, arrow)

    def taken_up(table: str, rows: Ints, column: int) -> float:
        sharper = getattr(graph, table).copy()
        sharper[rows, column] *= 1.0 - SHARPER
        grown = log_determinant(graph._replace(**{table: sharper}), pose, arrow) - determinant
        return _taken_up(grown)

    passes = places = turns = straights = 1.0
    if passed.size:
        stands = _stands(assembled, arrow)
        off2 = _squared(graph.tie, graph.tie_at, passed, pose, stands) * told.passes**2
        share, followed = assembled.tie_share[passed], taken_up("tie", passed, 2)
        dof, prior = settings.sharpness.dof, settings.noise_prior_passes
        passes = _scale(off2, share, followed, dof, 2.0, prior, LEAST_SCALE, MOST_SCALE)
    if moved.size:
        off2, bent2 = _moved(graph, moved, pose, arrow)
        of_places, of_turns = taken_up("move", moved, 3), taken_up("move", moved, 4)
        share, prior = np.ones(moved.size), settings.noise_prior_moves
        bounds = (LEAST_OF_MOVES, MOST_OF_MOVES)
        places = _scale(off2 * told.places**2, share, of_places, PLACE_DOF, 2.0, prior, *bounds)
        turns = _scale(bent2 * told.turns**2, share, of_turns, TURN_DOF, 1.0, prior, *bounds)
    if straight.size:
        off2 = (off_axis_rad(graph, pose, arrow) / settings.straight_told_sd_rad) ** 2
        share, followed = np.ones(straight.size), taken_up("straight", straight, 1)
        prior = settings.noise_prior_moves
        straights = _scale(off2, share, followed, 1.0, 1.0, prior, LEAST_OF_MOVES, MOST_OF_MOVES)
    return Noise(passes, places, turns, straights)


def _passes(assembled: Assembled) -> Ints:
    """Return the rows of ties that are passes of DAPs."""
    graph = assembled.graph
    is_dap = np.array([place[0] == "dap" for place in assembled.places], np.bool_)
    place = (graph.tie_at[:, 1] - assembled.place_column(0)) // 2
    return np.flatnonzero(is_dap[place] & (graph.tie[:, 3] > 0.0))


def _stands(assembled: Assembled, arrow: Floats) -> Floats:
    """Return the arrow with known places where they stand, and not where they are passed."""
    base, stands = assembled.place_column(0), arrow.copy()
    for known in np.flatnonzero(assembled.aside_m2).tolist():
        stands[base + 2 * known : base + 2 * known + 2] = assembled.graph.place[known, :2]
    return stands


def _taken_up(grown: float) -> float:
    """Return how many residuals the solution follows.

    It is the trace of what they add to the normal matrix over all of it, as the logarithm of its
    determinant has ``grown`` with them.
    """
    return 0.5 * grown / logarithm(1.0 / (1.0 - SHARPER)) if math.isfinite(grown) else 0.0


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
def _moved(graph: Graph, rows: Ints, pose: Floats, arrow: Floats) -> tuple[Floats, Floats]:
    """Return the squares of how far moves are off, and how far turned, over their variances."""
    off2 = np.zeros(rows.size)
    bent2 = np.zeros(rows.size)
    for k in range(rows.size):
        a, scale, _ = graph.move_at[rows[k]]
        north, east, duration_s, sd_m, sd_rad = graph.move[rows[k]]
        longer = 1.0 + arrow[scale]
        vn, ve = rotated(0.5 * (pose[a, 2] + pose[a + 1, 2]), longer * north, longer * east)
        off_north = pose[a + 1, 0] - pose[a, 0] - vn
        off_east = pose[a + 1, 1] - pose[a, 1] - ve
        off2[k] = (off_north * off_north + off_east * off_east) / (sd_m * sd_m)
        bent_rad = pose[a + 1, 2] - pose[a, 2] - arrow[scale + 1] * duration_s
        bent2[k] = bent_rad * bent_rad / (sd_rad * sd_rad)
    return off2, bent2


@compiled
def _scale(
    off2: Floats, share: Floats, taken_up: float, dof: float, dimension: float, prior: float,
    least: float, most: float,
) -> float:  # fmt: skip
    """Return the scale of Student's t that squares (n,) of so many dimensions speak for.

    Each is ``share`` (n,) of what it would be by itself, and counts for as much; so many residuals
    of all, ``taken_up``, are nought because the solution follows them.
    """
    told = dimension * prior
    free = max(dimension * share.sum() - taken_up, 0.0)
    scale2 = 1.0
    for _ in range(ROUNDS):
        total = told
        for k in range(off2.size):
            total += off2[k] * (dof + dimension) / (dof + off2[k] / (share[k] * scale2))
        scale2 = total / (told + free)
    return math.sqrt(min(max(scale2, least * least), most * most))
