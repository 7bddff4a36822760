"""The simulated boot sensor: it closes without errors, and looks like a real one with them."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest

from shared.maths.angles import wrap_rad
from shared.maths.rotations import from_rotation_vector, multiply, rotate
from shared.simulation.boot_imu import simulate_boot_imu
from shared.simulation.gait_figures import FIGURES, recorded_figures, simulated_figures
from shared.simulation.imu_errors import ImuSettings, ringing
from shared.simulation.inertial_reading import GRAVITY_M_S2, nav_from_body
from shared.simulation.legs import Gait, Stand
from shared.simulation.magnetic import MagneticSettings
from shared.simulation.scenario import Scenario, load_scenario
from shared.simulation.walker import Walk, simulate_walk
from tests.simulated_walks import ALL_GAITS, gait_walk

PERFECT = ImuSettings(rate_hz=2000.0).without_errors()

RECORDED = {
    "walk": ((2.67, 6.43), (372.0, 566.0), (6.0, 23.6), (0.0, 0.37), (0.024, 0.307)),
    "fast_walk": ((3.95, 10.4), (458.0, 726.0), (12.5, 62.5), (0.0, 0.155), (0.101, 2.17)),
}
"""10th and 90th percentiles of ``FIGURES`` in real recordings, see the test that renews them."""


def integrate(walk: Walk, scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Return the strapdown path (n, 3) from the true first pose, and the true path."""
    boot = simulate_boot_imu(scenario, "r1", seed=5)
    step_s = float(boot.time_s[1] - boot.time_s[0])
    true_m, angles_rad = walk.foot.pose(boot.time_s)
    around_m, _ = walk.foot.pose(boot.time_s[0] + step_s * np.array([-1.0, 1.0]))
    position_m, speed_m_s = true_m[0].copy(), (around_m[1] - around_m[0]) / (2.0 * step_s)
    yaw = from_rotation_vector((0.0, 0.0, angles_rad[0, 2]))
    pitch = from_rotation_vector((0.0, angles_rad[0, 1], 0.0))
    attitude = multiply(yaw, multiply(pitch, from_rotation_vector((angles_rad[0, 0], 0.0, 0.0))))
    turns = 0.25 * step_s * (boot.rate_rad_s[1:] + boot.rate_rad_s[:-1])
    forces = 0.5 * (boot.force_m_s2[1:] + boot.force_m_s2[:-1])
    gravity_m_s2 = np.array([0.0, 0.0, GRAVITY_M_S2])
    path_m = [position_m]
    for half_turn, force in zip(turns.tolist(), forces.tolist(), strict=True):
        half = from_rotation_vector(half_turn)
        middle = multiply(attitude, half)
        attitude = multiply(middle, half)
        acceleration = np.array(rotate(middle, force)) + gravity_m_s2
        position_m = position_m + step_s * (speed_m_s + 0.5 * step_s * acceleration)
        speed_m_s = speed_m_s + step_s * acceleration
        path_m.append(position_m)
    return np.array(path_m), true_m


@pytest.mark.parametrize("gait", ALL_GAITS)
def test_an_error_free_run_closes_to_millimetres(gait: Gait) -> None:
    scenario = gait_walk(gait, 3.0, PERFECT)
    walk = simulate_walk(scenario, "r1", seed=5)
    path_m, true_m = integrate(walk, scenario)
    assert np.abs(path_m - true_m).max() < 5e-3
    assert np.linalg.norm(true_m[-1] - true_m[0]) > 2.5


def test_a_perfect_sensor_at_rest_reads_gravity_upwards_and_the_earths_field() -> None:
    scenario = msgspec.structs.replace(
        gait_walk("walk", 3.0, ImuSettings().without_errors()),
        magnetic=MagneticSettings(disturbance_ut=0.0),
    )
    boot = simulate_boot_imu(scenario, "r1", seed=0)
    rest = slice(0, 250)
    assert boot.force_m_s2[rest].mean(axis=0) == pytest.approx([0, 0, -GRAVITY_M_S2], abs=0.02)
    assert np.degrees(boot.rate_rad_s[rest].mean(axis=0)) == pytest.approx([0, 0, 0], abs=0.2)
    assert boot.field_ut[rest].mean(axis=0) == pytest.approx([25.0, 0.0, 43.3], abs=0.2)
    assert boot.time_s[1] - boot.time_s[0] == pytest.approx(0.01)


