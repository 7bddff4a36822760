"""Which magnetic fields may tell a heading: those as strong and as steep as is usual here.

Steel that bends a field sideways bends it up or down as well, and makes it stronger or weaker. How
strong and steep the earth's is, is learnt along the way, as the median over places: a single one,
that of setting out, may be beside a steel door.
"""

from __future__ import annotations

import math
import statistics
from collections import deque

from edge_agent.inertial.heading import dip_rad
from shared.maths.rotations import Vector3

STRENGTH_SHARE = 0.10
DIP_RAD = math.radians(8.0)
"""So far from the usual a field may be."""

FEWEST_PLACES = 8
MOST_PLACES = 60
"""Of how many places the usual is the median: fewer do not tell it, older ones are far away."""


class FieldGate:
    """Takes the field of each new place, tells whether it is to be trusted. Plain state."""

    def __init__(self) -> None:
        self._strengths_ut: deque[float] = deque(maxlen=MOST_PLACES)
        self._dips_rad: deque[float] = deque(maxlen=MOST_PLACES)

    def admits(self, level_ut: Vector3) -> bool:
        """Take in a field in north, east and down; return whether it is as usual here."""
        strength_ut, dip = math.hypot(*level_ut), dip_rad(level_ut)
        self._strengths_ut.append(strength_ut)
        self._dips_rad.append(dip)
        if len(self._dips_rad) < FEWEST_PLACES:
            return False
        usual_ut = statistics.median(self._strengths_ut)
        return (
            abs(strength_ut - usual_ut) <= STRENGTH_SHARE * usual_ut
            and abs(dip - statistics.median(self._dips_rad)) <= DIP_RAD
        )
