"""How far the gyro's heading has drifted since setting out, by whatever else tells a heading.

An extended Kalman filter of the heading's error alone: of error and drift rate, the level field of
the earth, what the building adds to it around here, the iron of boot and sensor, and how far off
the direction is that was taken for the building's. All of that is unknown at first, so a
magnetometer tells of a drift no more than it can tell apart from steel, and one whose iron is not
known tells nothing until it has been turned about. What the filter takes away is told with its
variance, to be added to the increments that it turns.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

ERROR, RATE, DIRECTION, STATES = 0, 1, 9, 10
EARTH, AREA, IRON = slice(2, 4), slice(4, 6), slice(6, 9)
"""States: rad, rad/s, then µT: north and east twice, and the sensor's own axes; then rad."""

RATE_SD_RAD_S = math.radians(0.04)
RATE_KEPT_S = 1800.0
"""Drift that is left to a gyro whose bias is known from stops, and for how long it stays so."""

UNKNOWN_FIELD_SD_UT = 100.0

AREA_SD_UT = 8.0
AREA_LENGTH_M = 30.0
"""What a part of a building adds to the level field, and how far one walks out of it."""

PLACE_SD_UT = 8.0
LEAST_ANGLE_SD_RAD = math.radians(18.0)
"""What a place adds to that, and how far off a compass is there at the least, however strong the
field. Over the stances of five walks indoors it scatters by 11 to 30°, and by 8 to 19° over the
third to half of them that :class:`FieldGate` admits."""

IRON_SD_UT = 12.0
"""A boot's steel, with a magnetometer that was calibrated without the boot."""

LARGEST_MISFIT = 9.2
"""Innovations squared beyond this (χ² of two, 99 %) are of no field that was reckoned with."""

MISFITS_KEPT = 20.0
"""Over so many places it is judged whether fields vary as supposed, or more."""

WORST_MISFIT = 50.0
"""No place says more against them than this."""


class Correction(NamedTuple):
    """By how much to turn the heading from now on (rad, clockwise), and the variance of that."""

    turn_rad: float
    variance_rad2: float


NO_CORRECTION = Correction(0.0, 0.0)


class HeadingDrift:
    """The filter. What it finds is taken to be corrected at once: its error is always nought."""

    def __init__(self) -> None:
        self._mean = np.zeros(STATES)
        sd = np.empty(STATES)
        sd[ERROR], sd[RATE] = 0.0, RATE_SD_RAD_S
        sd[EARTH], sd[AREA], sd[IRON] = UNKNOWN_FIELD_SD_UT, AREA_SD_UT, IRON_SD_UT
        sd[DIRECTION] = 0.0
        self.covariance = np.diag(sd**2)
        """Of the states, 10×10."""
        self._misfit = 1.0

    @property
    def error_sd_rad(self) -> float:
        """How well heading is known against that at setting out."""
        return math.sqrt(self.covariance[ERROR, ERROR])

    def drift_back(self, elapsed_s: float) -> Correction:
        """Return what takes away the drift of ``elapsed_s`` at the rate known by now."""
        learnt = max(0.0, RATE_SD_RAD_S**2 - float(self.covariance[RATE, RATE]))
        return Correction(-float(self._mean[RATE]) * elapsed_s, learnt * elapsed_s**2)

    def predict(self, elapsed_s: float, turned_rad2: float, walked_m: float) -> None:
        """Go on by ``elapsed_s`` and ``walked_m``, with noise of ``turned_rad2`` in the heading.

        The mean drift of that time is taken to be corrected (see :meth:`drift_back`).
        """
        transition = np.eye(STATES)
        transition[ERROR, RATE] = elapsed_s
        rate_kept = math.exp(-elapsed_s / RATE_KEPT_S)
        area_kept = math.exp(-walked_m / AREA_LENGTH_M)
        transition[RATE, RATE] = rate_kept
        transition[AREA, AREA] *= area_kept
        self._mean[RATE] *= rate_kept
        self._mean[AREA] *= area_kept
        covariance = transition @ self.covariance @ transition.T
        covariance[ERROR, ERROR] += turned_rad2
        covariance[RATE, RATE] += (1.0 - rate_kept**2) * RATE_SD_RAD_S**2
        covariance[AREA, AREA] += (1.0 - area_kept**2) * AREA_SD_UT**2 * np.eye(2)
        self.covariance = covariance

    def observe_field(self, level_ut: Array, level_from_sensor: Array) -> Correction:
        """Take in the field (2,) north and east of a new place, as the heading has it by now.

        ``level_from_sensor`` (2, 3) turns the sensor's axes into north and east.
        """
        earth_ut = self._mean[EARTH]
        model = np.zeros((2, STATES))
        model[:, ERROR] = (-earth_ut[1], earth_ut[0])
        model[:, EARTH] = model[:, AREA] = np.eye(2)
        model[:, IRON] = level_from_sensor
        sd_ut = max(PLACE_SD_UT, LEAST_ANGLE_SD_RAD * float(np.linalg.norm(level_ut)))
        off_ut = level_ut - model @ self._mean
        expected = model @ self.covariance @ model.T
        told = expected + sd_ut**2 * np.eye(2)
        misfit = 0.5 * float(off_ut @ np.linalg.solve(told, off_ut))
        self._misfit += (min(misfit, WORST_MISFIT) - self._misfit) / MISFITS_KEPT
        told += (max(1.0, self._misfit) - 1.0) * sd_ut**2 * np.eye(2)
        if float(off_ut @ np.linalg.solve(told, off_ut)) > LARGEST_MISFIT:
            return NO_CORRECTION
        return self._correct(model, told, off_ut)

    def reckon_direction(self, sd_rad: float) -> None:
        """Note that a direction of the building has been found, by headings as they are told now.

        It is off by their error, and by what the pieces of the way scatter, ``sd_rad``.
        """
        self._mean[DIRECTION] = 0.0
        covariance = self.covariance
        covariance[DIRECTION] = covariance[:, DIRECTION] = -covariance[ERROR]
        covariance[DIRECTION, DIRECTION] = covariance[ERROR, ERROR] + sd_rad**2

    def observe_direction(self, off_rad: float, sd_rad: float) -> Correction:
        """Take in that a piece of the way came out ``off_rad`` clockwise of that direction."""
        model = np.zeros((1, STATES))
        model[0, [ERROR, DIRECTION]] = 1.0
        told = model @ self.covariance @ model.T + sd_rad**2
        return self._correct(model, told, off_rad - model @ self._mean)

    def _correct(self, model: Array, told: Array, off: Array) -> Correction:
        gain = np.linalg.solve(told, model @ self.covariance).T
        self._mean = self._mean + gain @ off
        covariance = self.covariance - gain @ told @ gain.T
        self.covariance = 0.5 * (covariance + covariance.T)
        turn_rad = -float(self._mean[ERROR])
        self._mean[ERROR] = 0.0
        return Correction(turn_rad, float(gain[ERROR] @ told @ gain[ERROR]))