def heading_offset_deg(scenario: Scenario, responder_id: str, seed: int) -> float:
    """How far off the heading is that the magnetometer gives before setting out."""
    boot = simulate_boot_imu(scenario, responder_id, seed)
    _, angles_rad = simulate_walk(scenario, responder_id, seed).foot.pose(boot.time_s)
    level = nav_from_body(angles_rad * np.array([1.0, 1.0, 0.0]))
    north, east, _ = np.einsum("nij,nj->i", level, boot.field_ut)
    off_rad = wrap_rad(math.atan2(-east, north) - angles_rad[0, 2])
    return math.degrees(off_rad)


def test_magnetic_heading_is_off_by_several_degrees_differently_for_each() -> None:
    scenario = load_scenario("four_daps")
    standing = {
        name: msgspec.structs.replace(responder, route=(Stand(3.0),))
        for name, responder in scenario.responders.items()
    }
    scenario = msgspec.structs.replace(scenario, responders=standing, daps={})
    offsets = np.array(
        [heading_offset_deg(scenario, name, seed) for name in standing for seed in range(12)]
    )
    assert 5.0 < np.sqrt(np.mean(offsets**2)) < 15.0
    assert len(set(offsets.round(3))) == len(offsets)


@pytest.mark.parametrize("gait", ["walk", "fast_walk"])
def test_a_simulated_boot_looks_like_a_real_one(gait: Gait) -> None:
    figures = simulated_figures(gait_walk(gait, 30.0), range(6))[gait]
    medians = np.median(figures, axis=0)
    for name, median, (low, high) in zip(FIGURES, medians, RECORDED[gait], strict=True):
        assert low <= median <= high, f"{name}: {median:.3g} is not within {low} to {high}"


def test_the_figures_of_real_boots_are_those_of_the_recordings(data_dir: Path) -> None:
    for gait, figures in recorded_figures(data_dir / "foot_strides").items():
        spread = np.percentile(figures, (10.0, 90.0), axis=0).T
        assert spread == pytest.approx(np.array(RECORDED[gait]), rel=0.02, abs=1e-3)


def test_a_boot_in_stance_rolls_and_is_never_dead_still() -> None:
    walk = simulate_walk(gait_walk("walk", 30.0), "r1", seed=2)
    step_s = 1e-3
    moments = walk.stance_time_s[2:-2, None] + step_s * np.array([-1.0, 1.0])
    position_m, angles_rad = walk.foot.pose(moments.ravel())
    speeds_m_s = np.linalg.norm(position_m[1::2] - position_m[::2], axis=1) / (2.0 * step_s)
    pitch_rates = (angles_rad[1::2, 1] - angles_rad[::2, 1]) / (2.0 * step_s)
    # Motion capture of walking boots: 1 to 14 cm/s, always on towards the toe.
    assert 0.01 < np.median(speeds_m_s) < 0.06
    assert np.mean(pitch_rates < 0.0) > 0.9


def test_errors_are_drawn_per_sensor_and_clip_at_the_range() -> None:
    narrow = ImuSettings(force_range_g=2.0, rate_range_deg_s=250.0)
    boot = simulate_boot_imu(gait_walk("walk", 6.0, narrow), "r1", seed=0)
    assert np.abs(boot.force_m_s2).max() == pytest.approx(2.0 * 9.80665)
    assert np.degrees(np.abs(boot.rate_rad_s).max()) == pytest.approx(250.0)
    rates_hz = [
        1.0 / np.diff(simulate_boot_imu(gait_walk("walk", 2.0), "r1", seed).time_s[:2]).item()
        for seed in range(4)
    ]
    assert len(set(rates_hz)) == 4
    assert rates_hz == pytest.approx([100.0] * 4, rel=0.01)
    assert 100.0 not in rates_hz


def test_ringing_moves_the_sensor_nowhere() -> None:
    chance = np.random.default_rng(0)
    step_s = 5e-4
    force = ringing(np.array([0.1, 0.3]), np.array([30.0, 10.0]), 0.0, step_s, 2000, chance)
    speed = np.cumsum(force, axis=0) * step_s
    assert np.abs(force).max() > 5.0
    assert np.abs(speed[-1]).max() < 1e-9
    assert np.abs(np.cumsum(speed, axis=0)[-1] * step_s).max() < 1e-9


def test_samples_carry_the_recording_on_the_exercises_clock() -> None:
    boot = simulate_boot_imu(gait_walk("walk", 2.0), "r1", seed=0)
    samples = list(boot.samples(start_ns=10**18))
    assert len(samples) == len(boot.time_s)
    last = samples[-1]
    assert last.time_ns - 10**18 == pytest.approx(boot.time_s[-1] * 1e9, abs=1.0)
    assert last.force_m_s2 == tuple(boot.force_m_s2[-1])
    assert last.rate_rad_s == tuple(boot.rate_rad_s[-1])
    assert last.field_ut == tuple(boot.field_ut[-1])
    assert all(type(value) is float for value in last.force_m_s2)
