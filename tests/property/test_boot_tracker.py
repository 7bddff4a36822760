"""The boot's tracker: any mounting measures alike, and the true rate is found."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from edge_agent.inertial.boot_state import STRIDE
from edge_agent.inertial.boot_tracker import BootTracker
from edge_agent.inertial.sample_clock import place, start_clock
from shared.messages import ImuSample
from tests.synthetic_boot import SyntheticWalk

SAMPLES = list(SyntheticWalk(strides=3).samples(100.0))
FORCE = np.array([sample.force_m_s2 for sample in SAMPLES])
RATE = np.array([sample.rate_rad_s for sample in SAMPLES])
seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=15)
@given(seeds)
def test_any_mounting_measures_alike(seed: int) -> None:
    orthogonal, triangle = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    body_from_sensor = orthogonal * np.sign(np.diag(triangle))
    body_from_sensor *= np.linalg.det(body_from_sensor)
    tracker = BootTracker()
    strides = []
    for sample, (fx, fy, fz), (wx, wy, wz) in zip(
        SAMPLES,
        (FORCE @ body_from_sensor).tolist(),
        (RATE @ body_from_sensor).tolist(),
        strict=True,
    ):
        strides += tracker.step(ImuSample(sample.time_ns, (fx, fy, fz), (wx, wy, wz)))
    moved_m = [np.linalg.norm(stride.displacement_m) for stride in strides if stride.kind == STRIDE]
    np.testing.assert_allclose(moved_m, [1.2] * 3, atol=0.02)
    for stride in strides:
        covariance = np.array(stride.covariance)
        np.testing.assert_allclose(covariance, covariance.T, atol=1e-15)
        assert np.linalg.eigvalsh(covariance)[0] > 0.0


@settings(max_examples=30)
@given(st.floats(100.0, 450.0), st.floats(0.0, 0.3), seeds)
def test_the_true_rate_is_found(rate_hz: float, jitter: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = round(20 * rate_hz)
    stamps_ns = 1e18 + (np.arange(n) + jitter * rng.uniform(-1, 1, n)) * 1e9 / rate_hz
    clock = start_clock(stamps_ns[: round(0.6 * rate_hz)].astype(np.int64).tolist())
    missing = 0
    for stamp_ns in stamps_ns[1:].astype(np.int64).tolist():
        arrival = place(clock, stamp_ns)
        clock, missing = arrival.state, missing + arrival.missing
    assert missing == 0
    assert 1e9 / clock.period_ns == pytest.approx(rate_hz, rel=2e-3)
