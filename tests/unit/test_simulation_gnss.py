"""Satellite fixes: where they last, and that they err as their receiver says."""

from __future__ import annotations

import numpy as np
import pytest

from shared.config import parse_toml
from shared.simulation.gnss import GnssReceiver, distance_outside_m, simulate_fixes
from shared.simulation.plan import Floor, Plan, load_plan

HOUSE = load_plan("house_of_four_daps")
NO_WALLS = Plan(description="a field", floors=(Floor("ground", 0.0),))


def test_distance_is_to_the_outer_walls() -> None:
    corners_m = HOUSE.wall_pieces_m.reshape(-1, 2)
    north_m = float(corners_m[:, 0].max())
    middle_m = corners_m.mean(axis=0)
    outside_m = distance_outside_m(HOUSE, np.array([[north_m + 7.0, middle_m[1]], middle_m]))
    assert outside_m[0] == pytest.approx(7.0)
    assert outside_m[1] < -3.0
    assert distance_outside_m(NO_WALLS, np.zeros((2, 2))).tolist() == [np.inf, np.inf]


def test_fixes_end_a_little_way_in() -> None:
    corners_m = HOUSE.wall_pieces_m.reshape(-1, 2)
    edge_m, east_m = corners_m[:, 0].min(), corners_m[:, 1].mean()
    time_s = np.arange(40.0)
    way_m = np.column_stack([edge_m - 20.0 + time_s, np.full(40, east_m), np.zeros(40)])
    fixes = simulate_fixes(
        GnssReceiver(until_m=2.0), HOUSE, time_s, way_m, np.random.default_rng(0)
    )
    assert fixes.time_s[-1] == pytest.approx(21.0, abs=1.0)
    assert fixes.sd_m[0] < 0.5 * fixes.sd_m[-1]


def test_fixes_err_as_the_receiver_says() -> None:
    time_s = np.arange(0.0, 100_000.0, 10.0)
    receiver = GnssReceiver(sd_m=3.0, correlation_s=30.0)
    chance = np.random.default_rng(1)
    fixes = simulate_fixes(receiver, NO_WALLS, time_s, np.zeros((len(time_s), 3)), chance)
    error_m = fixes.position_m[:, :2]
    assert fixes.sd_m == pytest.approx(3.0)
    assert error_m.std(axis=0) == pytest.approx([3.0, 3.0], rel=0.05)
    kept = np.mean(error_m[1:] * error_m[:-1]) / np.mean(error_m**2)
    assert kept == pytest.approx(np.exp(-10.0 / 30.0), abs=0.03)


def test_a_scenario_says_so_under_gnss() -> None:
    assert parse_toml("until_m = 3.0", GnssReceiver, "[gnss]").until_m == 3.0
