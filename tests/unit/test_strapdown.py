"""Attitude: carried by the gyro, levelled by gravity, faced about the vertical."""

from __future__ import annotations

import math

import pytest

from edge_agent.inertial.strapdown import WEAKEST_GRAVITY_M_S2, Strapdown
from shared.maths.rotations import (
    IDENTITY,
    about_down,
    from_rotation_vector,
    heading_of,
    inverse,
    multiply,
    rotate,
)

REST = (0.0, 0.0, -9.81)
TILTED = multiply(about_down(0.4), from_rotation_vector((0.1, 0.3, 0.0)))


def test_a_steady_turn_adds_up_at_any_step() -> None:
    for steps in (1, 10, 1000):
        strapdown = Strapdown()
        for _ in range(steps):
            strapdown.turn((0.3, -0.2, 1.1), 2.0 / steps)
        expected = from_rotation_vector((0.6, -0.4, 2.2))
        assert strapdown.nav_from_body == pytest.approx(expected, abs=1e-12)


def test_turns_of_the_body_are_about_its_own_axes() -> None:
    strapdown = Strapdown()
    strapdown.turn((0.0, math.pi / 2.0, 0.0), 1.0)
    strapdown.turn((math.pi / 2.0, 0.0, 0.0), 1.0)
    # Nose up, then rolled right: the right-hand side, which was east, points south.
    assert rotate(strapdown.nav_from_body, (0.0, 1.0, 0.0)) == pytest.approx((1, 0, 0), abs=1e-12)


def test_levelling_makes_gravity_point_up_and_takes_its_size() -> None:
    strapdown = Strapdown()
    force = rotate(inverse(TILTED), (0.0, 0.0, -9.7))
    strapdown.level(force, 0.0)
    assert rotate(strapdown.nav_from_body, force) == pytest.approx((0.0, 0.0, -9.7))
    assert strapdown.gravity_m_s2 == pytest.approx(9.7)


def test_levelling_leaves_a_level_boot_alone() -> None:
    strapdown = Strapdown()
    strapdown.face(1.2)
    strapdown.level(REST, 0.01)
    assert heading_of(strapdown.nav_from_body) == pytest.approx(1.2)


def test_noise_is_averaged_over_a_stance() -> None:
    strapdown = Strapdown()
    for index in range(200):
        strapdown.level((1.0 if index % 2 else -1.0, 0.0, -9.81), 0.01)
    assert strapdown.nav_from_body == pytest.approx(IDENTITY, abs=0.01)
    assert strapdown.gravity_m_s2 == pytest.approx(9.81, abs=0.02)


def test_the_stance_before_does_not_count() -> None:
    strapdown = Strapdown()
    for _ in range(100):
        strapdown.level((0.0, 0.0, -11.0), 0.01)
    strapdown.begin_stance()
    strapdown.level(REST, 0.01)
    assert strapdown.gravity_m_s2 == pytest.approx(9.81)


def test_no_tilt_is_taken_from_a_broken_accelerometer() -> None:
    strapdown = Strapdown()
    strapdown.level((0.0, 0.0, 0.0), 0.01)
    strapdown.level((WEAKEST_GRAVITY_M_S2 - 0.1, 0.0, 0.0), 0.01)
    assert strapdown.nav_from_body == IDENTITY
    assert strapdown.gravity_m_s2 == 0.0


def test_facing_turns_about_the_vertical_alone() -> None:
    strapdown = Strapdown()
    strapdown.nav_from_body = TILTED
    up_before = rotate(inverse(TILTED), REST)
    strapdown.face(-2.0)
    assert heading_of(strapdown.nav_from_body) == pytest.approx(-2.0)
    assert rotate(inverse(strapdown.nav_from_body), REST) == pytest.approx(up_before)
