"""Heights from air pressure, as far as a barometer on a boot can be believed.

A barometer knows nothing of where it is, only by how much it rose: doors, fans, fire and weather
move the air as well. Here it is read; ``height_filter.py`` weighs it against the boot's own steps.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from edge_agent.inertial.stride_path import StridePath
from shared.units import NS_PER_S

GAS_CONSTANT_J_KG_K = 287.05
GRAVITY_M_S2 = 9.81
STANDARD_PRESSURE_PA = 101_325.0
ATMOSPHERE_PA = (30_000.0, 120_000.0)
"""From the highest mountains to the deepest mines; in another unit, it is another number."""


class BarometerSettings(NamedTuple):
    """How readings are judged.

    ``air_k`` is the air's temperature, which no reading tells. Readings that repeat for
    ``stuck_s``, and ``stuck_readings`` times, are of a sensor that hangs. A median has
    ``fewest`` readings or more. ``floor_sd_m`` is the error that all readings of a moment have in
    common: lag, wind, the pressure of a step on a sealed boot.
    """

    air_k: float = 288.15
    held_s: float = 8.0
    stuck_s: float = 2.0
    stuck_readings: int = 8
    fewest: int = 3
    floor_sd_m: float = 0.1


class Reading(NamedTuple):
    """A height above wherever the pressure is ``STANDARD_PRESSURE_PA``, at its sample's time."""

    time_ns: int
    height_m: float


class Level(NamedTuple):
    """A height and its variance."""

    height_m: float
    variance_m2: float


def pressure_height_m(pressure_pa: float, air_k: float) -> float:
    """Return the height above the standard pressure: the hypsometric equation, ``R·T/g·ln p₀/p``.

    Of air that is 10 K warmer than ``air_k`` it is 3.5 % short.
    """
    scale_m = GAS_CONSTANT_J_KG_K * air_k / GRAVITY_M_S2
    return scale_m * math.log(STANDARD_PRESSURE_PA / pressure_pa)


class Barometer:
    """Takes readings in order; forgets those that no air can have, and those of a hung sensor."""

    def __init__(self, settings: BarometerSettings | None = None) -> None:
        self.settings = settings or BarometerSettings()
        self._readings: deque[Reading] = deque()
        self._last_pa = 0.0
        self._same_since_ns = 0
        self._same = 0

    def take(self, time_ns: int, pressure_pa: float) -> Reading | None:
        """Take in a reading; return it as a height if it can be one."""
        if not ATMOSPHERE_PA[0] <= pressure_pa <= ATMOSPHERE_PA[1]:
            return None
        readings, settings = self._readings, self.settings
        if readings and time_ns <= readings[-1].time_ns:
            readings.clear()  # The clock was set back.
        if pressure_pa != self._last_pa or time_ns < self._same_since_ns:
            self._last_pa, self._same_since_ns, self._same = pressure_pa, time_ns, 0
        self._same += 1
        if self._hangs(time_ns):
            while readings and readings[-1].time_ns >= self._same_since_ns:
                readings.pop()
            return None
        reading = Reading(time_ns, pressure_height_m(pressure_pa, settings.air_k))
        readings.append(reading)
        while readings[0].time_ns < time_ns - settings.held_s * NS_PER_S:
            readings.popleft()
        return reading

    def _hangs(self, time_ns: int) -> bool:
        since_ns = time_ns - self._same_since_ns
        settings = self.settings
        return since_ns >= settings.stuck_s * NS_PER_S and self._same >= settings.stuck_readings

    def above(self, path: StridePath, from_ns: int) -> Level | None:
        """Return how much higher the barometer is than the boot's own ``path``.

        The median over the readings after ``from_ns`` up to the path's end; its variance by their
        median deviation. ``None`` of too few readings.
        """
        until_ns = int(path.time_ns[-1])
        within = [one for one in self._readings if from_ns < one.time_ns <= until_ns]
        if len(within) < self.settings.fewest:
            return None
        times_ns, heights_m = np.array(within).T
        up_m = -np.interp(times_ns, path.time_ns, path.position_m[:, 2])
        return _median(heights_m - up_m, self.settings.floor_sd_m)


def _median(heights_m: NDArray[np.float64], floor_sd_m: float) -> Level:
    median_m = float(np.median(heights_m))
    # Of normal errors the median deviation is 0.67 sd, the median's variance π/2 of the mean's.
    scatter_m = float(np.median(np.abs(heights_m - median_m))) / 0.6745
    white_m2 = 0.5 * math.pi * scatter_m**2 / len(heights_m)
    return Level(median_m, white_m2 + floor_sd_m**2)
