"""The share of strides inside the ellipse they were told with, where it is known beforehand."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from edge_agent.evaluation.coverage import coverage95_pct
from edge_agent.evaluation.estimate import estimated_path
from edge_agent.evaluation.truth import Array, Truth, truth_of_stances
from edge_agent.inertial.stride_error import Covariance4
from edge_agent.mounts.interface import Increment
from shared.units import NS_PER_S

COVARIANCE_M2 = np.array([[9e-4, 4e-4], [4e-4, 4e-4]])


def covariance(block_m2: Array) -> Covariance4:
    """The wire's covariance of ``block_m2`` (2, 2) north-east, down and heading as sure as can be.

    The other entries are large, for none of them may count.
    """
    (nn, ne), (_, ee) = block_m2.tolist()
    return (nn, ne, 0.0, 0.0, ee, 0.0, 0.0, 7.0, 0.0, 7.0)


def walk(position_m: Array, block_m2: Array) -> list[Increment]:
    """Increments through ``position_m`` (k, 2), a stride each: standing at each full second."""
    increments = []
    for stride, (start_m, end_m) in enumerate(itertools.pairwise(position_m)):
        start_ns = round((stride + 0.2) * NS_PER_S)
        end_ns = start_ns + round(0.6 * NS_PER_S)
        north_m, east_m = (end_m - start_m).tolist()
        increments.append(
            Increment(start_ns, end_ns, (north_m, east_m, 0.0), 0.0, 0.0, covariance(block_m2), ())
        )
    return increments


def straight(count: int) -> Array:
    return np.outer(np.arange(count + 1.0), [1.2, 0.0])


def truth_at(position_m: Array) -> Truth:
    return truth_of_stances(np.arange(len(position_m), dtype=np.float64), position_m)


def coverage(increments: list[Increment], truth: Truth) -> float:
    return coverage95_pct(increments, estimated_path(increments), truth)


@pytest.mark.parametrize(("scale", "expected"), [(1.0, 95.0), (0.5, 52.7), (2.0, 100.0)])
@pytest.mark.parametrize("angle_rad", [0.0, 2.0])
def test_errors_drawn_as_published_are_covered_as_published(
    scale: float, expected: float, angle_rad: float
) -> None:
    """With sds told ``scale`` times too large, 1 − 0.05^(scale²) of the errors are inside."""
    count = 4000
    steps_m = np.diff(straight(count), axis=0)
    errors_m = np.random.default_rng(5).multivariate_normal((0.0, 0.0), COVARIANCE_M2, count)
    position_m = np.vstack((np.zeros(2), np.cumsum(steps_m + errors_m, axis=0)))
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    increments = walk(position_m @ turn.T, scale**2 * turn @ COVARIANCE_M2 @ turn.T)
    assert coverage(increments, truth_at(straight(count))) == pytest.approx(expected, abs=1.0)


def test_the_ellipse_ends_at_its_edge() -> None:
    """Every second stride goes astray along east by as much as the sign says, and back."""
    truth = truth_at(straight(40))
    for share, expected in ((0.99, 100.0), (1.01, 0.0)):
        position_m = straight(40)
        position_m[1::2, 1] = share * np.sqrt(5.991464547) * 0.03
        steady = np.diag([0.02**2, 0.03**2])
        assert coverage(walk(position_m, steady), truth) == pytest.approx(expected, abs=5.0)


def test_a_stance_missed_shares_the_covariance_by_time() -> None:
    joined = [
        Increment(
            round((stride + 0.2) * NS_PER_S),
            round((stride + 1.8) * NS_PER_S),
            (2.4, 0.0, 0.0),
            0.0,
            0.0,
            covariance(0.02 * np.eye(2)),
            (),
        )
        for stride in range(0, 12, 2)
    ]
    for off_m, expected in ((0.20, 100.0), (0.30, 0.0)):
        astray_m = straight(12)
        astray_m[1::2, 0] += off_m  # Each stride may be off by √(5.99·0.01) = 0.245 m.
        assert coverage(joined, truth_at(astray_m)) == expected


def test_a_stride_told_without_covariance_is_outside() -> None:
    increments = walk(straight(8), COVARIANCE_M2)
    truth = truth_at(np.vstack((straight(8), [[9 * 1.2, 0.0], [10 * 1.2, 0.0]])))
    assert coverage(increments, truth) == pytest.approx(80.0)


def test_strides_between_two_true_stances_add_up() -> None:
    increments = walk(straight(12), 0.01 * np.eye(2))
    seen = truth_of_stances(np.arange(0.0, 13.0, 2.0), straight(12)[::2])
    for off_m, expected in ((0.34, 100.0), (0.36, 0.0)):
        bent_m = seen.position_m.copy()
        bent_m[1::2, 0] += off_m  # Each pair may be off by √(5.99·0.02) = 0.346 m.
        assert coverage(increments, truth_of_stances(seen.time_s, bent_m)) == expected
