"""Which way the boot faces as it sets out: from the magnetometer, if there is one to be trusted.

As in "Indoor location tracking for first responders using data network": the magnetometer gives
the first heading, the gyro carries it on. Inside, steel bends the field from place to place, so it
is asked once, while the responder stands at the entrance; what it says on the way is worth less
(see ``heading_drift.py``).
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

DIPOLE_EQUATOR_UT = 30.0
DIPOLE_SHARE = (0.5, 1.5)
"""The earth's field against that of a dipole of the same dip: 0.53 at the Cape of Good Hope, 1.42
on the Andaman Islands."""


class Heading(NamedTuple):
    """A heading, clockwise from magnetic north, and its standard deviation."""

    heading_rad: float
    sd_rad: float


def dip_rad(level_ut: Vector3) -> float:
    """Return how far a field in north, east and down points below the horizon."""
    north, east, down = level_ut
    return math.atan2(down, math.hypot(north, east))


def is_earthly(level_ut: Vector3) -> bool:
    """Whether somewhere on earth a field is as strong as this, and as steep there.

    A dipole's field dips by I where it is ``2·B₀/√(1 + 3·cos²I)`` strong, of B₀ on the equator;
    the earth's is one to within ``DIPOLE_SHARE``. Beside steel a field as strong as the earth's is
    at its poles may lie level.
    """
    strength_ut = math.hypot(*level_ut)
    dipole_ut = 2.0 * DIPOLE_EQUATOR_UT / math.sqrt(1.0 + 3.0 * math.cos(dip_rad(level_ut)) ** 2)
    weakest, strongest = DIPOLE_SHARE
    low_ut, high_ut = EARTH_FIELD_UT
    return (
        low_ut <= strength_ut <= high_ut
        and weakest * dipole_ut <= strength_ut <= strongest * dipole_ut
        and math.hypot(*level_ut[:2]) >= WEAKEST_HORIZONTAL_UT
    )


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
        if not is_earthly((north, east, down)):
            return Heading(0.0, UNKNOWN_HEADING_SD_RAD)
        return Heading(-math.atan2(east, north), MAGNETIC_HEADING_SD_RAD)
