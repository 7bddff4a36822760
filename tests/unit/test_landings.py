"""Landings: one for each push upwards that is a step's, whatever the pace; none for shaking."""

from __future__ import annotations

import math

import numpy as np
import pytest

from edge_agent.inertial.butterworth import LowPass
from edge_agent.inertial.landings import Landing, LandingDetector
from edge_agent.inertial.pendulum_step import PendulumSteps, pendulum_m

RATE_HZ = 100.0


def landings(up_m_s2: np.ndarray) -> list[Landing]:
    detector = LandingDetector(RATE_HZ)
    told = [
        detector.step(round(index * 1e9 / RATE_HZ), value)
        for index, value in enumerate(up_m_s2.tolist())
    ]
    return [one for one in told if one is not None]


def pushes(count: int, cadence_hz: float, size_m_s2: float) -> np.ndarray:
    """Return two seconds of rest, ``count`` bounces and two seconds of rest."""
    length = round(count / cadence_hz * RATE_HZ)
    phase = np.arange(length) * 2.0 * math.pi * cadence_hz / RATE_HZ
    rest = np.zeros(round(2.0 * RATE_HZ))
    return np.concatenate((rest, -size_m_s2 * np.cos(phase), rest))


@pytest.mark.parametrize(
    ("cadence_hz", "size_m_s2"), [(1.0, 1.0), (1.4, 1.5), (2.0, 4.0), (2.4, 5.0), (3.2, 14.0)]
)
def test_every_push_is_a_landing_from_a_stroll_to_a_run(
    cadence_hz: float, size_m_s2: float
) -> None:
    told = landings(pushes(20, cadence_hz, size_m_s2))
    assert [one.setting_out for one in told] == [True] + [False] * 20
    apart_s = np.diff([one.time_ns for one in told[1:]]) / 1e9
    np.testing.assert_allclose(apart_s, 1.0 / cadence_hz, atol=0.015)


def test_a_walk_after_a_rest_sets_out_anew() -> None:
    told = landings(np.concatenate((pushes(5, 2.0, 3.0), pushes(6, 2.0, 3.0))))
    assert [one.setting_out for one in told] == [True] + [False] * 5 + [True] + [False] * 6


def test_what_shakes_a_little_or_too_fast_is_no_step() -> None:
    time_s = np.arange(600) / RATE_HZ
    assert not landings(0.2 * np.sin(2.0 * math.pi * 1.5 * time_s))
    assert not landings(3.0 * np.sin(2.0 * math.pi * 15.0 * time_s))
    assert not landings(np.linspace(0.0, 8.0, 600))


def test_quick_pushes_that_are_none_of_a_runner_count_once() -> None:
    walk = pushes(10, 2.0, 3.0)
    time_s = np.arange(len(walk)) / RATE_HZ
    doubled = walk + 2.0 * np.sin(2.0 * math.pi * 4.0 * time_s) * (np.abs(walk) > 0.0)
    assert len(landings(doubled)) == 11


def test_a_step_is_as_long_in_two_halves() -> None:
    whole_m = pendulum_m(0.6, 2.0)
    assert 2.0 * pendulum_m(0.3, 2.0) == pytest.approx(whole_m)
    assert pendulum_m(0.6, 8.0) == pytest.approx(2.0 * whole_m)


def test_who_bounces_much_less_than_usual_gets_nowhere() -> None:
    steps = PendulumSteps()
    stride = [3.0 * math.sin(0.1 * index) for index in range(63)]
    whole_m = [steps.length_m(0.6, stride) for _ in range(8)][-1]
    shuffle_m = steps.length_m(0.6, [0.1 * value for value in stride])
    assert shuffle_m < 0.3 * math.sqrt(0.1) * whole_m
    assert steps.length_m(0.6, []) == 0.0


@pytest.mark.parametrize(("hertz", "gain"), [(0.1, 1.0), (3.0, math.sqrt(0.5)), (30.0, 0.0)])
def test_the_low_pass_leaves_what_butterworth_says(hertz: float, gain: float) -> None:
    low_pass = LowPass(3.0, RATE_HZ)
    time_s = np.arange(2000) / RATE_HZ
    passed = [low_pass.step(value) for value in np.sin(2.0 * math.pi * hertz * time_s).tolist()]
    assert np.std(passed[1000:]) * math.sqrt(2.0) == pytest.approx(gain, abs=0.02)


def test_a_constant_passes_from_the_first_sample() -> None:
    low_pass = LowPass(3.0, RATE_HZ, start=9.81)
    assert [low_pass.step(9.81) for _ in range(5)] == pytest.approx([9.81] * 5)
