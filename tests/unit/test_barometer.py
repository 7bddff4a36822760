"""Heights by air pressure: which readings count, and how well a moment's height is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from edge_agent.inertial.barometer import Barometer, BarometerSettings, pressure_height_m
from edge_agent.inertial.stride_path import StridePath
from shared.units import NS_PER_S

PERIOD_NS = NS_PER_S // 25
PA_PER_M = 12.0


def path(to_s: float, rise_m_s: float = 0.0) -> StridePath:
    """A way from time 0 that rises evenly."""
    time_ns = np.arange(0, round(to_s * NS_PER_S), 10_000_000)
    up_m = rise_m_s * time_ns / NS_PER_S
    return StridePath(time_ns, np.column_stack((0.0 * up_m, 0.0 * up_m, -up_m)))


def test_the_height_of_a_standard_atmospheres_layer() -> None:
    """Of the same temperature throughout, 11 % less pressure is 1 km up."""
    assert pressure_height_m(101_325.0, 288.15) == 0.0
    pressure_pa = 101_325.0 * math.exp(-9.81 * 1000.0 / (287.05 * 288.15))
    assert pressure_height_m(pressure_pa, 288.15) == pytest.approx(1000.0)
    assert pressure_height_m(pressure_pa, 298.15) == pytest.approx(1000.0 * 298.15 / 288.15)


@pytest.mark.parametrize("reading", [math.nan, math.inf, -1.0, 0.0, 1013.25, 101.3, 29_999.0, 2e5])
def test_what_no_air_weighs_is_no_reading(reading: float) -> None:
    assert Barometer().take(0, reading) is None


def test_a_sensor_that_hangs_is_not_read_until_it_goes_on() -> None:
    barometer = Barometer()
    for index in range(200):
        hung = 50 <= index < 150
        taken = barometer.take(index * PERIOD_NS, 1e5 if hung else 1e5 + 1 + index % 7)
        settled_s = (index - 50) / 25.0
        assert (taken is None) == (hung and settled_s >= BarometerSettings().stuck_s)
    # What it read before it was known to hang is not believed either.
    assert barometer.above(path(3.5), 2 * NS_PER_S) is None
    assert barometer.above(path(8.0), 7 * NS_PER_S) is not None


def test_the_height_above_a_boot_that_rises_is_the_same_all_along() -> None:
    barometer = Barometer()
    for index in range(60):
        rise_m = 0.4 * index / 25.0
        barometer.take(index * PERIOD_NS, 1e5 - PA_PER_M * rise_m + 0.001 * (index % 2))
    level = barometer.above(path(2.0, rise_m_s=0.4), 0)
    assert level is not None
    assert level.height_m == pytest.approx(pressure_height_m(1e5, 288.15), abs=0.02)
    assert math.sqrt(level.variance_m2) == pytest.approx(0.1, abs=0.01)


def test_single_readings_far_off_do_little_and_scatter_is_said() -> None:
    rng = np.random.default_rng(2)
    errors_m, sds_m = [], []
    for _ in range(300):
        barometer = Barometer()
        for index in range(25):
            spike = 500.0 if index % 9 == 0 else 0.0
            barometer.take(index * PERIOD_NS, 1e5 + rng.normal(0.0, 24.0) + spike)
        level = barometer.above(path(1.0), -1)
        assert level is not None
        errors_m.append(level.height_m - pressure_height_m(1e5, 288.15))
        sds_m.append(math.sqrt(level.variance_m2))
    assert np.std(errors_m) == pytest.approx(np.mean(sds_m), rel=0.3)


def test_a_clock_set_back_forgets_what_was_read() -> None:
    barometer = Barometer()
    for index in range(25):
        barometer.take(index * PERIOD_NS, 1e5 + index)
    barometer.take(0, 1e5)
    assert barometer.above(path(1.0), -1) is None
