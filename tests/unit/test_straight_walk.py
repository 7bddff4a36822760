"""A gyro that drifts is told from a bend by how slowly it turns who walks straight on."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from edge_agent.inertial.straight_walk import StraightWalk
from shared.maths.angles import wrap_rad

STEP_S, STEP_M = 0.55, 0.7
GYRO_RAD2 = math.radians(0.2) ** 2


def errors_deg(
    true_deg: Callable[[float], float], drift_deg_s: float, steps: int, scatter_deg: float = 3.0
) -> np.ndarray:
    """Return the errors of the courses told, against the first, of a walk that leads so."""
    chance = np.random.default_rng(3)
    straight = StraightWalk(math.radians(0.1))
    turned_rad, errors = 0.0, []
    for step in range(steps):
        time_s = STEP_S * step
        aside_deg = scatter_deg * ((-1.0) ** step + 0.3 * chance.normal())
        read_rad = math.radians(true_deg(time_s) + drift_deg_s * time_s + aside_deg)
        course_rad = wrap_rad(read_rad + turned_rad)
        turned_rad += straight.take(course_rad, STEP_S, GYRO_RAD2, STEP_M).turn_rad
        error_rad = read_rad + turned_rad - math.radians(true_deg(time_s) + aside_deg)
        errors.append(math.degrees(wrap_rad(error_rad)))
    return np.array(errors)


@pytest.mark.parametrize("drift_deg_s", [0.0, 0.1, -0.15])
def test_drift_on_a_long_straight_way_is_taken_away(drift_deg_s: float) -> None:
    errors = errors_deg(lambda _: 0.0, drift_deg_s, 200)
    assert np.abs(errors).max() < 5.0
    assert abs(drift_deg_s) * 200 * STEP_S > 10.0 or drift_deg_s == 0.0


def test_what_is_learnt_goes_on_after_a_turn() -> None:
    errors = errors_deg(lambda time_s: 0.0 if time_s < 60.0 else 180.0, 0.1, 240)
    assert np.abs(errors).max() < 6.0


@pytest.mark.parametrize("bend_deg_s", [1.0, 4.0])
def test_a_bend_is_followed(bend_deg_s: float) -> None:
    assert np.abs(errors_deg(lambda time_s: bend_deg_s * time_s, 0.0, 160)).max() < 3.0


def test_who_goes_to_and_fro_is_left_alone() -> None:
    errors = errors_deg(lambda time_s: 60.0 * math.sin(time_s), 0.0, 100)
    assert np.abs(errors).max() < 1.0
