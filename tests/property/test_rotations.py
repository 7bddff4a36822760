"""Rotations are a group that keeps lengths, and each form of them gives the others back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from shared.maths.angles import wrap_rad
from shared.maths.rotations import (
    IDENTITY,
    UP,
    Quaternion,
    Vector3,
    about_down,
    from_gravity,
    from_rotation_vector,
    heading_of,
    inverse,
    multiply,
    normalise,
    rotate,
    shortest,
    to_matrix,
    to_rotation_vector,
)

numbers = st.floats(-100.0, 100.0).map(lambda x: 0.0 if abs(x) < 1e-6 else x)
vectors = st.tuples(numbers, numbers, numbers)
directions = vectors.filter(lambda vector: math.hypot(*vector) > 1e-3)
angles = st.floats(-math.pi, math.pi)


@st.composite
def rotations(draw: st.DrawFn) -> Quaternion:
    """Any rotation: the angle is uniform, so that half turns and none at all both come up."""
    x, y, z = draw(directions)
    angle = draw(st.one_of(angles, st.sampled_from([0.0, 1e-12, 1e-5, math.pi])))
    scale = angle / math.hypot(x, y, z)
    return from_rotation_vector((scale * x, scale * y, scale * z))


def near(left: Vector3, right: Vector3, within: float = 1e-9) -> bool:
    return math.dist(left, right) <= within * (1.0 + math.hypot(*left))


@given(rotations(), vectors)
def test_rotation_keeps_length_and_its_inverse_undoes_it(q: Quaternion, v: Vector3) -> None:
    assert math.isclose(math.hypot(*rotate(q, v)), math.hypot(*v), rel_tol=1e-12, abs_tol=1e-12)
    assert near(rotate(inverse(q), rotate(q, v)), v)


@given(rotations(), rotations(), vectors)
def test_product_does_the_right_one_first(p: Quaternion, q: Quaternion, v: Vector3) -> None:
    assert near(rotate(multiply(p, q), v), rotate(p, rotate(q, v)))


@given(rotations(), rotations(), rotations())
def test_product_is_associative_and_of_norm_one(
    p: Quaternion, q: Quaternion, r: Quaternion
) -> None:
    left, right = multiply(multiply(p, q), r), multiply(p, multiply(q, r))
    assert math.dist(left, right) < 1e-12
    assert math.isclose(math.hypot(*left), 1.0, rel_tol=1e-12)


@given(rotations())
def test_identity_is_neutral(q: Quaternion) -> None:
    assert multiply(IDENTITY, q) == q
    assert math.dist(multiply(q, inverse(q)), IDENTITY) < 1e-12


@given(st.tuples(*[st.floats(-1.8, 1.8)] * 3))
def test_rotation_vector_round_trip_up_to_a_half_turn(v: Vector3) -> None:
    assert near(to_rotation_vector(from_rotation_vector(v)), v)


@given(rotations())
def test_both_signs_of_a_quaternion_are_one_rotation(q: Quaternion) -> None:
    w, x, y, z = q
    assume(abs(w) > 1e-9)
    assert near(to_rotation_vector((-w, -x, -y, -z)), to_rotation_vector(q))


@given(rotations(), vectors)
def test_matrix_does_what_the_quaternion_does(q: Quaternion, v: Vector3) -> None:
    matrix = np.array(to_matrix(q))
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    assert math.isclose(float(np.linalg.det(matrix)), 1.0, rel_tol=1e-12)
    np.testing.assert_allclose(matrix @ v, rotate(q, v), atol=1e-9 * (1.0 + math.hypot(*v)))


@given(directions, directions)
def test_shortest_rotation_gets_there_by_the_angle_between(a: Vector3, b: Vector3) -> None:
    q = shortest(a, b)
    turned, scale = rotate(q, a), math.hypot(*a) / math.hypot(*b)
    assert near(turned, (scale * b[0], scale * b[1], scale * b[2]), 1e-6)
    cosine = float(np.dot(a, b) / math.hypot(*a) / math.hypot(*b))
    angle = math.hypot(*to_rotation_vector(q))
    assert math.isclose(math.cos(angle), max(-1.0, min(1.0, cosine)), abs_tol=1e-6)


@given(directions)
def test_shortest_rotation_to_the_opposite_is_a_half_turn(a: Vector3) -> None:
    opposite = (-a[0], -a[1], -a[2])
    assert near(rotate(shortest(a, opposite), a), opposite, 1e-6)


@given(directions, angles)
def test_gravity_gives_tilt_and_the_heading_is_told(force: Vector3, heading: float) -> None:
    q = from_gravity(force, heading)
    length = math.hypot(*force)
    assert near(rotate(q, force), (0.0, 0.0, -length), 1e-6)
    right = rotate(q, (0.0, 1.0, 0.0))
    assume(math.hypot(right[0], right[1]) > 1e-3)
    assert abs(wrap_rad(heading_of(q) - heading)) < 1e-6


@given(angles, st.floats(-1.5, 1.5))
def test_heading_is_that_of_the_turn_whatever_the_pitch(heading: float, pitch: float) -> None:
    q = multiply(about_down(heading), from_rotation_vector((0.0, pitch, 0.0)))
    assert abs(wrap_rad(heading_of(q) - heading)) < 1e-9


@given(rotations(), angles)
def test_turning_about_down_adds_to_heading(q: Quaternion, turn: float) -> None:
    right = rotate(q, (0.0, 1.0, 0.0))
    assume(math.hypot(right[0], right[1]) > 1e-3)
    turned = multiply(about_down(turn), q)
    assert abs(wrap_rad(heading_of(turned) - heading_of(q) - turn)) < 1e-6


def test_a_quarter_turn_to_the_right_from_north_is_east() -> None:
    assert near(rotate(about_down(math.pi / 2.0), (1.0, 0.0, 0.0)), (0.0, 1.0, 0.0))


def test_a_sensor_lying_level_is_not_tilted() -> None:
    assert math.dist(from_gravity((0.0, 0.0, -9.81)), IDENTITY) < 1e-12


def test_what_has_no_direction_is_refused() -> None:
    with pytest.raises(ValueError, match="norm zero"):
        normalise((0.0, 0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="length zero"):
        shortest((0.0, 0.0, 0.0), UP)
