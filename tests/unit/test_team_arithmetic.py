"""Our own arithmetic against the library's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from command_post.fusion.team.arithmetic import (
    factorise,
    invert_factorised,
    logarithm,
    sine_cosine,
    solve_factorised,
)


@given(st.floats(-1e4, 1e4))
def test_sine_and_cosine(angle_rad: float) -> None:
    expected = (math.sin(angle_rad), math.cos(angle_rad))
    assert sine_cosine(angle_rad) == pytest.approx(expected, abs=1e-15)


@given(st.floats(1e-300, 1e300))
def test_logarithm(number: float) -> None:
    assert logarithm(number) == pytest.approx(math.log(number), rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("size", [1, 2, 7, 40])
def test_a_factor_solves_and_inverts(size: int) -> None:
    chance = np.random.default_rng(size)
    half = chance.normal(size=(size, size))
    matrix = half @ half.T + np.eye(size)
    factor = matrix.copy()
    assert factorise(factor)
    vector = chance.normal(size=size)
    solution = vector.copy()
    solve_factorised(factor, solution)
    assert matrix @ solution == pytest.approx(vector, abs=1e-9)
    inverse = invert_factorised(factor)
    assert matrix @ inverse == pytest.approx(np.eye(size), abs=1e-9)
    assert (inverse == inverse.T).all()


def test_what_is_not_positive_definite_is_told() -> None:
    assert not factorise(np.array([[1.0, 0.0], [2.0, 1.0]]))
    assert not factorise(np.array([[math.nan]]))
