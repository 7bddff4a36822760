"""Heading from a gyro of one axis and a compass, each sample by one of them, as published.

"Gait information and pedestrian localisation with a 3-axis accelerometer": iron bends the compass
while nobody turns, and a gyro drifts. Which is believed is decided by how both change.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from shared.maths.angles import wrap_rad


class SelectionSettings(NamedTuple):
    """Rates (rad/s) below which either takes nobody to turn. The paper gives none."""

    gyro_still_rad_s: float = math.radians(3.0)
    compass_still_rad_s: float = math.radians(3.0)


class GyroOrCompass:
    """The heading, clockwise, from the compass's north; from 0 where there is none."""

    def __init__(self, settings: SelectionSettings | None = None) -> None:
        self.heading_rad = 0.0
        self._settings = settings or SelectionSettings()
        self._compass_rad: float | None = None

    def step(self, rate_rad_s: float, compass_rad: float | None, period_s: float) -> None:
        """Take in the rate about the vertical over ``period_s``, and the compass at its end."""
        last_rad, self._compass_rad = self._compass_rad, compass_rad
        turned_rad = rate_rad_s * period_s
        if compass_rad is not None and last_rad is None:
            self.heading_rad = compass_rad
            return
        if compass_rad is not None and last_rad is not None and period_s > 0.0:
            swung_rad = wrap_rad(compass_rad - last_rad)
            if self._believes_compass(rate_rad_s, swung_rad / period_s):
                turned_rad = swung_rad
        self.heading_rad = wrap_rad(self.heading_rad + turned_rad)

    def _believes_compass(self, gyro_rad_s: float, compass_rad_s: float) -> bool:
        """Whether the compass is believed; where no rule of the paper speaks, it is."""
        gyro_turns = abs(gyro_rad_s) > self._settings.gyro_still_rad_s
        compass_turns = abs(compass_rad_s) > self._settings.compass_still_rad_s
        if compass_turns and not gyro_turns:
            return False
        if gyro_turns and not compass_turns:
            return True
        return gyro_rad_s * compass_rad_s >= 0.0
