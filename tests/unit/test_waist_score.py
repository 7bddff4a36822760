"""The waist's score card: steps against landings, the way from where it began."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from edge_agent.evaluation.course_truth import StepCount, Waypoints, out_and_back
from edge_agent.evaluation.estimate import estimated_path
from edge_agent.evaluation.waist_score import score_waist, worst_m
from edge_agent.inertial.step_detection import Step
from edge_agent.mounts.interface import Increment
from edge_agent.mounts.step_increment import Direction, step_ahead
from edge_agent.sources.npz_set import read_npz_set


def walked(headings_rad: list[float], length_m: float = 1.0) -> list[Increment]:
    """Return steps a second long, the first ending at 1 s."""
    return [
        step_ahead(
            Step(index * 10**9, (index + 1) * 10**9, 0.0, 0.0),
            length_m,
            Direction(heading_rad, 0.0, 0.0),
        )
        for index, heading_rad in enumerate(headings_rad)
    ]


def counted(landed_s: list[float], distance_m: float | None = None) -> StepCount:
    return StepCount(np.array([0.0, *landed_s]), np.arange(len(landed_s) + 1.0), distance_m)


def test_steps_are_counted_and_each_is_held_against_a_landing() -> None:
    row = score_waist("t", "g", walked([0.0] * 5), counted([1.1, 2.0, 3.2, 4.9], 4.0))
    assert (row.steps_true, row.steps_found, row.steps_off) == (4, 5, 1.0)
    assert row.steps_exact_pct == 0.0
    assert row.distance_error_pct == pytest.approx(25.0)
    assert row.missed_stances_pct == 0.0
    assert row.false_stances_pct == pytest.approx(20.0)
    assert row.closure_2d_m == pytest.approx(5.0)


def test_a_count_may_be_exact_with_wrong_steps() -> None:
    row = score_waist("t", "g", walked([0.0] * 4), counted([1.0, 2.0, 3.0, 9.0]))
    assert row.steps_exact_pct == 100.0
    assert row.missed_stances_pct == pytest.approx(25.0)
    assert row.distance_error_pct is None


def test_no_steps_are_a_failure() -> None:
    assert score_waist("t", "g", [], counted([1.0])).failure == "no steps found"


@pytest.mark.parametrize("frame_rad", [0.0, 1.0, -2.5])
def test_the_worst_moment_is_told_from_where_the_way_began(frame_rad: float) -> None:
    out, back = [frame_rad] * 20, [frame_rad + math.pi] * 20
    path = estimated_path(walked(out + back, 1.05))
    time_s = np.arange(41.0)
    north_m = np.concatenate((np.arange(21.0), np.arange(19.0, -1.0, -1.0)))
    truth = Waypoints(time_s, np.column_stack((north_m, np.zeros(41))))
    assert worst_m(path, truth) == pytest.approx(1.0)
    near = Waypoints(time_s[:8], truth.position_m[:8])
    assert math.isnan(worst_m(path, near))


def test_flights_are_told_in_time_though_samples_are_lost(tmp_path: Path) -> None:
    time_s = np.delete(np.arange(1000) / 100.0, np.arange(100, 300))
    file = tmp_path / "waist.npz"
    left, right = np.array([[10, 50], [400, 450]]), np.array([[880, 950]])
    np.savez(
        file,
        t_s=time_s,
        acc_m_s2=np.tile([0.0, 0.0, -9.81], (800, 1)),
        gyr_rad_s=np.zeros((800, 3)),
        truth_left_steps=left,
        truth_right_steps=right,
    )
    truth = read_npz_set(file).truth
    assert isinstance(truth, StepCount)
    np.testing.assert_allclose(truth.time_s, [0.0, 0.5, 4.5, 9.5])
    assert truth.distance_m == 20.0


def test_steps_of_a_course_lead_out_and_back_until_the_wearer_has_arrived() -> None:
    truth = out_and_back(counted([1.0, 2.0, 3.0, 4.0, 9.0, 9.5], 20.0))
    assert truth is not None
    np.testing.assert_allclose(truth.position_m[:, 0], [0.0, 5.0, 10.0, 5.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(truth.position_m[:, 1], 0.0)
    assert out_and_back(counted([1.0, 2.0])) is None
