"""The walls of a building as a plan has them, and the axis along which they run (pure)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta

from shared.maths.angles import nearest_right_angle_rad, wrap_rad

Coordinate: TypeAlias = Annotated[float, Meta(ge=-1e5, le=1e5)]

ALONG_RAD = math.radians(5.0)
LEAST_SHARE = 0.7


class Wall(msgspec.Struct, frozen=True, forbid_unknown_fields=True, array_like=True):
    """A straight stretch of wall between doors: both ends, north and east (m, incident's frame)."""

    from_north_m: Coordinate
    from_east_m: Coordinate
    to_north_m: Coordinate
    to_east_m: Coordinate

    @property
    def length_m(self) -> float:
        """How long it is."""
        return math.hypot(self.to_north_m - self.from_north_m, self.to_east_m - self.from_east_m)

    @property
    def direction_rad(self) -> float:
        """Which way it runs, clockwise from north."""
        return math.atan2(self.to_east_m - self.from_east_m, self.to_north_m - self.from_north_m)


def axis_of(walls: Sequence[Wall]) -> float | None:
    """Return the axis (rad, within ±45°) along or across which walls run; ``None`` if they do not.

    The mean direction, modulo a right angle, of those near the one that most of their length
    suits; ``LEAST_SHARE`` of all length must be.
    """
    if not walls:
        return None
    length_m = np.array([wall.length_m for wall in walls])
    direction_rad = np.array([wall.direction_rad for wall in walls])
    off_rad = direction_rad[:, None] - direction_rad[None, :]
    off_rad -= nearest_right_angle_rad(off_rad)
    near = np.abs(off_rad) < ALONG_RAD
    suited_m = length_m @ near
    best = int(np.argmax(suited_m))
    if suited_m[best] < LEAST_SHARE * math.fsum(length_m.tolist()):
        return None
    own = near[:, best]
    mean_rad = float(np.average(off_rad[own, best], weights=length_m[own]))
    axis_rad = float(direction_rad[best]) + mean_rad
    return wrap_rad(axis_rad - nearest_right_angle_rad(axis_rad))
