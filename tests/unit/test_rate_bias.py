"""The gyro's bias in the error-state filter: learnt at stops, for what each is worth."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from edge_agent.inertial.boot_filter import consider_bias_about_down
from edge_agent.inertial.boot_tracker import BootTracker
from edge_agent.inertial.zupt_filter import RATE_BIAS, STATES, scalar_update
from shared.messages import ImuSample
from shared.units import NS_PER_S

RATE_HZ = 100.0


def standing(
    duration_s: float, bias_deg_s: float, sway_deg_s: float, *, seed: int = 1
) -> list[ImuSample]:
    """A boot that stands, with a bias on each axis, and sways about down for a second and back."""
    rng = np.random.default_rng(seed)
    count = round(duration_s * RATE_HZ)
    time_s = np.arange(count) / RATE_HZ
    rate = bias_deg_s + rng.normal(0.0, 0.05, (count, 3))
    rate[:, 2] += sway_deg_s * np.sin(2.0 * np.pi * time_s)
    return [
        ImuSample(round(t * NS_PER_S), (0.0, 0.0, -9.81), (x, y, z))
        for t, (x, y, z) in zip(time_s.tolist(), np.radians(rate).tolist(), strict=True)
    ]


def learnt(samples: list[ImuSample]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The bias and its standard deviation after ``samples``, in degrees a second."""
    tracker = BootTracker()
    for sample in samples:
        tracker.step(sample)
    state = tracker._state[0]
    sd = np.sqrt(np.diag(state["covariance"])[RATE_BIAS : RATE_BIAS + 3])
    return np.degrees(state["rate_bias_rad_s"]), np.degrees(sd)


@pytest.mark.parametrize("bias_deg_s", [-0.4, 0.2, 1.5, 4.0])
def test_standing_still_for_seconds_tells_the_bias(bias_deg_s: float) -> None:
    bias, sd = learnt(standing(4.0, bias_deg_s, 0.0))
    np.testing.assert_allclose(bias, bias_deg_s, atol=0.05)
    assert np.all(sd < 0.04)


@pytest.mark.parametrize("seed", range(4))
def test_a_sway_is_no_bias(seed: int) -> None:
    """Half a second of a sway by 1 °/s is believed little, and known to be little worth."""
    bias, sd = learnt(standing(1.0, 0.0, 1.0, seed=seed))
    still_bias, still_sd = learnt(standing(1.0, 0.0, 0.0, seed=seed))
    assert abs(bias[2]) < 2.5 * sd[2]
    assert sd[2] > 2.0 * still_sd[2]
    assert abs(still_bias[2]) < 0.05


def test_a_foot_that_turns_at_the_start_leaves_the_bias_in_doubt() -> None:
    """A slow turn of a fifth of a second cannot be told from a bias: it is doubted, then undone."""
    turning, resting = standing(0.6, 3.0, 0.0), standing(2.6, 0.0, 0.0, seed=2)
    bias, _ = learnt(turning + resting[60:])
    assert abs(bias[2]) < 0.3


@pytest.mark.parametrize("seed", range(8))
def test_velocity_considers_the_bias_about_down(seed: int) -> None:
    """The covariance is Joseph's for the gain without it: valid, and known no better about down."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((STATES, STATES))
    before = root @ root.T
    down = rng.standard_normal(3)
    down /= np.linalg.norm(down)
    row = np.zeros(20)
    row[0] = 0.005
    row[10:13] = -row[0] * down
    after, gain, correction = before.copy(), np.empty(STATES), np.zeros(STATES)
    scalar_update(after, gain, correction, 4, 0.0, 0.3, 1.7)
    consider_bias_about_down(after, correction, before[12:15, 12:15].copy(), row)

    about_down = np.eye(STATES)
    about_down[12:15, 12:15] -= np.outer(down, down)
    kept = about_down @ gain
    h = np.eye(STATES)[4]
    joseph = np.eye(STATES) - np.outer(kept, h)
    np.testing.assert_allclose(
        after, joseph @ before @ joseph.T + 0.3 * np.outer(kept, kept), atol=1e-9
    )
    np.testing.assert_allclose(correction, 1.7 * kept, atol=1e-9)
    assert down @ correction[12:15] == pytest.approx(0.0, abs=1e-9)
    assert np.linalg.eigvalsh(after).min() > 0.0
