"""What is left of a gyro's bias, by how people walk: for long straight on, between turns.

Nobody walks a circle of a kilometre. A course that turns by a tenth of a degree a second, while it
stays within a few degrees of itself, is a gyro that drifts; so heuristic drift elimination has it
(Borenstein and Ojeda, "Heuristic drift elimination for personnel tracking systems", J. Navigation
63, 2010). Here the course of each straight piece is a state beside the heading's error and drift
(see ``heading_drift.py``), and a bend is none.
"""

from __future__ import annotations

import math
from collections import deque

from edge_agent.inertial.heading_drift import RATE, Correction, HeadingDrift
from shared.maths.angles import wrap_rad

STRAIGHT_STEPS = 16
BENT_RAD = math.radians(3.0)
"""A straight piece begins with so many steps whose halves lead so much alike. In a bend of a
hundred metres' radius they do not."""

ENDS_STEPS = 8
ENDS_RAD = math.radians(5.0)
"""It ends where so many steps on average lead so far off it, for drift has been taken away."""

ASIDE_RAD = math.radians(25.0)
"""A step that leads further off is the first of a turn."""

STEP_SD_RAD = math.radians(5.0)
"""How far a step leads aside: the trunk turns to and fro with the legs."""


class StraightWalk:
    """Takes the courses of steps in order; tells by how much to turn what comes."""

    def __init__(self, drift_sd_rad_s: float) -> None:
        """Begin with a drift that is as far from nought as ``drift_sd_rad_s`` says."""
        self._drift = HeadingDrift()
        least = self._drift.covariance[RATE, RATE]
        self._drift.covariance[RATE, RATE] = max(least, drift_sd_rad_s**2)
        self._straight_rad: float | None = None
        self._courses_rad: deque[float] = deque(maxlen=STRAIGHT_STEPS)

    def take(
        self, course_rad: float, elapsed_s: float, turned_rad2: float, walked_m: float
    ) -> Correction:
        """Return what a step tells whose course, corrected so far, is ``course_rad``.

        ``turned_rad2`` is the variance of the gyro's turn over the time since the last step.
        """
        back = self._drift.drift_back(elapsed_s)
        self._drift.predict(elapsed_s, turned_rad2, walked_m)
        course_rad = wrap_rad(course_rad + back.turn_rad)
        self._courses_rad.append(course_rad)
        if self._straight_rad is None:
            self._begin()
            return back
        off_rad = wrap_rad(course_rad - self._straight_rad)
        last = list(self._courses_rad)[-ENDS_STEPS:]
        lately_rad = sum(wrap_rad(one - self._straight_rad) for one in last) / len(last)
        if abs(off_rad) > ASIDE_RAD or abs(lately_rad) > ENDS_RAD:
            self._straight_rad = None
            self._courses_rad.clear()
            return back
        told = self._drift.observe_direction(off_rad, STEP_SD_RAD)
        return Correction(back.turn_rad + told.turn_rad, back.variance_rad2 + told.variance_rad2)

    def _begin(self) -> None:
        """Begin a straight piece if the last steps have led alike."""
        if len(self._courses_rad) < STRAIGHT_STEPS:
            return
        first_rad = self._courses_rad[0]
        offs_rad = [wrap_rad(one - first_rad) for one in self._courses_rad]
        half = STRAIGHT_STEPS // 2
        early_rad, late_rad = sum(offs_rad[:half]) / half, sum(offs_rad[half:]) / half
        middle_rad = 0.5 * (early_rad + late_rad)
        if abs(late_rad - early_rad) > BENT_RAD or any(
            abs(off_rad - middle_rad) > ASIDE_RAD for off_rad in offs_rad
        ):
            return
        self._straight_rad = wrap_rad(first_rad + middle_rad)
        self._drift.reckon_direction(STEP_SD_RAD / math.sqrt(STRAIGHT_STEPS))
