"""Strides that a unit did not tell of, by the time that is missing between those it did (pure).

Who walks on takes as long for each stride as for the one before, while a pause may last any time.
So where just as much time is missing as a stride takes, one most likely was walked and went
unnoticed; where numbers say that some were lost on the way, those were, if the time suits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from command_post.fusion.team.log import DOWN, EAST, NORTH, Floats, Ints, Moves
from command_post.fusion.team.settings import TeamSettings

MOST_LOST = 1000
MOST_STRAIGHT = 3
"""Nobody can be supposed to have gone straight on for more strides than these."""

BEFORE = 2
"""Of so many moves before a move depends what is supposed to have gone unseen."""

ALIKE = 0.1
"""By what share of it the time that a stride takes may differ from that of those beside it."""

SCATTER = 0.1
"""How much of a stride's square those beside it leave unexplained."""


class Unseen(NamedTuple):
    """What is supposed before each of m moves, of strides that nobody told of.

    ``since_ns`` (m,) is when a move began, with those before it; ``way_m`` (m, 3) is their way
    north, east and down, in the agent's frame; ``place_m2``, ``turn_rad2`` and ``down_m2`` (m,) are
    the variances of what cannot be known of it.
    """

    since_ns: Ints
    way_m: Floats
    place_m2: Floats
    turn_rad2: Floats
    down_m2: Floats

    def last(self, count: int) -> Unseen:
        """Return what is supposed before the last so many moves."""
        first = self.since_ns.size - count
        return Unseen(
            self.since_ns[first:], self.way_m[first:],
            self.place_m2[first:], self.turn_rad2[first:], self.down_m2[first:],
        )  # fmt: skip


def unseen_before(moves: Moves, settings: TeamSettings) -> Unseen:
    """Return what went unseen before each move; before the first two only what numbers tell."""
    lost = np.clip(np.diff(moves.sequence, prepend=moves.sequence[:1] - 1) - 1, 0, MOST_LOST)
    walked = _walked(moves, lost)
    steps_m = moves.values[:, [NORTH, EAST, DOWN]]
    beside_m = 0.5 * (steps_m + np.roll(steps_m, 1, axis=0))
    share = settings.unseen_share
    square_m2 = (beside_m[:, :2] ** 2).sum(axis=1)
    spread_m2 = (share * (1.0 - share) * walked**2 + SCATTER * walked) * square_m2
    suits = walked > 0
    return Unseen(
        np.where(suits, np.roll(moves.end_ns, 1), moves.start_ns),
        share * walked[:, None] * beside_m,
        np.where(suits, spread_m2, (settings.lost_stride_m * lost) ** 2),
        lost * settings.stride_turn_sd_rad**2 + walked * settings.unseen_turn_sd_rad**2,
        (settings.lost_climb_m * np.maximum(lost, walked)) ** 2,
    )


def _walked(moves: Moves, lost: Ints) -> Ints:
    """Return how many strides straight on the time missing before each move stands for."""
    walked = np.zeros(moves.end_ns.size, np.int64)
    if walked.size < 3:
        return walked
    took_ns = moves.end_ns - moves.start_ns
    rest_ns = np.diff(moves.end_ns) - took_ns[1:]
    # A unit that tells of the swing of a foot alone rests between any two.
    usual_ns = np.maximum(np.minimum(rest_ns[:-1], np.append(rest_ns[:1], rest_ns[:-2])), 0)
    stride_ns = 0.5 * (took_ns[2:] + took_ns[1:-1]) + usual_ns
    most = np.maximum(lost[2:], 1)
    off_ns = np.abs(rest_ns[1:] - usual_ns - most * stride_ns)
    suits = (off_ns <= ALIKE * most * stride_ns) & (most <= MOST_STRAIGHT)
    # Nothing is missing where a unit begins anew.
    suits &= np.diff(moves.sequence)[1:] > 0
    walked[2:][suits] = most[suits]
    return walked
