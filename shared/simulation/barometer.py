"""What the barometer on the boot reads: the air's weight, and all else that moves air.

A building on fire is no still air: weather drifts, doors push puffs of it, fans set a storey under
pressure, and one column of air is warmer than another.
"""

from __future__ import annotations

from typing import Annotated, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Spread: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e4)]

SEA_LEVEL_PA = 101_325.0
GAS_CONSTANT_J_KG_K = 287.05
GRAVITY_M_S2 = 9.81
ICE_POINT_K = 273.15


class BarometerSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A kind of barometer, and how the air is.

    ``offset_pa`` is the spread of its error and the weather's, ``noise_pa`` the white noise of a
    reading, told in steps of ``resolution_pa``; what is read is the mean of the last ``lag_s``.
    ``weather_pa_min`` is the standard deviation of what pressure drifts in a minute.
    ``puffs_per_min`` doors push ``puff_pa`` (standard deviation) that fades in ``puff_s``;
    ``fans_per_min`` fans start or stop and shift pressure by ``fan_pa`` for good, within
    ``fan_s``. The air's temperature is uniform between the two of ``air_c``.
    """

    rate_hz: Annotated[float, Meta(ge=1.0, le=200.0)] = 25.0
    offset_pa: Spread = 400.0
    noise_pa: Spread = 1.5
    resolution_pa: Annotated[float, Meta(gt=0.0, le=100.0)] = 0.18
    lag_s: Annotated[float, Meta(ge=0.0, le=5.0)] = 0.08
    weather_pa_min: Spread = 1.5
    puffs_per_min: Spread = 1.0
    puff_pa: Spread = 6.0
    puff_s: Annotated[float, Meta(gt=0.0, le=60.0)] = 1.2
    fans_per_min: Spread = 0.25
    fan_pa: Spread = 15.0
    fan_s: Annotated[float, Meta(gt=0.0, le=60.0)] = 2.0
    air_c: tuple[float, float] = (-5.0, 40.0)


def read_pressure_pa(
    settings: BarometerSettings, time_s: Array, height_m: Array, chance: np.random.Generator
) -> Array:
    """Return what is read (n,) along with inertial samples at ``time_s`` (n,), NaN in between.

    ``height_m`` (n,) is the sensor's, above the incident's origin.
    """
    kelvin = ICE_POINT_K + chance.uniform(*settings.air_c)
    ground_pa = SEA_LEVEL_PA + chance.normal(0.0, settings.offset_pa)
    pressure_pa = ground_pa * np.exp(-GRAVITY_M_S2 * height_m / (GAS_CONSTANT_J_KG_K * kelvin))
    pressure_pa += _disturbance_pa(settings, time_s, chance)
    span_s = float(time_s[-1] - time_s[0])
    read_s = time_s[0] + np.arange(int(span_s * settings.rate_hz) + 1) / settings.rate_hz
    summed = np.append(0.0, np.cumsum(0.5 * (pressure_pa[1:] + pressure_pa[:-1]) * np.diff(time_s)))
    from_s = np.maximum(read_s - settings.lag_s, time_s[0])
    lasted_s = read_s - from_s
    mean_pa = np.interp(read_s, time_s, pressure_pa)
    long = lasted_s > 0.0
    mean_pa[long] = (np.interp(read_s, time_s, summed) - np.interp(from_s, time_s, summed))[
        long
    ] / lasted_s[long]
    mean_pa += chance.normal(0.0, settings.noise_pa, len(read_s))
    told = np.full(len(time_s), np.nan)
    rows = np.minimum(np.searchsorted(time_s, read_s), len(time_s) - 1)
    told[rows] = np.round(mean_pa / settings.resolution_pa) * settings.resolution_pa
    return told


def _disturbance_pa(
    settings: BarometerSettings, time_s: Array, chance: np.random.Generator
) -> Array:
    """Return by how much weather, doors and fans move the pressure (n,), from zero."""
    step_s = np.diff(time_s, prepend=time_s[0])
    walk_pa = settings.weather_pa_min / np.sqrt(60.0) * np.sqrt(step_s)
    total_pa = np.cumsum(chance.normal(0.0, 1.0, len(time_s)) * walk_pa)
    minutes = float(time_s[-1] - time_s[0]) / 60.0
    for _ in range(int(chance.poisson(settings.puffs_per_min * minutes))):
        since_s = time_s - chance.uniform(time_s[0], time_s[-1])
        fades = np.exp(-np.maximum(since_s, 0.0) / settings.puff_s)
        total_pa += np.where(since_s > 0.0, chance.normal(0.0, settings.puff_pa) * fades, 0.0)
    for _ in range(int(chance.poisson(settings.fans_per_min * minutes))):
        since_s = time_s - chance.uniform(time_s[0], time_s[-1])
        rises = 1.0 - np.exp(-np.maximum(since_s, 0.0) / settings.fan_s)
        total_pa += chance.normal(0.0, settings.fan_pa) * rises
    return np.asarray(total_pa)
