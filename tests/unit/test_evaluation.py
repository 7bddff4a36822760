"""The score of a path whose errors are known beforehand."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from edge_agent.evaluation.errors import (
    absolute_error_m,
    align,
    closure,
    end_error_m,
    missed_stances_pct,
    stance_errors,
)
from edge_agent.evaluation.estimate import EstimatedPath, estimated_path
from edge_agent.evaluation.measured_path import truth_of_path
from edge_agent.evaluation.score_card import score_card, score_trial, set_of
from edge_agent.evaluation.truth import (
    Array,
    Height,
    Speed,
    Truth,
    truth_of_stances,
)
from edge_agent.evaluation.vertical import VerticalErrors, vertical_errors
from edge_agent.inertial.linear_zupt import PathPoint
from edge_agent.mounts.interface import Increment
from shared.maths.statistics import Summary
from shared.units import NS_PER_S

STRIDE_S, SWING_S, LATE_S = 1.0, 0.6, 0.2
"""Stances are at full seconds; the swing begins ``LATE_S`` after, and ends as long before."""


def places(count: int = 21) -> Array:
    """An L-shaped walk with rising steps: (count, 3) NED."""
    step = np.where(np.arange(count)[:, None] < count // 2, [1.2, 0.0, 0.0], [0.0, 1.1, -0.1])
    return np.vstack(([0.0, 0.0, 0.0], np.cumsum(step, axis=0)[:-1]))


def truth(position_m: Array | None = None) -> Truth:
    position_m = places() if position_m is None else position_m
    return truth_of_stances(STRIDE_S * np.arange(len(position_m), dtype=np.float64), position_m)


def vector(array: Array) -> tuple[float, float, float]:
    north, east, down = array.tolist()
    return north, east, down


def walk(position_m: Array) -> list[Increment]:
    """Increments through ``position_m``, a stride each."""
    increments = []
    for stride, (start, end) in enumerate(itertools.pairwise(position_m)):
        start_ns = round((stride * STRIDE_S + LATE_S) * NS_PER_S)
        end_ns = start_ns + round(SWING_S * NS_PER_S)
        path = tuple(
            PathPoint(round(start_ns + share * (end_ns - start_ns)), *(share * (end - start)))
            for share in (0.0, 0.5, 1.0)
        )
        increments.append(
            Increment(start_ns, end_ns, vector(end - start), 0.0, 0.0, (0.0,) * 10, path)
        )
    return increments


def scored(change: Callable[[Array], Array], position_m: Array | None = None) -> dict[str, float]:
    position_m = places() if position_m is None else position_m
    return stance_errors(estimated_path(walk(change(position_m))), truth(position_m))._asdict()


def turned(position_m: Array, angle_rad: float) -> Array:
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    north_m, east_m, down_m = position_m.T
    return np.column_stack(
        (cosine * north_m - sine * east_m, sine * north_m + cosine * east_m, down_m)
    )


def test_the_true_path_has_no_error() -> None:
    assert scored(lambda p: p) == pytest.approx(dict.fromkeys(scored(lambda p: p), 0.0), abs=1e-7)


@pytest.mark.parametrize("angle_rad", [0.3, -2.0, math.pi])
def test_a_path_turned_and_moved_has_no_error(angle_rad: float) -> None:
    errors = scored(lambda p: np.add(turned(p, angle_rad), [7.0, -3.0, 2.0]))
    assert errors == pytest.approx(dict.fromkeys(errors, 0.0), abs=1e-7)


@pytest.mark.parametrize("scale", [0.9, 1.05])
def test_a_path_scaled_has_the_error_of_scale(scale: float) -> None:
    errors = scored(lambda p: turned(scale * p, 1.0))
    assert errors["distance_error_pct"] == pytest.approx(100.0 * (scale - 1.0))
    expected_m = abs(scale - 1.0) * np.sqrt(np.mean(truth().stride_lengths_m ** 2))
    assert errors["stride_rmse_m"] == pytest.approx(expected_m)
    across_m = np.linalg.norm(places()[-1, :2])
    expected = 100.0 * abs(scale - 1.0) * across_m / truth().length_m
    assert errors["end_error_pct"] == pytest.approx(expected)
    assert errors["heading_drift_deg_min"] == pytest.approx(0.0, abs=1e-6)


def test_a_mirrored_path_is_not_taken_for_the_true_one() -> None:
    assert scored(lambda p: p * [1.0, -1.0, 1.0])["ate_pct"] > 5.0


def test_a_path_that_veers_drifts_by_that_much() -> None:
    straight = np.outer(np.arange(31.0), [1.2, 0.0, 0.0])

    def veering(position_m: Array) -> Array:
        heading_rad = np.radians(0.5) * np.arange(1, len(position_m))
        step = 1.2 * np.column_stack((np.cos(heading_rad), np.sin(heading_rad), 0 * heading_rad))
        return np.vstack((np.zeros(3), np.cumsum(step, axis=0)))

    errors = scored(veering, straight)
    assert errors["heading_drift_deg_min"] == pytest.approx(30.0)
    assert errors["distance_error_pct"] == pytest.approx(0.0, abs=1e-9)


def test_a_missed_stance_is_told() -> None:
    increments = walk(places())
    first, second = increments[4], increments[5]
    joined = first._replace(
        end_time_ns=second.end_time_ns,
        displacement_m=vector(places()[6] - places()[4]),
        path=(),
    )
    path = estimated_path([*increments[:4], joined, *increments[6:]])
    errors = stance_errors(path, truth())
    assert errors.missed_stances_pct == pytest.approx(100.0 / 21.0)
    assert errors.false_stances_pct == 0.0


@pytest.mark.parametrize(("early_s", "missed"), [(0.15, 0.0), (0.35, 0.0), (0.45, 90.4761904)])
def test_one_instant_of_a_long_stance_is_enough(early_s: float, missed: float) -> None:
    """Boots stand 0.8 s about the full seconds, and an instant ``early_s`` before those is told.

    At 0.45 s the boot still swings, at half of the way: only first and last stance are found.
    """
    knots_s, knots_m = [0.0], [places()[0]]
    for stride in range(20):
        knots_s += [stride + 0.4, stride + 0.6]
        knots_m += [places()[stride], places()[stride + 1]]
    instants_s = np.arange(1.0, 20.0) - early_s
    path = EstimatedPath(
        np.array([*knots_s, 20.0]),
        np.array([*knots_m, places()[20]]),
        np.vstack(
            ([[-math.inf, 0.2]], np.column_stack((instants_s, instants_s)), [[19.8, math.inf]])
        ),
    )
    assert missed_stances_pct(path, truth()) == pytest.approx(missed)


def cut_in_swing() -> EstimatedPath:
    """The walk with a stance told for 20 ms in the middle of a swing, at 7.5 s."""
    increments = walk(places())
    whole = increments[7]
    half = vector(0.5 * (places()[8] - places()[7]))
    middle_ns = (whole.start_time_ns + whole.end_time_ns) // 2
    cut = [
        whole._replace(end_time_ns=middle_ns - 10**7, displacement_m=half, path=whole.path[:1]),
        whole._replace(start_time_ns=middle_ns + 10**7, displacement_m=half, path=whole.path[:1]),
    ]
    return estimated_path([*increments[:7], *cut, *increments[8:]])


def test_a_stance_in_a_swing_is_false() -> None:
    errors = stance_errors(cut_in_swing(), truth())
    assert errors.false_stances_pct == pytest.approx(5.0)
    assert errors.missed_stances_pct == 0.0


def test_a_stance_that_flickers_while_the_boot_stands_is_not_false() -> None:
    increments = walk(places())
    before = increments[7]
    stir = before._replace(
        start_time_ns=before.start_time_ns - 3 * 10**8,
        end_time_ns=before.start_time_ns - 2 * 10**8,
        displacement_m=(0.0, 0.0, 0.0),
        path=before.path[:1],
    )
    errors = stance_errors(estimated_path([*increments[:7], stir, *increments[7:]]), truth())
    assert errors.false_stances_pct == 0.0


def test_being_lost_twice_running_is_no_stance() -> None:
    lost = Increment(0, 10 * NS_PER_S, (0.0, 0.0, 0.0), 0.0, 0.0, (0.0,) * 10, ())
    again = lost._replace(start_time_ns=10 * NS_PER_S, end_time_ns=20 * NS_PER_S)
    path = estimated_path([lost, again])
    assert path.stances_s.tolist() == [[-math.inf, 0.0], [20.0, math.inf]]


def test_the_end_error_aligns_on_the_first_strides_only() -> None:
    true_m = np.outer(np.arange(41.0), [1.0, 0.0])
    bent_m = true_m.copy()
    bent_m[20:, 1] = np.arange(21.0)
    bent_m[20:, 0] = bent_m[19, 0] + 1.0
    assert end_error_m(bent_m, true_m) == pytest.approx(math.hypot(20.0, 20.0))
    assert absolute_error_m(bent_m, true_m) < 10.0


def test_alignment_is_a_rotation() -> None:
    points = np.random.default_rng(3).normal(size=(9, 2))
    rotation, _ = align(points, points * [1.0, -1.0])
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_too_few_strides_are_no_score() -> None:
    with pytest.raises(ValueError, match="4 true strides"):
        scored(lambda p: p, places(5))


def stepping(position_m: Array) -> Truth:
    """The truth of ``walk``, whose height changes while the boot swings."""
    start_s = STRIDE_S * np.arange(len(position_m) - 1.0) + LATE_S
    down_m = position_m[:, 2]
    times_s = np.append(np.column_stack((start_s, start_s + SWING_S)), start_s[-1] + STRIDE_S)
    heights = np.append(np.column_stack((down_m[:-1], down_m[1:])), down_m[-1])
    return replace(truth(position_m), height=Height(times_s, heights))


def with_height_sd(increment: Increment, sd_m: float) -> Increment:
    return increment._replace(covariance=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, sd_m**2, 0.0, 0.0))


def height_errors(increments: list[Increment], true: Truth) -> VerticalErrors | None:
    return vertical_errors(increments, estimated_path(increments), true)


def test_height_is_scored_where_it_is_known() -> None:
    sunk = places() * [1.0, 1.0, 2.0]
    errors = height_errors(walk(sunk), truth())
    assert errors is not None
    assert errors.vertical_end_error_m == pytest.approx(places()[-1, 2])
    assert errors.distance_3d_error_pct > 0.0
    flat = truth_of_stances(np.arange(21.0), places()[:, :2])
    assert height_errors(walk(sunk), flat) is None


def test_each_increment_is_held_to_the_height_that_it_told() -> None:
    """Of twenty strides, the ten that rise are told too low by 0.04 m; every other knows it."""
    told = walk(places() * [1.0, 1.0, 0.6])
    sds_m = (0.02, 0.021)
    told = [with_height_sd(one, sds_m[k % 2]) for k, one in enumerate(told)]
    errors = height_errors(told, stepping(places()))
    assert errors is not None
    assert errors.vertical_increment_rmse_m == pytest.approx(0.04 * math.sqrt(0.5))
    assert errors.vertical_coverage95_pct == 75.0
    assert math.isnan(errors.floor_rmse_m)


def test_what_rose_unsaid_is_an_error_of_the_next_increment() -> None:
    """Standing in a lift up 3 m before the fifth stride, which neither tells nor knows of it."""
    lifted = places(11)
    lifted[5:, 2] -= 3.0
    told = [with_height_sd(one, 0.01) for one in walk(places(11))]
    errors = height_errors(told, stepping(lifted))
    assert errors is not None
    assert errors.vertical_coverage95_pct == 90.0
    assert errors.floor_rmse_m == pytest.approx(3.0)


def test_climbs_are_told_from_floor_to_floor() -> None:
    """Up five steps, along, down five steps; told 10 % too high."""
    rises_m = [0.0] * 3 + [-0.4] * 5 + [0.0] * 3 + [0.4] * 5 + [0.0] * 3
    position_m = np.column_stack((np.arange(20.0), np.zeros(20), np.cumsum([0.0, *rises_m])))
    errors = height_errors(walk(position_m * [1.0, 1.0, 1.1]), truth(position_m))
    assert errors is not None
    assert errors.floor_rmse_m == pytest.approx(0.2)


def test_a_loop_closes() -> None:
    loop = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0], [0.0, 0.3, -0.4]])
    found = closure(estimated_path(walk(loop)))
    assert found == pytest.approx((0.3, 0.5, 3.0 + 4.0 + math.hypot(3.0, 3.7)))


def still_path(stops_s: list[tuple[float, float]], rate_hz: float = 100.0) -> tuple[Array, Array]:
    """A path along x that moves at 1 m/s but for the stops, z up by 0.1 m."""
    time_s = np.arange(0.0, 10.0, 1.0 / rate_hz)
    moving = ~np.any([(a <= time_s) & (time_s < b) for a, b in stops_s], axis=0)
    north_m = np.cumsum(moving) / rate_hz
    return time_s, np.column_stack((north_m, 0 * north_m, 0 * north_m - 0.1))


@pytest.mark.parametrize("rate_hz", [100.0, 200.0])
def test_stances_of_a_measured_path_are_its_stops(rate_hz: float) -> None:
    found = truth_of_path(*still_path([(1.0, 2.0), (4.0, 4.5), (8.0, 8.03)], rate_hz))
    assert found.time_s == pytest.approx([1.5, 4.25], abs=0.03)
    assert found.position_m[:, 0] == pytest.approx([1.0, 3.0], abs=0.02)


@pytest.mark.parametrize("leaps", ["out of it", "into it"])
def test_a_position_held_while_the_boot_moves_is_no_stance(leaps: str) -> None:
    """Motion capture loses the boot in full swing for 0.4 s."""
    time_s, position_m = still_path([(1.0, 2.0), (8.0, 9.0)])
    position_m[500:541] = position_m[500 if leaps == "out of it" else 540]
    found = truth_of_path(time_s, position_m)
    assert found.time_s == pytest.approx([1.5, 8.5], abs=0.03)
    assert found.height is not None
    assert found.speed is not None
    assert np.isnan(found.speed.speed_m_s[505:535]).all()
    assert np.count_nonzero(np.isnan(found.speed.speed_m_s)) <= 41
    assert found.speed.speed_m_s[450:490] == pytest.approx(1.0)


def test_a_stance_in_a_swing_is_false_only_where_the_boot_is_seen_to_move() -> None:
    path, time_s = cut_in_swing(), np.arange(0.0, 20.0, 0.01)
    for lasting_s, speed_m_s, expected in (
        (0.02, 0.2, 0.0),  # it all but stops
        (0.02, 0.4, 5.0),
        (0.02, math.nan, 5.0),  # unseen for so short, it moves before and after
        (0.10, math.nan, 0.0),
    ):
        then = abs(time_s - 7.5) < lasting_s
        seen = Speed(time_s, np.where(then, speed_m_s, 2.0))
        found = stance_errors(path, replace(truth(), speed=seen))
        assert found.false_stances_pct == pytest.approx(expected)


def test_a_shuffle_on_the_spot_is_one_stance() -> None:
    found = truth_of_path(*still_path([(1.0, 2.0), (2.08, 3.0)]))
    assert len(found.time_s) == 1


SETS = {
    "foot_vicon/in_place": ("foot_vicon", 0.5, 5.9),
    "foot_vicon/slow": ("foot_vicon", 0.49, 20.0),
    "foot_vicon/walk": ("foot_vicon", 0.5, 20.0),
    "foot_vicon/run": ("foot_vicon", 1.51, 20.0),
    "foot_strides/walk": ("foot_strides", 1.29, 5.0),
    "foot_strides/fast": ("foot_strides", 1.31, 20.0),
    "foot_strides/run": ("foot_strides", 1.91, 20.0),
    "foot_mocap": ("foot_mocap", 0.1, 1.0),
}


@pytest.mark.parametrize("name", SETS)
def test_sets_go_by_mean_speed(name: str) -> None:
    group, speed_m_s, length_m = SETS[name]
    position_m = np.outer(np.linspace(0.0, length_m, 8), [1.0, 0.0])
    time_s = np.linspace(3.0, 3.0 + length_m / speed_m_s, 8)
    assert set_of(group, truth_of_stances(time_s, position_m)) == name


def test_without_truth_the_set_is_the_group() -> None:
    assert set_of("foot_strides", None) == "foot_strides"


def test_a_card_sums_up_magnitudes_and_counts_failures() -> None:
    long, short = (score_trial(n, "walks", walk(s * places()), truth()) for n, s in
                   (("long", 1.02), ("short", 0.96)))  # fmt: skip
    nothing = score_trial("nothing", "walks", [], truth())
    few = score_trial("few", "walks", walk(places(4)), truth(places(4)))
    card = score_card([long, short, nothing, few])
    assert long.distance_error_pct == pytest.approx(2.0)
    assert short.distance_error_pct == pytest.approx(-4.0)
    assert nothing.failure == "no strides found"
    assert few.failure is not None
    walks = card.sets["walks"]
    assert (walks["n"], walks["failed"]) == (4, 2)
    assert walks["distance_error_pct"] == pytest.approx(Summary(3.0, 3.0, 3.8))


def test_on_the_spot_only_height_is_scored() -> None:
    shuffle = places(9) * 0.1
    row = score_trial("shuffle", "foot_vicon", walk(shuffle), truth(shuffle))
    assert row.set == "foot_vicon/in_place"
    assert row.vertical_end_error_m == pytest.approx(0.0)
    assert (row.distance_error_pct, row.distance_3d_error_pct) == (None, None)


def test_without_truth_a_trial_is_scored_by_its_closure() -> None:
    row = score_trial("loop", "loops", walk(places()), None)
    assert row.closure_2d_m == pytest.approx(np.linalg.norm(places()[-1, :2]))
    assert row.length_m == pytest.approx(truth().length_m)


def test_positions_between_knots_are_on_the_way() -> None:
    path = EstimatedPath(
        np.array([0.0, 1.0]), np.array([[0.0, 0, 0], [2, 4, -6]]), np.empty((0, 2))
    )
    np.testing.assert_allclose(
        path.at(np.array([-5.0, 0.5, 9.0])), [[0, 0, 0], [1, 2, -3], [2, 4, -6]]
    )
