"""Strides that a unit did not tell of, by the time that is missing between those it did (pure).

Who walks on takes as long for each stride as for the one before, while a pause may last any time.
So where just as much time is missing as a stride takes, one most likely was walked and went
unnoticed; where numbers say that some were lost on the way, those were, if the time suits. Of those
that go unnoticed beside a pause time tells nothing: the ways between are taken to be as much longer
as makes up for them, or all ways of a team would come out short alike, and no pass would tell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from command_post.fusion.team.move_log import DOWN, EAST, NORTH, Floats, Ints, Moves
from command_post.fusion.team.settings import TeamSettings
from shared.compiled import compiled

MOST_LOST = 1000
MOST_STRAIGHT = 3
"""Nobody can be supposed to have gone straight on for more strides than these."""

BEFORE = 2
"""Of so many moves before a move depends what is supposed to have gone unseen."""

ALIKE = 0.1
"""By what share of it the time that a stride takes may differ from that of those beside it."""

SCATTER = 0.1
"""How much of a stride's square those beside it leave unexplained."""


MORE = 1.15
"""So many strides go unnoticed for each that time tells of: beside a pause it tells of none."""


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
    count = moves.end_ns.size
    found = Unseen(
        np.empty(count, np.int64), np.empty((count, 3)),
        np.empty(count), np.empty(count), np.empty(count),
    )  # fmt: skip
    _suppose(
        moves, found, settings.unseen_share, settings.lost_stride_m, settings.lost_climb_m,
        settings.stride_turn_sd_rad**2, settings.unseen_turn_sd_rad**2,
    )  # fmt: skip
    return found


def walked_unseen(
    lost: int, took_ns: int, took_before_ns: int, rest_ns: int, rest_before_ns: int,
    rest_earlier_ns: int,
) -> int:  # fmt: skip
    """Return how many strides straight on the time missing before a move stands for.

    It and the one before took so long; the rests are before it, before that one, and before the one
    before that.
    """
    # A unit that tells of the swing of a foot alone rests between any two.
    usual_ns = max(min(rest_before_ns, rest_earlier_ns), 0)
    stride_ns = 0.5 * (took_ns + took_before_ns) + usual_ns
    most = max(lost, 1)
    off_ns = abs(rest_ns - usual_ns - most * stride_ns)
    return most if most <= MOST_STRAIGHT and off_ns <= ALIKE * most * stride_ns else 0


def variances(
    lost: int, walked: int, square_m2: float, share: float, lost_stride_m: float,
    lost_climb_m: float, lost_turn_rad2: float, unseen_turn_rad2: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Return the variances of place, turn and height of what was ``lost`` or ``walked``.

    ``square_m2`` is the square of a stride beside it.
    """
    spread_m2 = (share * (1.0 - share) * walked**2 + SCATTER * walked) * square_m2
    lost_m, climb_m = lost_stride_m * lost, lost_climb_m * max(lost, walked)
    place_m2 = spread_m2 if walked else lost_m * lost_m
    return place_m2, lost * lost_turn_rad2 + walked * unseen_turn_rad2, climb_m * climb_m


_walked_unseen = compiled(walked_unseen)
_variances = compiled(variances)


@compiled
def _suppose(
    moves: Moves, found: Unseen, share: float, lost_stride_m: float, lost_climb_m: float,
    lost_turn_rad2: float, unseen_turn_rad2: float,
) -> None:  # fmt: skip
    """Write into ``found`` what is supposed before each move."""
    for k in range(moves.end_ns.size):
        lost = (
            0 if k == 0 else min(max(moves.sequence[k] - moves.sequence[k - 1] - 1, 0), MOST_LOST)
        )
        walked = _walked(moves, k, lost)
        supposed = share * walked * (1.0 if lost else MORE)
        square_m2 = 0.0
        for at, column in enumerate((NORTH, EAST, DOWN)):
            beside_m = 0.5 * (moves.values[k, column] + moves.values[k - 1, column])
            found.way_m[k, at] = supposed * beside_m
            if column != DOWN:
                square_m2 += beside_m * beside_m
        found.since_ns[k] = moves.end_ns[k - 1] if walked else moves.start_ns[k]
        found.place_m2[k], found.turn_rad2[k], found.down_m2[k] = _variances(
            lost, walked, square_m2, share, lost_stride_m, lost_climb_m, lost_turn_rad2,
            unseen_turn_rad2,
        )  # fmt: skip


@compiled
def _walked(moves: Moves, k: int, lost: int) -> int:
    """Return how many strides straight on the time missing before move ``k`` stands for."""
    # Nothing is missing where a unit begins anew.
    if k < BEFORE or moves.sequence[k] <= moves.sequence[k - 1]:
        return 0
    return _walked_unseen(
        lost, moves.end_ns[k] - moves.start_ns[k], moves.end_ns[k - 1] - moves.start_ns[k - 1],
        _rest_ns(moves, k), _rest_ns(moves, k - 1), _rest_ns(moves, max(k - 2, 1)),
    )  # fmt: skip


@compiled
def _rest_ns(moves: Moves, k: int) -> int:
    """Return the time between a move and the one before."""
    rest_ns: int = moves.start_ns[k] - moves.end_ns[k - 1]
    return rest_ns
