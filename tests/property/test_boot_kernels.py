"""Every kernel against its dense, plain-numpy meaning."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from edge_agent.inertial.eskf_parameters import EskfParameters, kernel_parameters
from edge_agent.inertial.foot_mechanisation import (
    level_quaternion,
    rotation_matrix,
    turn_about_down,
    turn_body,
    turn_nav,
)
from edge_agent.inertial.gap_bridging import bridge_gap
from edge_agent.inertial.sample_ring import DOUBT, FORCE, RATE, RESTORED, SAMPLE_WIDTH, STEP
from edge_agent.inertial.saturation import watch_flat_tops
from edge_agent.inertial.stride_smoothing import (
    COVARIANCE_ROWS,
    FILTERED,
    HISTORY_WIDTH,
    UPDATE_COUNT,
    UPDATE_WIDTH,
    UPDATES,
    smooth_stride,
)
from edge_agent.inertial.zero_velocity import shoe_reference, shoe_statistic
from edge_agent.inertial.zupt_filter import (
    STATES,
    propagate_covariance,
    scalar_update,
    transition_matrix,
    velocity_innovation,
    widen_covariance,
)

Array = NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)
vectors = arrays(np.float64, 3, elements=st.floats(-3.0, 3.0))


def random_covariance(rng: np.random.Generator) -> Array:
    root = rng.standard_normal((STATES, STATES)) * rng.uniform(0.01, 2.0, STATES)[:, None]
    return root @ root.T + 1e-6 * np.eye(STATES)


def random_quaternion(rng: np.random.Generator) -> Array:
    q = rng.standard_normal(4)
    return q / np.linalg.norm(q)


def matrix_of(q: Array) -> Array:
    r = np.empty((3, 3))
    rotation_matrix(q, r)
    return r


def transition_row(dt: float, force_nav: Array, r: Array) -> Array:
    return np.concatenate(([dt], dt * force_nav, (-dt * r).ravel()))


@given(seeds)
def test_propagation_is_f_p_ft(seed: int) -> None:
    rng = np.random.default_rng(seed)
    covariance, r = random_covariance(rng), matrix_of(random_quaternion(rng))
    dt, force = rng.uniform(1e-3, 1e-2), rng.uniform(-100, 100, 3)
    f = transition_matrix(dt, force, r)
    expected = f @ covariance @ f.T
    propagate_covariance(covariance, transition_row(dt, force, r))
    np.testing.assert_allclose(covariance, expected, rtol=1e-10, atol=1e-10)
    np.testing.assert_array_equal(covariance, covariance.T)


@given(seeds, st.sampled_from([3, 4, 5, 12, 13, 14]))
def test_scalar_update_is_joseph(seed: int, state: int) -> None:
    rng = np.random.default_rng(seed)
    covariance = random_covariance(rng)
    h = np.zeros(STATES)
    factor = rng.uniform(-1, 1) if state < 6 else 0.0
    h[state], h[15] = 1.0, factor
    variance, residual = rng.uniform(1e-4, 1.0), rng.normal()
    before = rng.standard_normal(STATES)
    gain = covariance @ h / (h @ covariance @ h + variance)
    left = np.eye(STATES) - np.outer(gain, h)
    expected = left @ covariance @ left.T + variance * np.outer(gain, gain)
    innovation = residual - h @ before
    written, correction = np.empty(STATES), before.copy()
    weight = scalar_update(covariance, written, correction, state, factor, variance, residual)
    np.testing.assert_allclose(covariance, expected, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(written, gain, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(correction, before + gain * innovation, rtol=1e-9, atol=1e-10)
    assert np.all(np.linalg.eigvalsh(covariance) > -1e-9)
    assert math.isfinite(weight)


@given(seeds)
def test_velocity_innovation_is_mahalanobis(seed: int) -> None:
    rng = np.random.default_rng(seed)
    covariance, residual = random_covariance(rng), rng.standard_normal(3)
    expected = residual @ np.linalg.solve(covariance[3:6, 3:6] + 0.01 * np.eye(3), residual)
    assert velocity_innovation(covariance, 0.01, residual) == pytest.approx(expected, rel=1e-6)


@given(seeds, st.floats(1.0, 1000.0))
def test_widening_keeps_a_covariance(seed: int, factor: float) -> None:
    covariance = random_covariance(np.random.default_rng(seed))
    smallest = np.linalg.eigvalsh(covariance)[0]
    widen_covariance(covariance, factor)
    assert np.linalg.eigvalsh(covariance)[0] >= smallest * (1 - 1e-6) - 1e-9


def filtered_history(rng: np.random.Generator, n: int) -> tuple[Array, list[dict[str, Array]]]:
    """A random linear walk of the filter: history for the kernel, dense steps for the reference."""
    history = np.zeros((64, HISTORY_WIDTH))
    covariance, x = random_covariance(rng) * 0.01, np.zeros(STATES)
    steps = []
    for k in range(n):
        row = history[k]
        r, dt = matrix_of(random_quaternion(rng)), 0.005
        force = rng.uniform(-30, 30, 3)
        row[:13] = transition_row(dt, force, r)
        f = transition_matrix(dt, force, r)
        x = f @ x
        propagate_covariance(covariance, row[:13])
        covariance[3:9, 3:9] += np.eye(6) * 1e-4
        step = {"f": f, "before": covariance.copy(), "x_before": x.copy()}
        if k % 3 == 0:
            correction, gain = np.zeros(STATES), np.empty(STATES)
            for u, state in enumerate((3, 4, 5)):
                factor = float(rng.uniform(-1, 1))
                residual = rng.normal() * 0.1 - x[state] - factor * x[15]
                weight = scalar_update(covariance, gain, correction, state, factor, 0.01, residual)
                at = UPDATES + UPDATE_WIDTH * u
                row[at : at + 3] = state, factor, weight
                row[at + 3 : at + UPDATE_WIDTH] = gain
            row[UPDATE_COUNT] = 3
            x = x + correction
        row[FILTERED : FILTERED + 3] = x[:3]
        for c, index in enumerate((0, 1, 2, 8)):
            at = COVARIANCE_ROWS + STATES * c
            row[at : at + STATES] = covariance[index]
        steps.append({**step, "after": covariance.copy(), "x": x.copy()})
    return history, steps


@settings(max_examples=25)
@given(seeds, st.integers(2, 40))
def test_smoothing_is_rauch_tung_striebel(seed: int, n: int) -> None:
    history, steps = filtered_history(np.random.default_rng(seed), n)
    path = np.zeros((64, 4))
    smooth_stride(history, path, 0, n - 1)
    smoothed = steps[-1]["x"]
    for k in range(n - 1, -1, -1):
        if k < n - 1:
            after = steps[k + 1]
            gain = np.linalg.solve(after["before"], after["f"] @ steps[k]["after"]).T
            smoothed = steps[k]["x"] + gain @ (smoothed - after["x_before"])
        np.testing.assert_allclose(path[k, :3], smoothed[:3], rtol=1e-5, atol=1e-6)
        correction = smoothed[8] - steps[k]["x"][8]
        np.testing.assert_allclose(path[k, 3], correction, rtol=1e-5, atol=1e-6)


@given(seeds, vectors)
def test_turns_compose_like_matrices(seed: int, turn: Array) -> None:
    q = random_quaternion(np.random.default_rng(seed))
    angle = float(np.linalg.norm(turn))
    x, y, z = turn
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sinc = math.sin(angle) / angle if angle > 1e-9 else 1.0
    versine = (1 - math.cos(angle)) / angle**2 if angle > 1e-4 else 0.5
    rodrigues = np.eye(3) + sinc * cross + versine * cross @ cross
    body, nav = q.copy(), q.copy()
    turn_body(body, *turn)
    turn_nav(nav, *turn)
    np.testing.assert_allclose(matrix_of(body), matrix_of(q) @ rodrigues, atol=1e-7)
    np.testing.assert_allclose(matrix_of(nav), rodrigues @ matrix_of(q), atol=1e-7)


@given(vectors.filter(lambda v: np.linalg.norm(v) > 0.2))
def test_levelling_points_force_upwards(direction: Array) -> None:
    force = 9.81 * direction / np.linalg.norm(direction)
    up = matrix_of(level_quaternion(force)) @ force
    np.testing.assert_allclose(up, [0.0, 0.0, -9.81], atol=2e-2)


def test_levelling_in_free_fall_is_refused() -> None:
    with pytest.raises(ValueError, match="is the accelerometer connected"):
        level_quaternion(np.array([0.0, 0.1, 0.0]))


@given(seeds, st.floats(-3.0, 3.0))
def test_heading_change_needs_no_forward_axis(seed: int, angle: float) -> None:
    start = random_quaternion(np.random.default_rng(seed))
    end = start.copy()
    turn_nav(end, 0.0, 0.0, angle)
    assert turn_about_down(start, end) == pytest.approx(angle, abs=1e-9)


@given(seeds, st.integers(3, 20))
def test_statistic_is_the_papers(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    ring = np.zeros((32, SAMPLE_WIDTH))
    ring[:, :6] = rng.standard_normal((32, 6)) * 5 + 3
    first = 25
    slots = [(first + i) % 32 for i in range(count)]
    expected = shoe_reference(ring[slots, :3], ring[slots, 3:6], 9.81, 9.03, 0.804)
    assert shoe_statistic(ring, first, count, 9.81, 9.03, 0.804) == pytest.approx(expected)


PARAMETERS = kernel_parameters(EskfParameters(), 200.0)[0]


@given(st.floats(6.0, 10.0), st.sampled_from([-1.0, 1.0]))
def test_a_clipped_swing_is_restored(peak: float, sign: float) -> None:
    limit = 5.24  # ±300 °/s
    true = sign * peak * np.exp(-(((np.arange(64) - 30.3) / 6.0) ** 2))
    ring = np.zeros((64, SAMPLE_WIDTH))
    ring[:, RATE + 1] = np.clip(true, -limit, limit)
    lost = np.abs(np.sum(true) - np.sum(ring[:, RATE + 1]))
    runs, fastest = np.full((3, 2), -1, dtype=np.int64), np.zeros(3)
    read = ring[:, RATE + 1].copy()
    for n in range(64):
        watch_flat_tops(ring, runs, fastest, n, PARAMETERS)
    assert np.abs(np.sum(true) - np.sum(ring[:, RATE + 1])) < 0.6 * lost
    assert np.all(np.abs(ring[:, RATE + 1]) >= np.abs(read))
    np.testing.assert_allclose(
        ring[:, RESTORED + 1], np.abs(ring[:, RATE + 1]) - np.abs(read), atol=1e-12
    )


@given(st.floats(0.3, 4.0))
def test_a_peak_within_range_is_left_alone(peak: float) -> None:
    ring = np.zeros((64, SAMPLE_WIDTH))
    ring[:, RATE] = peak * np.sin(np.arange(64) / 5)
    read = ring.copy()
    runs, fastest = np.full((3, 2), -1, dtype=np.int64), np.zeros(3)
    for n in range(64):
        watch_flat_tops(ring, runs, fastest, n, PARAMETERS)
    np.testing.assert_array_equal(ring, read)


@given(st.integers(150, 300), st.integers(5, 40), st.floats(0, 6.28))
def test_a_gap_in_a_periodic_signal_is_filled(period: int, length: int, phase: float) -> None:
    slots = np.arange(900)
    turn = 2 * np.pi * slots / period + phase
    ring = np.zeros((1024, SAMPLE_WIDTH))
    ring[:, STEP] = 0.005
    ring[:900, RATE + 1] = 5 * np.sin(turn) + 3 * np.sin(2 * turn)
    ring[:900, FORCE + 2] = -9.81 + 8 * np.cos(turn)
    true = ring.copy()
    first, last = 850, 850 + length - 1
    ring[first : last + 1, :6] = 0.0
    disagreement = bridge_gap(ring, first, last, 900, PARAMETERS)
    assert 0.0 <= disagreement < 0.05
    np.testing.assert_allclose(
        ring[first : last + 1, RATE + 1], true[first : last + 1, RATE + 1], atol=0.6
    )
    assert np.all(ring[first : last + 1, DOUBT] <= 0.3)


def test_a_gap_without_history_is_a_straight_line() -> None:
    ring = np.zeros((1024, SAMPLE_WIDTH))
    ring[:, STEP] = 0.005
    ring[:70, RATE + 1] = np.arange(70)
    ring[40:50, RATE + 1] = -1.0
    assert bridge_gap(ring, 40, 49, 70, PARAMETERS) == -1.0
    np.testing.assert_allclose(ring[40:50, RATE + 1], np.arange(40, 50))
    assert np.all(ring[40:50, DOUBT] == pytest.approx(0.5))
