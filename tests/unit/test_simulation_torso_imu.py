"""The simulated sensor on a trunk: it moves as people's trunks do, and is worn as it is said."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec.structs import replace

from shared.maths.rotations import from_rotation_vector, rotate
from shared.simulation.chance import generator
from shared.simulation.gait_figures import Array
from shared.simulation.imu_errors import ImuSettings
from shared.simulation.inertial_reading import GRAVITY_M_S2
from shared.simulation.legs import Gait, Move, Stand
from shared.simulation.torso_imu import Slip, Worn, simulate_torso_imu
from shared.simulation.torso_path import TorsoPlace, torso_path
from shared.simulation.walker import simulate_walk
from tests.simulated_walks import gait_walk, lone_walk

PERFECT = ImuSettings(rate_hz=200.0).without_errors()
WALK = lone_walk(Stand(3.0), Move("walk", ((12.0, 0.0),)), imu=PERFECT)
STANDING_UNTIL_S = 5.0


@pytest.mark.parametrize("place", ["belt", "chest"])
def test_a_trunk_rises_in_each_step_and_goes_aside_in_each_stride(place: TorsoPlace) -> None:
    walk = simulate_walk(WALK, "r1", 1)
    path = torso_path(walk, place, generator(1, "torso"))
    from_s, until_s = walk.stance_time_s[[3, 6]].tolist()
    inside_s = np.linspace(from_s, until_s, 900)
    position_m, angles_rad = path.pose(inside_s)
    assert 0.02 < np.ptp(position_m[:, 2]) < 0.07
    assert 0.02 < np.ptp(position_m[:, 1]) < 0.11
    down_m = position_m[:, 2] - position_m[:, 2].mean()
    assert np.count_nonzero(np.diff(np.sign(down_m)) > 0) == 6  # three strides, two steps each
    assert np.all(np.ptp(angles_rad, axis=0) < math.radians(25.0))
    body_m, _ = walk.body.at(inside_s)
    assert np.abs(position_m[:, 0] - body_m[:, 0]).max() < 0.2


def test_a_standing_trunk_is_quiet_but_not_dead() -> None:
    read = simulate_torso_imu(WALK, "r1", 1, Worn("belt"))
    still = read.force_m_s2[read.time_s < STANDING_UNTIL_S]
    assert np.linalg.norm(still.mean(axis=0)) == pytest.approx(GRAVITY_M_S2, abs=0.02)
    assert still[:, 2].mean() == pytest.approx(-GRAVITY_M_S2, abs=0.1)
    assert np.all((still.std(axis=0) > 0.002) & (still.std(axis=0) < 0.15))


def test_who_sets_out_bounces_less_than_on_the_way() -> None:
    read, walk = simulate_torso_imu(WALK, "r1", 1, Worn("belt")), simulate_walk(WALK, "r1", 1)
    size_m_s2 = np.linalg.norm(read.force_m_s2, axis=1)
    smooth_m_s2 = np.convolve(size_m_s2, np.hanning(61) / np.hanning(61).sum(), "same")
    spreads = [
        smooth_m_s2[(read.time_s >= left_s) & (read.time_s < reached_s)].std()
        for left_s, reached_s in zip(walk.left_s[:6], walk.reached_s[1:7], strict=True)
    ]
    assert 0.3 * np.mean(spreads[2:]) < spreads[0] < 0.75 * np.mean(spreads[2:])


def test_a_phone_is_another_sensor_than_what_is_worn_on_the_belt() -> None:
    phone = ImuSettings(rate_bias_deg_s=50.0)
    scenario = replace(lone_walk(Stand(3.0), imu=PERFECT), phone=phone)
    mean_rad_s = {
        place: np.abs(simulate_torso_imu(scenario, "r1", 1, Worn(place)).rate_rad_s.mean(axis=0))
        for place in ("belt", "chest")
    }
    assert mean_rad_s["belt"].max() < math.radians(1.0)
    assert mean_rad_s["chest"].max() > math.radians(5.0)


def test_the_way_a_sensor_is_put_on_turns_what_it_reads() -> None:
    turn = from_rotation_vector((0.4, -1.1, 2.0))
    straight = simulate_torso_imu(WALK, "r1", 1, Worn("belt"))
    turned = simulate_torso_imu(WALK, "r1", 1, Worn("belt", sensor_from_trunk=turn))
    for told, true in (
        (turned.force_m_s2, straight.force_m_s2),
        (turned.rate_rad_s, straight.rate_rad_s),
        (turned.field_ut, straight.field_ut),
    ):
        expected = np.array([rotate(turn, tuple(each)) for each in true.tolist()])
        np.testing.assert_allclose(told, expected, atol=1e-9)


def test_a_slipping_sensor_turns_by_what_its_gyroscope_reads() -> None:
    slip = Slip(3.0, (0.0, 0.9, 0.0))
    straight = simulate_torso_imu(WALK, "r1", 1, Worn("belt"))
    slipped = simulate_torso_imu(WALK, "r1", 1, Worn("belt", slips=(slip,)))
    extra: Array = slipped.rate_rad_s[:, 1] - straight.rate_rad_s[:, 1]
    period_s = float(slipped.time_s[1] - slipped.time_s[0])
    turning = slipped.time_s < STANDING_UNTIL_S
    assert extra[turning].sum() * period_s == pytest.approx(0.9, abs=1e-3)
    # Nose up by that much: what was up the trunk is now also ahead of the sensor.
    after = (slipped.time_s > 3.5) & turning
    ahead, _, down = slipped.force_m_s2[after].mean(axis=0)
    lean = math.atan2(straight.force_m_s2[after, 0].mean(), GRAVITY_M_S2)
    assert math.atan2(ahead, -down) == pytest.approx(0.9 + lean, abs=0.02)


def test_the_same_seed_gives_the_same_readings_and_another_gives_others() -> None:
    first = simulate_torso_imu(WALK, "r1", 1, Worn("chest"))
    again = simulate_torso_imu(WALK, "r1", 1, Worn("chest"))
    other = simulate_torso_imu(WALK, "r1", 2, Worn("chest"))
    np.testing.assert_array_equal(first.force_m_s2, again.force_m_s2)
    assert len(other.time_s) != len(first.time_s) or np.any(other.force_m_s2 != first.force_m_s2)


@pytest.mark.parametrize("gait", ["crawl", "stairs_up", "lift"])
def test_every_gait_gives_finite_readings(gait: Gait) -> None:
    read = simulate_torso_imu(gait_walk(gait, 6.0), "r1", 3, Worn("belt"))
    assert np.isfinite(read.force_m_s2).all()
    assert np.abs(read.force_m_s2).max() < 80.0
