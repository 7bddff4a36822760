"""The gyro's bias on a person who sways."""

from __future__ import annotations

import math

import pytest

from edge_agent.inertial.rest_bias import RestBias

STEP_S = 0.01


def swayed(lasts_s: float) -> RestBias:
    """Return what is learnt from a rest that ends at the far end of a sway of 0.2 Hz."""
    sway_rad, bias_rad_s = math.radians(0.3), 0.01
    learner, pulse = RestBias(), 2.0 * math.pi * 0.2
    for index in range(round(lasts_s / STEP_S)):
        sway_rad_s = sway_rad * pulse * math.cos(pulse * index * STEP_S)
        learner.add((bias_rad_s, bias_rad_s + sway_rad_s, 0.0), 9.81, STEP_S)
    return learner


def test_the_longer_the_rest_the_better() -> None:
    errors = [abs(swayed(lasts_s).bias_rad_s[1] - 0.01) for lasts_s in (6.25, 31.25)]
    assert errors[1] < 0.3 * errors[0]
    assert swayed(31.25).sd_rad_s < 0.3 * swayed(6.25).sd_rad_s


def test_where_in_its_sway_a_rest_ends_hardly_matters() -> None:
    """The mean rate is wrong by what the sway is off at the end, over the time of the rest."""
    errors = [swayed(lasts_s).bias_rad_s[1] - 0.01 for lasts_s in (29.0, 30.25, 31.5, 32.75)]
    of_means_rad_s = math.radians(0.3) / math.sqrt(2.0) / 31.0
    assert math.hypot(*errors) / 2.0 < 0.5 * of_means_rad_s


@pytest.mark.parametrize("lasts_s", [3.75, 6.25, 11.25, 31.25])
def test_errors_are_as_told(lasts_s: float) -> None:
    learner = swayed(lasts_s)
    assert abs(learner.bias_rad_s[1] - 0.01) < 3.0 * learner.sd_rad_s
    assert learner.bias_rad_s[0] == pytest.approx(0.01, abs=3.0 * learner.sd_rad_s)


def test_a_table_tells_in_two_seconds() -> None:
    learner = RestBias()
    for _ in range(200):
        learner.add((0.01, -0.005, 0.002), 9.81, STEP_S)
    assert learner.bias_rad_s == pytest.approx((0.01, -0.005, 0.002), abs=2e-4)


def test_a_walk_tells_nothing() -> None:
    learner = RestBias()
    for index in range(2000):
        rate_rad_s = 0.5 * math.sin(2.0 * math.pi * 1.0 * index * STEP_S)
        force_m_s2 = 9.81 + 3.0 * math.sin(2.0 * math.pi * 2.0 * index * STEP_S)
        learner.add((0.01, rate_rad_s, 0.0), force_m_s2, STEP_S)
    assert learner.bias_rad_s == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


def test_a_steady_turn_is_no_bias() -> None:
    learner = RestBias()
    for _ in range(1000):
        learner.add((0.0, 0.2, 0.0), 9.81, STEP_S)
    assert learner.bias_rad_s == (0.0, 0.0, 0.0)
