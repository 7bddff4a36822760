"""How radio spreads: each part of the model by itself."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from shared.simulation.chance import generator
from shared.simulation.plan import Attenuation, Floor, Plan, Wall
from shared.simulation.propagation import (
    RadioParameters,
    draw_surroundings,
    mean_power_dbm,
    multipath_field,
    probability_heard,
    received_power_dbm,
    rician_k,
    smooth_field,
)

LEVEL = RadioParameters(worn_height_m=1.0, dap_height_m=1.0)
"""Both antennas at one height, so that ranges on the floor are ranges."""

HERE = np.zeros(3)
FACING_IT = np.array([np.pi])
"""The heading of somebody north of the DAP who looks at it."""


def plan_with(*walls: Wall) -> Plan:
    floors = (Floor("ground", 0.0), Floor("first", 3.0), Floor("second", 6.0))
    return Plan("for tests", floors, walls)


def power_at(north_m: float, plan: Plan, up_m: float = 0.0) -> float:
    there = np.array([[north_m, 0.0, -up_m]])
    return float(mean_power_dbm(LEVEL, plan, HERE, there, FACING_IT)[0])


def test_power_falls_with_range_by_the_exponent() -> None:
    clear = plan_with()
    assert power_at(1.0, clear) == pytest.approx(LEVEL.power_at_1_m_dbm)
    per_decade_db = power_at(2.0, clear) - power_at(20.0, clear)
    assert per_decade_db == pytest.approx(10.0 * LEVEL.path_loss_exponent)


def test_at_the_antenna_power_is_finite() -> None:
    assert power_at(0.0, plan_with()) == power_at(0.05, plan_with()) > power_at(0.2, plan_with())


@pytest.mark.parametrize(("attenuation", "loss_db"), [("light", 3.4), ("brick", 6.9)])
def test_each_wall_takes_what_its_class_takes(attenuation: Attenuation, loss_db: float) -> None:
    walls = [Wall("ground", (at, -1.0), (at, 1.0), attenuation) for at in (2.0, 3.0)]
    clear_dbm = power_at(5.0, plan_with())
    assert clear_dbm - power_at(5.0, plan_with(*walls[:1])) == pytest.approx(loss_db)
    assert clear_dbm - power_at(5.0, plan_with(*walls)) == pytest.approx(2.0 * loss_db)


def test_a_second_floor_takes_less_than_the_first() -> None:
    plan = plan_with()
    beside_dbm = [power_at(float(np.hypot(0.1, up_m)), plan) for up_m in (3.0, 6.0)]
    ahead = replace(LEVEL, body_loss_db=0.0)
    above = np.array([[0.1, 0.0, -3.0], [0.1, 0.0, -6.0]])
    above_dbm = mean_power_dbm(ahead, plan, HERE, above, np.zeros(2))
    one_db, two_db = beside_dbm - above_dbm
    assert one_db == pytest.approx(LEVEL.floor_loss_db)
    assert one_db < two_db < 2.0 * one_db


def test_the_torso_is_in_the_way_of_who_turns_away() -> None:
    there = np.array([[4.0, 0.0, 0.0]]).repeat(3, axis=0)
    headings = np.array([np.pi, np.pi / 2.0, 0.0])
    toward, across, away = mean_power_dbm(LEVEL, plan_with(), HERE, there, headings)
    assert toward == pytest.approx(across)
    assert toward - away == pytest.approx(LEVEL.body_loss_db)


def test_shadowing_is_smooth_over_its_length() -> None:
    length_m = 2.5
    places = np.array([[0.0, 0.0, 0.0], [length_m, 0.0, 0.0], [0.0, 10.0 * length_m, 0.0]])
    fields = [smooth_field(length_m, generator(seed, "test")) for seed in range(2000)]
    values = np.sqrt(2.0) * np.array([field.at(places).real for field in fields])
    correlation = np.corrcoef(values.T)
    assert values.std(axis=0) == pytest.approx(1.0, abs=0.05)
    assert correlation[0, 1] == pytest.approx(np.exp(-0.5), abs=0.05)
    assert correlation[0, 2] == pytest.approx(0.0, abs=0.07)


def test_multipath_changes_within_a_wavelength() -> None:
    wavelength_m = 0.125
    places = np.array([[0.0, 0.0, 0.0], [0.001, 0.0, 0.0], [0.5 * wavelength_m, 0.0, 0.0]])
    fields = [multipath_field(wavelength_m, generator(seed, "test")) for seed in range(2000)]
    values = np.array([field.at(places) for field in fields])
    power = np.abs(values) ** 2
    assert power.mean(axis=0) == pytest.approx(1.0, abs=0.1)
    assert abs(np.mean(values[:, 0] * values[:, 1].conj())) == pytest.approx(1.0, abs=0.1)
    assert abs(np.mean(values[:, 0] * values[:, 2].conj())) < 0.1


def test_fading_is_the_deeper_the_farther_and_behind_walls() -> None:
    range_m = np.array([1.0, 5.0, 10.0, 100.0])
    k = rician_k(LEVEL, range_m, np.zeros(4, dtype=np.intp))
    behind = rician_k(LEVEL, range_m, np.ones(4, dtype=np.intp))
    assert np.all(np.diff(k) < 0.0)
    assert np.all(behind[:3] < k[:3])
    assert k[3] == pytest.approx(10.0 ** (LEVEL.rician_k_least_db / 10.0))


def spread_over_a_metre_db(range_m: float, seed: int) -> float:
    """Return how much power changes along a metre across the line to the DAP."""
    across_m = np.linspace(-0.5, 0.5, 40)
    there = np.column_stack([np.full(40, range_m), across_m, np.zeros(40)])
    around = draw_surroundings(LEVEL, generator(seed, "test"))
    power_dbm = received_power_dbm(LEVEL, plan_with(), around, HERE, there, np.full(40, np.pi))
    return float(power_dbm.std())


def test_variance_grows_with_range() -> None:
    spread_db = [
        np.mean([spread_over_a_metre_db(range_m, seed) for seed in range(20)])
        for range_m in (1.0, 6.0, 15.0)
    ]
    assert spread_db[0] < 0.8 * spread_db[1] < 0.8 * spread_db[2]


def test_readings_are_lost_near_the_receivers_floor() -> None:
    floor_dbm = LEVEL.sensitivity_dbm
    heard = probability_heard(LEVEL, floor_dbm + np.array([40.0, 3.0, 0.0, -40.0]))
    best = 1.0 - LEVEL.loss_probability
    assert heard[0] == pytest.approx(best)
    assert best > heard[1] > heard[2]
    assert heard[2] == pytest.approx(0.5 * best)
    assert heard[3] == pytest.approx(0.0, abs=1e-9)
