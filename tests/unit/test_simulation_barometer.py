"""What the simulated barometer reads: heights, at its own rate, in air that moves."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from shared.simulation.barometer import BarometerSettings, read_pressure_pa
from shared.simulation.boot_imu import simulate_boot_imu
from tests.simulated_walks import gait_walk

CALM = BarometerSettings(
    offset_pa=0.0, noise_pa=0.0, weather_pa_min=0.0, puffs_per_min=0.0, fans_per_min=0.0,
    lag_s=0.0, resolution_pa=0.01, air_c=(15.0, 15.0),
)  # fmt: skip
TIME_S = np.arange(0.0, 60.0, 0.01)


def chance(seed: int = 3) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_calm_air_weighs_what_it_does() -> None:
    """At 15 °C it is 101.325 kPa at sea level, and at 8.43 km a factor of e less."""
    height_m = np.where(TIME_S < 30.0, 0.0, 287.05 * 288.15 / 9.81)
    read_pa = read_pressure_pa(CALM, TIME_S, height_m, chance())
    told = np.isfinite(read_pa)
    assert told.sum() == pytest.approx(60.0 * 25.0, abs=2)
    assert read_pa[told][0] == pytest.approx(101_325.0, abs=0.01)
    assert read_pa[told][-1] == pytest.approx(101_325.0 / math.e, abs=0.01)


def test_a_metre_is_12_pascal_and_a_slow_sensor_lags() -> None:
    settings = msgspec.structs.replace(CALM, lag_s=1.0)
    read_pa = read_pressure_pa(settings, TIME_S, 1.0 * TIME_S, chance())
    slow = np.flatnonzero(np.isfinite(read_pa))
    behind_m = TIME_S[slow] - (101_325.0 - read_pa[slow]) / 12.0
    assert behind_m[100] == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ("name", "spread_pa"), [("offset_pa", 400.0), ("weather_pa_min", 5.0), ("fan_pa", 15.0)]
)
def test_each_disturbance_disturbs(name: str, spread_pa: float) -> None:
    settings = msgspec.structs.replace(CALM, **{name: spread_pa})
    if name == "fan_pa":
        settings = msgspec.structs.replace(settings, fans_per_min=1.0)
    ends_pa = [
        np.nanmean(read_pressure_pa(settings, TIME_S, 0.0 * TIME_S, chance(seed))[-200:])
        for seed in range(40)
    ]
    assert np.std(ends_pa) == pytest.approx(spread_pa, rel=0.4)


def test_puffs_pass() -> None:
    settings = msgspec.structs.replace(CALM, puffs_per_min=4.0, puff_pa=20.0)
    read_pa = read_pressure_pa(settings, TIME_S, 0.0 * TIME_S, chance()) - 101_325.0
    assert np.nanmax(np.abs(read_pa)) > 5.0
    assert np.nanmedian(np.abs(read_pa)) < 0.5


def test_it_is_read_beside_the_inertial_sensor_and_leaves_that_as_it_was() -> None:
    without = gait_walk("stairs_up", 0.0)
    scenario = msgspec.structs.replace(without, barometer=CALM)
    bare, boot = (simulate_boot_imu(one, "r1", seed=1) for one in (without, scenario))
    assert bare.pressure_pa is None
    np.testing.assert_array_equal(bare.force_m_s2, boot.force_m_s2)
    told = [sample.pressure_pa for sample in boot.samples(0) if sample.pressure_pa is not None]
    assert len(told) == pytest.approx(25.0 * boot.time_s[-1], rel=0.02)
    assert (told[0] - told[-1]) / 12.0 == pytest.approx(3.3, abs=0.1)
