"""Euler's kinematics, their analytic Jacobian, and the filter that goes by them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge_agent.inertial.attitude_ekf import (
    AttitudeEkf,
    euler_rates,
    euler_rates_jacobian,
    tilt_of,
)
from shared.maths.rotations import Vector3

ROLLS = st.floats(-3.0, 3.0)
PITCHES = st.floats(-1.3, 1.3)
RATES = st.tuples(*[st.floats(-5.0, 5.0)] * 3)
STEP_RAD = 1e-6


@given(ROLLS, PITCHES, RATES)
def test_the_jacobian_is_the_slope_of_the_kinematics(
    roll_rad: float, pitch_rad: float, rate_rad_s: Vector3
) -> None:
    slopes = []
    for rolled, pitched in ((STEP_RAD, 0.0), (0.0, STEP_RAD)):
        ahead = euler_rates(roll_rad + rolled, pitch_rad + pitched, rate_rad_s)
        behind = euler_rates(roll_rad - rolled, pitch_rad - pitched, rate_rad_s)
        slopes.append((ahead - behind) / (2.0 * STEP_RAD))
    jacobian = euler_rates_jacobian(roll_rad, pitch_rad, rate_rad_s)
    assert jacobian[:, :2] == pytest.approx(np.column_stack(slopes), rel=1e-5, abs=1e-5)
    assert not jacobian[:, 2].any()


@given(ROLLS, PITCHES)
def test_gravity_tells_tilt(roll_rad: float, pitch_rad: float) -> None:
    force_m_s2 = (
        9.81 * math.sin(pitch_rad),
        -9.81 * math.cos(pitch_rad) * math.sin(roll_rad),
        -9.81 * math.cos(pitch_rad) * math.cos(roll_rad),
    )
    assert tilt_of(force_m_s2) == pytest.approx((roll_rad, pitch_rad), abs=1e-9)


@given(st.lists(st.tuples(RATES, RATES), min_size=1, max_size=40))
def test_covariances_stay_symmetric_and_positive(
    readings: list[tuple[Vector3, Vector3]],
) -> None:
    ekf = AttitudeEkf((0.0, 0.0, -9.81))
    for rate_rad_s, (fx, fy, fz) in readings:
        ekf.predict(rate_rad_s, 0.02)
        ekf.correct((fx, fy, fz - 10.0))
        assert np.array_equal(ekf.covariance, ekf.covariance.T)
        assert np.linalg.eigvalsh(ekf.covariance).min() > -1e-9
        assert np.isfinite(ekf.state_rad).all()


def test_a_tilted_turn_is_a_turn() -> None:
    # Half an hour's turn about the vertical, held at 40° of pitch and 20° of roll.
    pitch_rad, roll_rad = math.radians(40.0), math.radians(20.0)
    up = np.array(
        [math.sin(pitch_rad), -math.cos(pitch_rad) * math.sin(roll_rad),
         -math.cos(pitch_rad) * math.cos(roll_rad)]
    )  # fmt: skip
    fx, fy, fz = (9.81 * up).tolist()
    wx, wy, wz = (-0.5 * up).tolist()
    ekf = AttitudeEkf((fx, fy, fz))
    for _ in range(100):
        ekf.predict((wx, wy, wz), 0.02)
        ekf.correct((fx, fy, fz))
    assert ekf.yaw_rad == pytest.approx(1.0, abs=1e-6)
