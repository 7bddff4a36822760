"""An even rate out of any: what lies between samples is where the signal was."""

from __future__ import annotations

import math

import numpy as np
import pytest

from edge_agent.inertial.even_samples import EvenSample, EvenSamples
from shared.messages import ImuSample


def wave(time_s: float) -> float:
    """A step's bounce and what comes twice as often."""
    return math.sin(2.0 * math.pi * 2.0 * time_s) + 0.3 * math.sin(2.0 * math.pi * 4.0 * time_s)


def even(times_s: list[float]) -> list[EvenSample]:
    brought = EvenSamples()
    return [
        one
        for t in times_s
        for one in brought.step(
            ImuSample(round(t * 1e9), (wave(t), 0.0, 9.81), (0.0, wave(t), 0.0))
        )
    ]


@pytest.mark.parametrize("rate_hz", [25.0, 50.0, 137.0, 200.0])
def test_a_bounce_is_as_high_at_any_rate(rate_hz: float) -> None:
    made = even([k / rate_hz for k in range(round(4.0 * rate_hz))])
    np.testing.assert_array_equal(np.diff([one.time_ns for one in made]), 10_000_000)
    assert 4.0 - 2.0 / rate_hz - 0.01 <= made[-1].time_ns / 1e9 < 4.0
    true = np.array([wave(one.time_ns / 1e9) for one in made])
    told = np.array([one.force_m_s2[0] for one in made])
    assert told.std() == pytest.approx(true.std(), rel=0.01)
    np.testing.assert_allclose([one.rate_rad_s[1] for one in made], told)
    np.testing.assert_allclose([one.force_m_s2[2] for one in made], 9.81)


def test_stamps_that_jitter_throw_no_curve_beyond_its_neighbours() -> None:
    chance = np.random.default_rng(4)
    times_s = np.sort(np.arange(0.0, 4.0, 0.01) + chance.normal(0.0, 0.005, 400)).tolist()
    assert max(abs(one.force_m_s2[0]) for one in even(times_s)) < 1.4


def test_a_gap_is_bridged_by_a_straight_line() -> None:
    made = even([0.0, 0.01, 0.02, 0.52, 0.53, 0.54])
    inside = np.array([one.force_m_s2[0] for one in made if 0.02 <= one.time_ns / 1e9 <= 0.52])
    np.testing.assert_allclose(inside, np.linspace(wave(0.02), wave(0.52), len(inside)))
