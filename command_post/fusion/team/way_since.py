"""What estimates need of the way since a responder was solved, kept up move by move (pure).

Of each move it is worked out once, when it comes, and added up exactly: so the sums are to the bit
those of all moves anew, in whichever order they came.
"""

from __future__ import annotations

import math
from typing import Any

from command_post.fusion.team.move_log import DOWN, DOWN_M2, EAST, NORTH, MoveLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.unseen import (
    BEFORE,
    MORE,
    MOST_LOST,
    variances,
    walked_unseen,
)


class WaySince:
    """The moves of a log that ended after ``since_ns``, and what went unseen before each of them.

    ``north_m``, ``east_m`` and ``down_m`` are their ways in the agent's frame, ``own_m2`` the
    variances of their own ends, ``place_m2``, ``turn_rad2`` and ``down_m2`` those of what went
    unseen and of heights. ``end_ns`` is when the last ended, ``since_ns`` before any.
    """

    def __init__(self, moves: MoveLog, since_ns: int, settings: TeamSettings) -> None:
        self.since_ns = self.end_ns = since_ns
        self.north_m: list[float] = []
        self.east_m: list[float] = []
        self.down_m: list[float] = []
        self.own_m2: list[float] = []
        self.place_m2: list[float] = []
        self.turn_rad2: list[float] = []
        self.down_m2: list[float] = []
        self._settings = settings
        self._order = moves.order
        self._first = moves.count_until(since_ns)
        self._before = max(self._first - BEFORE, 0)

    @property
    def count(self) -> int:
        """How many moves there are."""
        return len(self.north_m)

    def is_of(self, moves: MoveLog, since_ns: int) -> bool:
        """Whether it is of these moves, none of which has come late since, from then on."""
        # What comes first may have ended before, too.
        is_begun = self.count > 0 or len(moves) == self._first
        return is_begun and self.since_ns == since_ns and self._order is moves.order

    def go_on(self, moves: MoveLog) -> None:
        """Take in the moves that have come since."""
        for k in range(self._first + self.count, len(moves)):
            self._add(moves, k)

    def _add(self, moves: MoveLog, k: int) -> None:
        # Of what is further back than three moves nothing depends on.
        times, values = moves.rows(max(self._before, k - BEFORE - 1), k + 1)
        settings, own = self._settings, values[-1]
        north_m, east_m, down_m = own[NORTH], own[EAST], own[DOWN]
        self.end_ns = times[-1][0]
        self.own_m2.append(
            (
                settings.stride_sd_m
                + settings.stride_sd_share * math.sqrt(north_m * north_m + east_m * east_m)
            )
            ** 2
        )
        down_m2 = own[DOWN_M2]
        lost, walked = _unseen(times)
        if lost or walked:
            share, before = settings.unseen_share, values[-2]
            supposed = share * walked * (1.0 if lost else MORE)
            beside_n, beside_e, beside_d = (
                0.5 * (own[column] + before[column]) for column in (NORTH, EAST, DOWN)
            )
            north_m += supposed * beside_n
            east_m += supposed * beside_e
            down_m += supposed * beside_d
            place_m2, turn_rad2, climbed_m2 = variances(
                lost, walked, beside_n * beside_n + beside_e * beside_e, share,
                settings.lost_stride_m, settings.lost_climb_m, settings.stride_turn_sd_rad**2,
                settings.unseen_turn_sd_rad**2,
            )  # fmt: skip
            self.place_m2.append(place_m2)
            self.turn_rad2.append(turn_rad2)
            down_m2 += climbed_m2
        self.north_m.append(north_m)
        self.east_m.append(east_m)
        self.down_m.append(down_m)
        self.down_m2.append(down_m2)


class Ways:
    """The way of each responder since they were solved last, by id."""

    def __init__(self, settings: TeamSettings) -> None:
        self._settings = settings
        self._ways: dict[str, WaySince] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Return what is to be kept elsewhere: ways are soon worked out anew."""
        return {**self.__dict__, "_ways": {}}

    def of(self, responder_id: str, moves: MoveLog, since_ns: int) -> WaySince:
        """Return a responder's way by their ``moves`` until now."""
        way = self._ways.get(responder_id)
        if way is None or not way.is_of(moves, since_ns):
            way = self._ways[responder_id] = WaySince(moves, since_ns, self._settings)
        way.go_on(moves)
        return way


def _unseen(times: list[list[int]]) -> tuple[int, int]:
    """Return how many strides before the last of some moves were lost, and how many walked.

    Rows are when a move ended and began, and its number.
    """
    if len(times) == 1:
        return 0, 0
    (end_ns, start_ns, number), (last_ns, last_start_ns, last_number) = times[-1], times[-2]
    lost = min(max(number - last_number - 1, 0), MOST_LOST)
    if len(times) <= BEFORE or number <= last_number:
        return lost, 0
    before_ns, before_start_ns, _ = times[-3]
    rest_before_ns = last_start_ns - before_ns
    rest_earlier_ns = before_start_ns - times[-4][0] if len(times) > 3 else rest_before_ns
    walked = walked_unseen(
        lost, end_ns - start_ns, last_ns - last_start_ns, start_ns - last_ns, rest_before_ns,
        rest_earlier_ns,
    )  # fmt: skip
    return lost, walked
