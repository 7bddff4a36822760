"""When the boot's filter doubts: hard heels, slow swings, and strides that end in a surprise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from edge_agent.inertial.boot_filter import believes_still
from edge_agent.inertial.boot_state import initial_state
from edge_agent.inertial.boot_strides import placement_variance, write_increment_covariance
from edge_agent.inertial.eskf_parameters import EskfParameters, kernel_parameters
from edge_agent.inertial.sample_ring import RATE, SAMPLE_WIDTH
from edge_agent.inertial.zero_velocity import DEEP, STRONG
from edge_agent.inertial.zupt_filter import STATES, add_process_noise

PARAMETERS = EskfParameters()
KERNEL = kernel_parameters(PARAMETERS, 200.0)[0]
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
RESTING = np.array([[0.0, 0.0, -9.81]])


def turn_noise(leap_rad_s: float, dt_s: float) -> float:
    """Variance of heading that one sample adds whose rate has leapt from zero."""
    covariance, transition = np.zeros((STATES, STATES)), np.zeros(13)
    transition[0] = dt_s
    row, before = np.zeros(SAMPLE_WIDTH), np.zeros(SAMPLE_WIDTH)
    row[RATE + 1] = leap_rad_s
    add_process_noise(covariance, transition, RESTING[0], np.zeros(3), row, before, KERNEL)
    return float(covariance[8, 8])


@pytest.mark.parametrize("dt_s", [0.005, 0.01])
def test_a_rate_that_leaps_loses_a_share_of_the_turn(dt_s: float) -> None:
    lost_rad = PARAMETERS.lost_turn_share * 6.0 * dt_s
    assert turn_noise(6.0, dt_s) - turn_noise(0.0, dt_s) == pytest.approx(lost_rad**2)


def stands(kind: int, since_s: float, peak_m_s: float) -> bool:
    """Whether a boot is believed still that the filter surely has at 1 m/s."""
    state = initial_state(PARAMETERS, RESTING, np.zeros((1, 3)))
    state["velocity_m_s"][0] = (1.0, 0.0, 0.0)
    state["since_update_s"], state["peak_speed_m_s"] = since_s, peak_m_s
    return bool(believes_still(state[0], KERNEL, kind, np.zeros(3), 1e-3))


def test_a_weak_stance_waits_for_a_slow_swing_to_go_its_way() -> None:
    assert not stands(DEEP, since_s=0.65, peak_m_s=8.0)
    assert stands(DEEP, since_s=0.75, peak_m_s=8.0)
    assert not stands(DEEP, since_s=1.1, peak_m_s=2.5)
    assert stands(DEEP, since_s=1.25, peak_m_s=2.5)


def test_a_strong_stance_waits_alike_for_every_swing() -> None:
    for peak_m_s in (1.1, 8.0):
        assert not stands(STRONG, since_s=0.95, peak_m_s=peak_m_s)
        assert stands(STRONG, since_s=1.05, peak_m_s=peak_m_s)


def told(swing_innovation: float) -> NDArray[np.float64]:
    spread, out = np.diag(np.full(STATES, 4e-4)), np.zeros((4, 4))
    write_increment_covariance(spread, out, KERNEL, swing_innovation)
    return out


def test_a_stride_that_ends_in_a_surprise_is_told_as_less_sure() -> None:
    calm, surprised, astray, further = (told(nis) for nis in (0.0, 4.0, 10.0, 1e9))
    factor, share = PARAMETERS.level_covariance_factor, PARAMETERS.level_innovation_factor
    for axis in (0, 1):
        assert calm[axis, axis] == pytest.approx(factor * 4e-4)
        assert surprised[axis, axis] == pytest.approx((factor + 4.0 * share) * 4e-4)
    assert surprised[3, 3] > calm[3, 3]
    assert surprised[2, 2] == pytest.approx(calm[2, 2])  # height goes by what was corrected of it
    np.testing.assert_allclose(further, astray)


def placed_m2(tilted_rad: float, turned_rad: float) -> float:
    tilted = np.array([math.cos(tilted_rad / 2), math.sin(tilted_rad / 2), 0.0, 0.0])
    return float(placement_variance(LEVEL, tilted, turned_rad, KERNEL))


def test_a_foot_set_down_otherwise_is_told_as_less_sure_of_its_place() -> None:
    alike_m2 = PARAMETERS.placement_sd_m**2
    assert placed_m2(0.0, 0.0) == pytest.approx(alike_m2)
    by_tilt_m, by_turn_m = PARAMETERS.placement_sd_per_tilt_m, PARAMETERS.placement_sd_per_turn_m
    assert placed_m2(0.2, 0.0) == pytest.approx(alike_m2 + (0.2 * by_tilt_m) ** 2)
    assert placed_m2(3.0, 0.0) == pytest.approx(placed_m2(PARAMETERS.largest_tilt_rad, 0.0))
    for turned_rad in (math.pi, -math.pi):
        assert placed_m2(0.0, turned_rad) == pytest.approx(alike_m2 + (2.0 * by_turn_m) ** 2)
