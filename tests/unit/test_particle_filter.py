"""Clouds: spread as told, moved as the paper says, weighted and summed up right."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from command_post.fusion.motion_model import MotionModel, propagate
from command_post.fusion.particle_filter import (
    Particles,
    effective_count,
    moments,
    predict,
    resample,
    spread,
    update,
)
from command_post.fusion.proximity_model import ProximityModel
from shared.messages import LocalPosition
from tests.stride_world import stride

STILL = MotionModel(
    position_sd_m=0.0, position_sd_per_m=0.0, lost_sd_m=0.0, offset_sd_rad=0.0, drift_sd_rad=0.0
)


def generator(seed: int = 1) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(seed))


def place(nn: float = 1.0, ne: float = 0.0, ee: float = 1.0) -> LocalPosition:
    return LocalPosition(north_m=10.0, east_m=-5.0, down_m=0.0, covariance_m2=(nn, ne, ee))


def cloud(*states: tuple[float, float, float, float]) -> Particles:
    return Particles(np.array(states).T, np.full(len(states), -math.log(len(states))))


def test_start_is_spread_as_its_covariance_says() -> None:
    start = spread(place(4.0, 1.5, 2.0), 0.3, 0.01, 200_000, generator())
    summed = moments(start)
    assert (summed.north_m, summed.east_m) == pytest.approx((10.0, -5.0), abs=0.03)
    assert summed.covariance_m2 == pytest.approx((4.0, 1.5, 2.0), rel=0.03)
    assert summed.heading_sd_rad == pytest.approx(math.hypot(0.3, 0.01), rel=0.02)


@given(*[st.floats(-1e12, 1e12)] * 3)
def test_any_told_covariance_gives_a_finite_start(nn: float, ne: float, ee: float) -> None:
    start = spread(place(nn, ne, ee), 1.0, 0.0, 20, generator())
    assert np.isfinite(start.state).all()
    assert np.isfinite(moments(start).covariance_m2).all()


@pytest.mark.parametrize(
    ("offset_rad", "drift_rad", "expected"),
    [
        (0.0, 0.0, (2.0, 1.0)),
        (math.pi / 2.0, 0.0, (-1.0, 2.0)),
        (math.pi / 3.0, math.pi / 6.0, (-1.0, 2.0)),
        (math.pi, 0.0, (-2.0, -1.0)),
    ],
)
def test_increment_is_turned_by_offset_and_drift(
    offset_rad: float, drift_rad: float, expected: tuple[float, float]
) -> None:
    state = np.array([[0.0, 0.0, offset_rad, drift_rad]]).T
    moved = propagate(state, stride(1.0, 2.0, 1.0), 0, STILL, generator())
    assert moved[:2, 0] == pytest.approx(expected)
    assert moved[2:, 0].tolist() == [offset_rad, drift_rad]


@given(*[st.floats(-100.0, 100.0)] * 2, *[st.floats(-1e4, 1e4)] * 2)
def test_turning_keeps_the_length(
    d_north_m: float, d_east_m: float, offset_rad: float, drift_rad: float
) -> None:
    state = np.array([[0.0, 0.0, offset_rad, drift_rad]]).T
    moved = propagate(state, stride(1.0, d_north_m, d_east_m), 0, STILL, generator())
    assert math.hypot(*moved[:2, 0]) == pytest.approx(math.hypot(d_north_m, d_east_m), abs=1e-9)


@given(
    arrays(np.float64, (4, 12), elements=st.floats(-1e3, 1e3)),
    arrays(np.float64, 12, elements=st.floats(-600.0, 0.0)),
)
def test_covariances_are_positive(state: NDArray[np.float64], log: NDArray[np.float64]) -> None:
    weighted = update(Particles(state, np.full(12, -math.log(12.0))), log)
    assert weighted is not None
    nn, ne, ee = moments(weighted).covariance_m2
    assert nn >= 0.0
    assert ee >= 0.0
    assert nn * ee - ne**2 >= -1e-9 * (1.0 + nn * ee)


def test_process_noise_is_on_all_four() -> None:
    model = MotionModel(
        position_sd_m=0.1, position_sd_per_m=0.05, offset_sd_rad=0.02, drift_sd_rad=0.03
    )
    state = np.zeros((4, 100_000))
    moved = propagate(state, stride(1.0, 2.0, 0.0), 0, model, generator())
    assert moved.std(axis=1) == pytest.approx([0.2, 0.2, 0.02, 0.03], rel=0.02)


def test_lost_increments_widen_the_cloud() -> None:
    model = MotionModel(position_sd_m=0.0, position_sd_per_m=0.0, lost_sd_m=1.0)
    moved = propagate(np.zeros((4, 50_000)), stride(1.0, 0.0, 0.0), 3, model, generator())
    assert moved[:2].std(axis=1) == pytest.approx([3.0, 3.0], rel=0.02)


def test_clouds_are_never_written_to() -> None:
    start = spread(place(), 0.1, 0.0, 100, generator())
    weighted = update(start, -np.arange(100.0))
    assert weighted is not None
    for each in (start, weighted, resample(weighted, "systematic", generator())):
        for array in each:
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0.0


def test_weights_are_bayes_rule() -> None:
    prior = Particles(np.zeros((4, 3)), np.log([0.5, 0.3, 0.2]))
    weighted = update(prior, np.log([0.1, 0.4, 0.2]))
    assert weighted is not None
    joint = np.array([0.05, 0.12, 0.04])
    np.testing.assert_allclose(np.exp(weighted.log_weights), joint / joint.sum())


def test_tiny_likelihoods_still_tell_particles_apart() -> None:
    weighted = update(cloud((0, 0, 0, 0), (1, 0, 0, 0)), np.array([-690.0, -600.0]))
    assert weighted is not None
    assert np.exp(weighted.log_weights)[1] == pytest.approx(1.0)


@pytest.mark.parametrize("bad", [[-800.0, -900.0], [-math.inf, -math.inf], [math.nan, math.nan]])
def test_vanished_weights_are_told(bad: list[float]) -> None:
    assert update(cloud((0, 0, 0, 0), (1, 0, 0, 0)), np.array(bad)) is None


def test_effective_count_spans_one_to_all() -> None:
    one = Particles(np.zeros((4, 4)), np.log([1.0 - 3e-12, 1e-12, 1e-12, 1e-12]))
    assert effective_count(one) == pytest.approx(1.0)
    assert effective_count(cloud(*[(0.0, 0.0, 0.0, 0.0)] * 4)) == pytest.approx(4.0)


def test_headings_are_averaged_on_the_circle() -> None:
    summed = moments(cloud((0, 0, math.pi - 0.1, 0), (0, 0, -math.pi + 0.3, 0)))
    assert summed.heading_error_rad == pytest.approx(-math.pi + 0.1)
    assert summed.heading_sd_rad == pytest.approx(0.2, rel=0.02)


def test_opposite_headings_give_a_finite_deviation() -> None:
    assert math.isfinite(moments(cloud((0, 0, 0, 0), (0, 0, math.pi, 0))).heading_sd_rad)


def test_nearness_falls_off_with_range_only() -> None:
    model = ProximityModel(sd_m=2.0)
    likelihood = model.log_likelihood(
        np.array([3.0, 5.0, 3.0]), np.array([4.0, 4.0, 7.0]), 3.0, 4.0
    )
    np.testing.assert_allclose(likelihood, [0.0, -0.5, -1.125])


def test_same_generator_same_bits() -> None:
    def run() -> Particles:
        numbers = generator(7)
        particles = spread(place(), 0.3, 0.01, 500, numbers)
        for k in range(20):
            particles = predict(particles, stride(k, 1.2, 0.1), 0, MotionModel(), numbers)
        return resample(particles, "systematic", numbers)

    assert run().state.tobytes() == run().state.tobytes()
