"""Directions modulo a right angle: the nearest one is taken away, alike in machine code."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from command_post.fusion.team.arithmetic import nearest_right_angle
from shared.maths.angles import HALF_PI, nearest_right_angle_rad

angles = st.floats(-1e4, 1e4)


@given(angles)
def test_what_is_left_of_an_angle_is_within_45_degrees_and_along_or_across_it(
    angle_rad: float,
) -> None:
    left_rad = angle_rad - nearest_right_angle_rad(angle_rad)
    assert abs(left_rad) <= HALF_PI / 2.0 + 1e-9
    assert abs(math.sin(2.0 * (angle_rad - left_rad))) < 1e-8


@given(st.lists(angles, min_size=1))
def test_machine_code_and_arrays_make_the_same(several_rad: list[float]) -> None:
    plain = [nearest_right_angle_rad(each) for each in several_rad]
    assert [nearest_right_angle(each) for each in several_rad] == plain
    assert nearest_right_angle_rad(np.array(several_rad)).tolist() == plain
