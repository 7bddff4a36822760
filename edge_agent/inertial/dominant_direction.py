"""The dominant direction of a building: where its corridors lead, mod 90°, and who follows them.

Abdulrahim, Hide, Moore and Hill 2011, "Aiding low cost inertial navigation with building heading
for pedestrian navigation", without a plan: the direction is learnt from the way itself, as that
to which most straight pieces of it are parallel or square. It says nothing where few are: on a
round course, on open ground, in a building whose wings stand at 45° to each other.
"""

from __future__ import annotations

import cmath
import math
from collections import deque
from typing import NamedTuple

from shared.maths.angles import wrap_rad

STRAIGHT_M = 1.8
"""A piece of the way is this long at least, and of two strides or more."""

BENT_RAD = math.radians(10.0)
"""Two strides that differ by more are not of one straight piece."""

ALONG_RAD = math.radians(10.0)
"""A piece is along the dominant direction to within this."""

FEWEST_PIECES = 5
MOST_PIECES = 80
LEAST_SHARE = 0.7
"""So many of the pieces remembered must be along it; chance alone makes it a fifth."""

PIECE_SD_RAD = math.radians(5.0)
"""How far one piece is off the corridor: people do not walk along a line."""


class OffDirection(NamedTuple):
    """How far a piece of the way is clockwise of the direction taken for the building's.

    ``found_sd_rad`` is how well that direction was told by the pieces before, where this is the
    first to be compared with it; ``None`` else.
    """

    off_rad: float
    found_sd_rad: float | None


class DominantDirection:
    """Takes strides in order; tells how far heading is off the building's. Plain state."""

    def __init__(self) -> None:
        self._pieces_rad: deque[float] = deque(maxlen=MOST_PIECES)
        self._way_m = 0j
        self._strides = 0
        self._last_rad = math.nan
        self._direction_rad = math.nan

    def add(self, north_m: float, east_m: float) -> OffDirection | None:
        """Take in a stride; tell what the straight piece that it completes says, if it does."""
        stride_m = complex(north_m, east_m)
        heading_rad = cmath.phase(stride_m)
        if not abs(wrap_rad(heading_rad - self._last_rad)) <= BENT_RAD:
            self._way_m, self._strides = 0j, 0
        self._way_m += stride_m
        self._strides += 1
        self._last_rad = heading_rad
        if self._strides < 2 or abs(self._way_m) < STRAIGHT_M:
            return None
        piece_rad = cmath.phase(self._way_m)
        self._way_m, self._strides = 0j, 0
        return self._judge(piece_rad)

    def turn(self, turn_rad: float) -> None:
        """Note that headings are told ``turn_rad`` further clockwise from now on."""
        self._last_rad += turn_rad

    def _judge(self, piece_rad: float) -> OffDirection | None:
        """Return how a piece stands to the direction that those before it share, if they do."""
        pieces_rad = list(self._pieces_rad)
        self._pieces_rad.append(piece_rad)
        if len(pieces_rad) < FEWEST_PIECES:
            return None
        shared_rad = cmath.phase(sum(cmath.exp(4j * each) for each in pieces_rad)) / 4.0
        along = sum(abs(off_square_rad(each, shared_rad)) <= ALONG_RAD for each in pieces_rad)
        off_rad = off_square_rad(piece_rad, shared_rad)
        if along < LEAST_SHARE * len(pieces_rad) or abs(off_rad) > ALONG_RAD:
            return None
        found_sd_rad = None
        if not abs(off_square_rad(shared_rad, self._direction_rad)) <= ALONG_RAD:
            self._direction_rad, found_sd_rad = shared_rad, PIECE_SD_RAD / math.sqrt(along)
        return OffDirection(off_square_rad(piece_rad, self._direction_rad), found_sd_rad)


def off_square_rad(heading_rad: float, direction_rad: float) -> float:
    """Return the angle from the nearest of a direction and its perpendiculars, within ±45°."""
    return math.remainder(heading_rad - direction_rad, 0.5 * math.pi)
