"""Which way the boot faces as it sets out: from the magnetometer, if there is one to be trusted.

As in "Indoor location tracking for first responders using data network": the magnetometer gives
the first heading, the gyro carries it on. Inside, steel bends the field from place to place, so it
is asked once, while the responder stands at the entrance.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from shared.maths.rotations import Vector3

UNKNOWN_HEADING_SD_RAD = math.pi / math.sqrt(3.0)
"""Standard deviation of a heading of which nothing is known: uniform around the circle."""

MAGNETIC_HEADING_SD_RAD = math.radians(15.0)
"""Of a magnetic heading taken beside a building: what steel and the boot's own iron do to it."""

EARTH_FIELD_UT = (20.0, 70.0)
"""The earth's field is 22 to 67 µT strong, wherever one stands; anything else is something else."""

WEAKEST_HORIZONTAL_UT = 5.0
"""With less than this along the ground a compass has nothing to point by."""


class Heading(NamedTuple):
    """A heading, clockwise from magnetic north, and its standard deviation."""

    heading_rad: float
    sd_rad: float


class MagneticHeading:
    """Mean field over the first standing, in the level frame: tilt is compensated in advance."""

    def __init__(self) -> None:
        self._count = 0
        self._sum_ut = (0.0, 0.0, 0.0)

    def add(self, level_field_ut: Vector3) -> None:
        """Take in one reading, turned into a level frame whose north is arbitrary but fixed."""
        n, e, d = level_field_ut
        sn, se, sd = self._sum_ut
        self._sum_ut = (sn + n, se + e, sd + d)
        self._count += 1

    def offset(self) -> Heading:
        """Return the heading of the level frame's north, to be added to headings in that frame.

        Zero, and unknown, without readings or with a field that cannot be the earth's.
        """
        if not self._count:
            return Heading(0.0, UNKNOWN_HEADING_SD_RAD)
        north, east, down = (total / self._count for total in self._sum_ut)
        low_ut, high_ut = EARTH_FIELD_UT
        earthly = low_ut <= math.hypot(north, east, down) <= high_ut
        if not earthly or math.hypot(north, east) < WEAKEST_HORIZONTAL_UT:
            return Heading(0.0, UNKNOWN_HEADING_SD_RAD)
        return Heading(-math.atan2(east, north), MAGNETIC_HEADING_SD_RAD)
