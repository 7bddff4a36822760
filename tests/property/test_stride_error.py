"""Covariances are covariances: symmetric by form, and positive whatever the stride was like."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from edge_agent.inertial.linear_zupt import Stride
from edge_agent.inertial.stride_error import (
    Covariance4,
    heading_variance,
    lost_covariance,
    stride_covariance,
)

lengths = st.floats(-80.0, 80.0)
speeds = st.floats(-1e4, 1e4)
times = st.floats(0.01, 1e4)
strides = st.builds(
    Stride,
    st.tuples(lengths, lengths, lengths),
    st.tuples(speeds, speeds, speeds),
    times,
    st.just(()),
)


def matrix(upper: Covariance4) -> NDArray[np.float64]:
    full = np.zeros((4, 4))
    full[np.triu_indices(4)] = upper
    return full + np.triu(full, 1).T


@given(strides, st.floats(0.0, 10.0), times, st.booleans())
def test_a_stride_has_a_positive_covariance(
    stride: Stride, gap_s: float, elapsed_s: float, bias_known: bool
) -> None:
    variance = heading_variance(elapsed_s, gap_s, bias_known=bias_known)
    values = np.linalg.eigvalsh(matrix(stride_covariance(stride, gap_s, variance)))
    assert values.min() > -1e-9 * values.max()
    assert np.isfinite(values).all()


@given(strides, st.floats(0.0, 10.0), st.floats(0.01, 10.0))
def test_a_gap_and_a_residual_never_make_a_stride_surer(
    stride: Stride, gap_s: float, more_s: float
) -> None:
    sure = np.diag(matrix(stride_covariance(stride, gap_s, 0.01)))
    assert (np.diag(matrix(stride_covariance(stride, gap_s + more_s, 0.01))) >= sure).all()
    perfect = stride._replace(residual_m_s=(0.0, 0.0, 0.0))
    assert (np.diag(matrix(stride_covariance(perfect, gap_s, 0.01))) <= sure).all()


@given(st.floats(0.0, 1e9), st.one_of(st.just(math.inf), times))
def test_being_lost_stays_within_what_the_wire_carries(elapsed_s: float, gap_s: float) -> None:
    variance = heading_variance(elapsed_s, gap_s, bias_known=False)
    upper = lost_covariance(elapsed_s, variance)
    assert all(0.0 <= value <= 1e12 for value in upper)
    assert variance <= math.pi**2 / 3.0


def test_a_heading_error_bends_the_stride_to_the_right() -> None:
    east = Stride((0.0, 2.0, 0.0), (0.0, 0.0, 0.0), 1.0, ())
    covariance = matrix(stride_covariance(east, 0.0, 0.04))
    # Walking east, a heading error to the right pushes the end south: by half of 0.2 rad × 2 m.
    assert covariance[0, 3] == -0.04
    assert math.isclose(covariance[0, 0] - covariance[1, 1], 0.04, rel_tol=1e-9)
