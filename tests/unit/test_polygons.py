"""Points in polygons."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from shared.maths.polygons import inside_polygon

L_SHAPE = ((0.0, 0.0), (0.0, 10.0), (4.0, 10.0), (4.0, 6.0), (8.0, 6.0), (8.0, 0.0))


def test_a_corner_that_goes_in_is_outside() -> None:
    points = [(2.0, 8.0), (6.0, 2.0), (6.0, 8.0), (-1.0, 5.0), (9.0, 3.0), (2.0, 11.0)]
    expected = [True, True, False, False, False, False]
    assert inside_polygon(points, L_SHAPE).tolist() == expected
    assert inside_polygon(points, L_SHAPE[::-1]).tolist() == expected
    assert inside_polygon(np.empty((0, 2)), L_SHAPE).size == 0


@given(
    st.integers(3, 12), st.floats(0.0, 6.3), st.floats(0.0, 0.95), st.floats(1.05, 9.0),
    st.floats(0.0, 6.3),
)  # fmt: skip
def test_a_regular_polygon_holds_its_inner_circle_and_nothing_beyond_its_corners(
    corners: int, turn_rad: float, within: float, beyond: float, toward_rad: float
) -> None:
    angles = turn_rad + np.arange(corners) * 2.0 * math.pi / corners
    outline = np.column_stack([np.cos(angles), np.sin(angles)])
    ray = np.array([math.cos(toward_rad), math.sin(toward_rad)])
    inner = math.cos(math.pi / corners)
    assert inside_polygon([within * inner * ray, beyond * ray], outline).tolist() == [True, False]
