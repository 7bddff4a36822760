"""The magnetic field in a building: the Earth's, bent by steel."""

from __future__ import annotations

import math
from typing import Annotated, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

MODES = 24


class MagneticSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The Earth's field, and how much and over what distance a building disturbs it.

    North is magnetic north. ``disturbance_ut`` is the standard deviation along each axis.
    """

    strength_ut: Annotated[float, Meta(gt=0.0, le=100.0)] = 50.0
    dip_deg: Annotated[float, Meta(ge=-90.0, le=90.0)] = 60.0
    disturbance_ut: Annotated[float, Meta(ge=0.0, le=100.0)] = 2.5
    disturbance_length_m: Annotated[float, Meta(gt=0.1, le=100.0)] = 2.5


class MagneticField:
    """One building's field, drawn: a random sum of waves in space."""

    def __init__(self, settings: MagneticSettings, chance: np.random.Generator) -> None:
        dip_rad = math.radians(settings.dip_deg)
        self._earth_ut = settings.strength_ut * np.array(
            [math.cos(dip_rad), 0.0, math.sin(dip_rad)]
        )
        self._waves_rad_m = chance.normal(0.0, 1.0 / settings.disturbance_length_m, (3, MODES))
        self._phases_rad = chance.uniform(0.0, 2.0 * math.pi, (3, MODES))
        self._amplitude_ut = settings.disturbance_ut * math.sqrt(2.0 / MODES)

    def at(self, position_m: Array) -> Array:
        """Return the field (n, 3) in µT at each position (n, 3), both NED."""
        along_rad = position_m @ self._waves_rad_m
        waves = [np.cos(along_rad + phase).sum(axis=1) for phase in self._phases_rad]
        return np.asarray(self._earth_ut + self._amplitude_ut * np.column_stack(waves))
