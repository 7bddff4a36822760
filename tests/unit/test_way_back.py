"""The way back to the entrance leaves out what was walked in and out again."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.way_back import WayBack

STRIDE_M = 1.2


def walked(*legs: tuple[float, float]) -> WayBack:
    """Walk legs (north, east; m) in strides."""
    way = WayBack(2.0, 6.0)
    for north_m, east_m in legs:
        strides = math.ceil(math.hypot(north_m, east_m) / STRIDE_M)
        for _ in range(strides):
            way.walk(north_m / strides, east_m / strides)
    return way


def test_a_straight_way_is_as_long_as_it_leads_far() -> None:
    way = walked((24.0, 0.0))
    assert way.length_m == pytest.approx(24.0)
    assert way.straightness(math.inf) == pytest.approx(1.0)
    assert way.direction(6.0, 0.95) == pytest.approx((1.0, 0.0))


def test_a_room_searched_and_left_by_the_same_door_is_no_part_of_it() -> None:
    way = walked(
        (12.0, 0.0), (0.0, 8.0), (6.0, 0.0), (0.0, -5.0), (-6.0, 0.0), (0.0, -3.0), (4.0, 0.0)
    )  # fmt: skip
    assert way.length_m == pytest.approx(16.0, abs=2.5)
    assert way.straightness(math.inf) > 0.9


def test_who_turns_back_comes_nearer_to_the_entrance() -> None:
    assert walked((30.0, 0.0), (-24.0, 0.0)).length_m == pytest.approx(6.0, abs=3.0)


def test_another_storey_begins_a_way_of_its_own() -> None:
    way = walked((12.0, 0.0), (0.0, 12.0))
    way.come_in()
    assert way.length_m == 0.0
    assert way.direction(6.0, 0.95) is None


@given(st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)), max_size=60))
def test_the_way_back_leads_here_and_is_no_longer_than_what_was_walked(
    moves: list[tuple[float, float]],
) -> None:
    way = WayBack(2.0, 6.0)
    for north_m, east_m in moves:
        way.walk(north_m, east_m)
    total_m = np.sum(moves, axis=0) if moves else np.zeros(2)
    assert way.here_m == pytest.approx(tuple(total_m), abs=1e-9)
    most_m = math.fsum(math.hypot(*move) for move in moves)
    assert math.hypot(*way.here_m) <= way.length_m + 1e-6
    assert way.length_m <= most_m + 1e-6
    assert 0.0 <= way.straightness(20.0) <= 1.0
