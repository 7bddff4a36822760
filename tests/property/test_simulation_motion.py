"""What holds of every simulated walk, whatever the seed and the route."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shared.simulation.boot_imu import simulate_boot_imu
from shared.simulation.chance import generator
from shared.simulation.imu_errors import ImuSettings
from shared.simulation.inertial_reading import inertial_truth, nav_from_body
from shared.simulation.legs import Gait, LevelGait, Move
from shared.simulation.magnetic import MagneticField, MagneticSettings
from shared.simulation.sole import Sole
from shared.simulation.walker import simulate_walk
from tests.simulated_walks import ALL_GAITS, LEVEL_GAITS, gait_walk, lone_walk

seeds = st.integers(0, 2**32)
words = st.text(min_size=1, max_size=8)


@settings(max_examples=20)
@given(seed=seeds, gait=st.sampled_from(ALL_GAITS))
def test_the_pose_is_twice_continuously_differentiable(seed: int, gait: Gait) -> None:
    foot = simulate_walk(gait_walk(gait, 4.0), "r1", seed).foot
    start_s, end_s = foot.start_s[0], foot.start_s[-1] + foot.duration_s[-1]

    def jumps(step_s: float) -> np.ndarray:
        time_s = np.arange(start_s - 0.1, end_s + 0.1, step_s)
        pose = np.column_stack(foot.pose(time_s))
        second = np.diff(pose, 2, axis=0) / step_s**2
        return np.asarray(np.abs(np.diff(second, axis=0)).max(axis=0))

    # Of a continuous second derivative, ten times finer steps make jumps near ten times smaller.
    assert np.all(jumps(1e-4) < 0.2 * jumps(1e-3) + 0.1)


@settings(max_examples=50)
@given(angles=st.lists(st.floats(-7.0, 7.0), min_size=3, max_size=3))
def test_rotations_are_orthonormal_and_proper(angles: list[float]) -> None:
    rotation = nav_from_body(np.array([angles]))[0]
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


@settings(max_examples=20)
@given(seed=seeds, gait=st.sampled_from(ALL_GAITS))
def test_the_rate_turns_the_attitude_as_the_pose_says(seed: int, gait: Gait) -> None:
    foot = simulate_walk(gait_walk(gait, 3.0), "r1", seed).foot
    step_s, first_s = 1e-4, float(foot.start_s[1])
    _, rate = inertial_truth(foot, first_s, step_s, 3000)
    _, angles_rad = foot.pose(first_s + step_s * np.arange(3000.0))
    turned = nav_from_body(angles_rad)
    change = np.einsum("nji,njk->nik", turned[1:-1], turned[2:] - turned[:-2]) / (2.0 * step_s)
    seen = np.column_stack([change[:, 2, 1], change[:, 0, 2], change[:, 1, 0]])
    assert seen == pytest.approx(rate[1:-1], abs=2e-3)


@settings(max_examples=30)
@given(seed=seeds, gait=st.sampled_from(LEVEL_GAITS), length_m=st.floats(1.0, 30.0))
def test_strides_add_up_to_the_route(seed: int, gait: LevelGait, length_m: float) -> None:
    walk = simulate_walk(gait_walk(gait, length_m), "r1", seed)
    assert walk.body.position_m[-1] == pytest.approx([length_m, 0.0, 0.0])
    going = walk.stride_m[1:] if gait == "crawl" else walk.stride_m  # The first kneels down.
    # Feet are set down a little beside the line, so strides add up to a little more.
    assert -0.06 < going.sum() - length_m < 0.06 + 0.002 * len(going)
    assert len(walk.gaits) == len(walk.stride_m) == len(walk.stance_time_s) - 1
    assert np.all(np.diff(walk.stance_time_s) > 0.0)


@settings(max_examples=30)
@given(
    seed=seeds,
    points=st.lists(
        st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0)), min_size=1, max_size=5
    ),
)
def test_any_route_is_walked_to_its_end_without_leaps(
    seed: int, points: list[tuple[float, float]]
) -> None:
    scenario = lone_walk(Move("walk", tuple(points)))
    walk = simulate_walk(scenario, "r1", seed)
    assert walk.body.position_m[-1, :2] == pytest.approx(points[-1], abs=2e-3)
    assert walk.stride_m.size == 0 or walk.stride_m.max() < 2.5
    speed_m_s = np.linalg.norm(np.diff(walk.body.position_m, axis=0), axis=1) * 20.0
    assert speed_m_s.size == 0 or speed_m_s.max() < 4.0


@settings(max_examples=5)
@given(seed=seeds)
def test_the_same_seed_gives_the_same_bits_and_another_does_not(seed: int) -> None:
    scenario = gait_walk("walk", 3.0)
    once, again = (simulate_boot_imu(scenario, "r1", seed) for _ in range(2))
    other = simulate_boot_imu(scenario, "r1", seed + 1)
    for name in ("time_s", "force_m_s2", "rate_rad_s", "field_ut"):
        assert getattr(once, name).tobytes() == getattr(again, name).tobytes()
        assert getattr(once, name).tobytes() != getattr(other, name).tobytes()


@given(seed=seeds, purpose=st.lists(words, max_size=3), other=st.lists(words, max_size=3))
def test_every_purpose_has_a_stream_of_its_own(
    seed: int, purpose: list[str], other: list[str]
) -> None:
    numbers = generator(seed, *purpose).random(4)
    assert numbers.tolist() == generator(seed, *purpose).random(4).tolist()
    if purpose != other:
        assert numbers.tolist() != generator(seed, *other).random(4).tolist()


@settings(max_examples=25)
@given(height_m=st.floats(0.04, 0.12), heel_m=st.floats(0.05, 0.2), ball_m=st.floats(0.05, 0.2))
def test_a_sole_rolls_without_slip(height_m: float, heel_m: float, ball_m: float) -> None:
    rolling = Sole(height_m, heel_m, ball_m).rolling()
    pitch_rad = np.radians(np.linspace(-95.0, 45.0, 561))
    _, height_m, free_m = rolling(pitch_rad).T
    advance_m, climb_m, _ = rolling(pitch_rad, 1).T
    # Without slip the sensor's velocity is ω × (sensor − contact), and level with the contact it
    # can only go forward by its height.
    assert advance_m == pytest.approx(-height_m, abs=1e-6)
    assert rolling(0.0)[0] == pytest.approx(0.0, abs=1e-9)
    contact_ahead_m = -climb_m
    near_flat = np.abs(pitch_rad) < 0.08
    assert np.all(np.diff(contact_ahead_m[near_flat]) < 0.0)
    assert np.all(free_m >= height_m - 1e-9)


@settings(max_examples=20)
@given(seed=seeds)
def test_the_field_is_smooth_and_the_earths_on_average(seed: int) -> None:
    field = MagneticField(MagneticSettings(), generator(seed, "magnetic"))
    chance = np.random.default_rng(seed)
    places_m = chance.uniform(-500.0, 500.0, (4000, 3))
    assert field.at(places_m).mean(axis=0) == pytest.approx([25.0, 0.0, 43.3], abs=0.6)
    moved = field.at(places_m + np.array([0.01, 0.0, 0.0])) - field.at(places_m)
    assert np.abs(moved).max() < 0.2


def test_errors_off_are_all_off() -> None:
    perfect = ImuSettings().without_errors()
    spreads = {name: getattr(perfect, name) for name in perfect.__struct_fields__}
    kept = {"rate_hz", "force_range_g", "rate_range_deg_s"}
    assert all(value == 0.0 for name, value in spreads.items() if name not in kept)
