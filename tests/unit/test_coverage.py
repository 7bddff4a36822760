"""The share of strides inside the ellipse they were told with, where it is known beforehand."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from edge_agent.evaluation.coverage import coverage95_pct, whole_path_coverage95_pct
from edge_agent.evaluation.estimate import estimated_path
from edge_agent.evaluation.truth import Array, Truth, truth_of_stances
from edge_agent.inertial.stride_error import Covariance4
from edge_agent.mounts.interface import Increment
from shared.units import NS_PER_S

COVARIANCE = np.array([[9e-4, 4e-4, 0.0], [4e-4, 4e-4, 1e-4], [0.0, 1e-4, 3e-4]])
"""Of north, east and heading, the heading tied to east: by √(3e-4) a stride is 1° each."""

NO_TURN = np.diag([1.0, 1.0, 0.0])


def covariance(block: Array) -> Covariance4:
    """The wire's covariance of ``block`` (3, 3), of north, east and heading.

    The entries of down are large, for none of them may count.
    """
    (nn, ne, nh), (_, ee, eh), (_, _, hh) = block.tolist()
    return (nn, ne, 0.0, nh, ee, 0.0, eh, 7.0, 0.0, hh)


def walk(position_m: Array, block: Array) -> list[Increment]:
    """Increments through ``position_m`` (k, 2), a stride each: standing at each full second."""
    increments = []
    for stride, (start_m, end_m) in enumerate(itertools.pairwise(position_m)):
        start_ns = round((stride + 0.2) * NS_PER_S)
        end_ns = start_ns + round(0.6 * NS_PER_S)
        north_m, east_m = (end_m - start_m).tolist()
        increments.append(
            Increment(start_ns, end_ns, (north_m, east_m, 0.0), 0.0, 0.0, covariance(block), ())
        )
    return increments


def straight(count: int) -> Array:
    return np.outer(np.arange(count + 1.0), [1.2, 0.0])


def truth_at(position_m: Array) -> Truth:
    return truth_of_stances(np.arange(len(position_m), dtype=np.float64), position_m)


def coverage(increments: list[Increment], truth: Truth) -> float:
    return coverage95_pct(increments, estimated_path(increments), truth)


def whole_path_coverage(increments: list[Increment], truth: Truth) -> float:
    return whole_path_coverage95_pct(increments, estimated_path(increments), truth)


def drawn(count: int, block: Array, begins_rad: float, scale: float = 1.0) -> list[Increment]:
    """Strides straight ahead whose errors are drawn from ``block``, heading's adding up.

    Each is told in the agent's axes as they are turned by then, and so is its covariance, with
    standard deviations ``scale`` times too large.
    """
    errors = np.random.default_rng(5).multivariate_normal(np.zeros(3), block, count)
    turned_rad = begins_rad + np.concatenate(([0.0], np.cumsum(errors[:-1, 2])))
    told_m, told = np.zeros((count + 1, 2)), []
    for stride, angle_rad in enumerate(turned_rad.tolist()):
        turn = np.eye(3)
        c, s = np.cos(angle_rad), np.sin(angle_rad)
        turn[:2, :2] = [[c, -s], [s, c]]
        told_m[stride + 1] = told_m[stride] + turn[:2, :2] @ (errors[stride, :2] + [1.2, 0.0])
        told.append(covariance(scale**2 * turn @ block @ turn.T))
    return [
        increment._replace(covariance=its_own)
        for increment, its_own in zip(walk(told_m, block), told, strict=True)
    ]


@pytest.mark.parametrize(("scale", "expected"), [(1.0, 95.0), (0.5, 52.7), (2.0, 100.0)])
@pytest.mark.parametrize("angle_rad", [0.0, 2.0])
def test_errors_drawn_as_published_are_covered_as_published(
    scale: float, expected: float, angle_rad: float
) -> None:
    """With sds told ``scale`` times too large, 1 − 0.05^(scale²) of the errors are inside."""
    count = 4000
    increments = drawn(count, COVARIANCE, angle_rad, scale)
    truth = truth_at(straight(count))
    assert coverage(increments, truth) == pytest.approx(expected, abs=2.0)
    assert whole_path_coverage(increments, truth) < 30.0


def test_headings_without_drift_are_covered_alike_by_the_whole_path() -> None:
    block = NO_TURN @ COVARIANCE @ NO_TURN
    increments, truth = drawn(4000, block, 0.4), truth_at(straight(4000))
    assert coverage(increments, truth) == pytest.approx(95.0, abs=1.0)
    assert whole_path_coverage(increments, truth) == pytest.approx(95.0, abs=1.0)


@pytest.mark.parametrize("unsaid", ["the turn", "that turn and place are tied"])
def test_drift_that_is_not_told_falls_outside(unsaid: str) -> None:
    kept = COVARIANCE.copy()
    if unsaid == "the turn":
        kept = NO_TURN @ kept @ NO_TURN
    else:
        kept[2, :2] = kept[:2, 2] = 0.0
    increments = [
        increment._replace(covariance=covariance(kept))
        for increment in drawn(4000, COVARIANCE, 0.0)
    ]
    assert coverage(increments, truth_at(straight(4000))) < 93.0


def test_no_stride_is_aligned_with_itself() -> None:
    """One stride in ten veers by 6 sd of what was told, and the next comes back."""
    position_m = straight(100)
    position_m[9::10, 1] = 0.12
    told = walk(position_m, np.diag([4e-4, 4e-4, 1e-12]))
    assert coverage(told, truth_at(straight(100))) == pytest.approx(80.0, abs=1.0)


@pytest.mark.parametrize("share", [0.99, 1.01])
@pytest.mark.parametrize("measure", [coverage, whole_path_coverage])
def test_the_ellipse_ends_at_its_edge(
    share: float, measure: Callable[[list[Increment], Truth], float]
) -> None:
    """Every second stride is too long by as much as the share says, and the next too short."""
    position_m = straight(40)
    position_m[1::2, 0] += share * np.sqrt(5.991464547) * 0.03
    steady = walk(position_m, np.diag([0.03**2, 0.02**2, 1e-12]))
    assert measure(steady, truth_at(straight(40))) == (100.0 if share < 1.0 else 0.0)


def test_a_stance_missed_shares_the_covariance_by_time() -> None:
    joined = [
        Increment(
            round((stride + 0.2) * NS_PER_S),
            round((stride + 1.8) * NS_PER_S),
            (2.4, 0.0, 0.0),
            0.0,
            0.0,
            covariance(0.02 * NO_TURN),
            (),
        )
        for stride in range(0, 12, 2)
    ]
    for off_m, expected in ((0.20, 100.0), (0.30, 0.0)):
        astray_m = straight(12)
        astray_m[1::2, 0] += off_m  # Each stride may be off by √(5.99·0.01) = 0.245 m.
        assert coverage(joined, truth_at(astray_m)) == expected


def test_a_stride_told_without_covariance_is_outside() -> None:
    increments = walk(straight(8), COVARIANCE)
    truth = truth_at(np.vstack((straight(8), [[9 * 1.2, 0.0], [10 * 1.2, 0.0]])))
    assert coverage(increments, truth) == pytest.approx(100.0 * 7 / 9)  # the first is not judged
    assert whole_path_coverage(increments, truth) == pytest.approx(80.0)


def test_strides_between_two_true_stances_add_up() -> None:
    increments = walk(straight(12), 0.01 * NO_TURN)
    seen = truth_of_stances(np.arange(0.0, 13.0, 2.0), straight(12)[::2])
    for off_m, expected in ((0.34, 100.0), (0.36, 0.0)):
        bent_m = seen.position_m.copy()
        bent_m[1::2, 0] += off_m  # Each pair may be off by √(5.99·0.02) = 0.346 m.
        assert coverage(increments, truth_of_stances(seen.time_s, bent_m)) == expected


def test_without_a_direction_to_begin_with_nothing_is_covered() -> None:
    shuffled = 0.1 * straight(9)
    assert math.isnan(coverage(walk(shuffled, COVARIANCE), truth_at(shuffled)))
