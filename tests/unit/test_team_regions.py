"""The region that is told holds whom it is told of: on an arc live, held to an axis afterwards."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from command_post.confidence import inside95
from command_post.fusion.team.assembly import Noise
from command_post.fusion.team.estimates import bent_back
from command_post.fusion.team.graph import TURN_DOF
from command_post.fusion.team.move_log import Floats
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.sharpness import learnt_noise
from command_post.fusion.team.solving import solved_from
from command_post.fusion.team.team_tracker import TeamTracker
from tests.stride_world import stride, track_start
from tests.unit.test_team_axis import SQUARE, walked

WAY_M = 20.0
START_SD_M = 0.5


def gone_north(heading_sd_rad: float) -> TeamTracker:
    """Return the tracker of one who knows their heading so well and has gone north."""
    tracker = TeamTracker(TeamSettings())
    tracker.start("r1", track_start(0.0, heading_sd_rad=heading_sd_rad))
    for each in range(1, 21):
        tracker.move("r1", stride(float(each), 0.05 * WAY_M, 0.0, sequence=each))
    return tracker


@pytest.mark.parametrize("heading_sd_deg", [5.0, 15.0, 30.0])
def test_a_live_region_holds_ends_on_an_arc(heading_sd_deg: float) -> None:
    told = gone_north(math.radians(heading_sd_deg)).estimates["r1"]
    chance = np.random.default_rng(5)
    turn_rad = math.radians(heading_sd_deg) * chance.normal(size=2000)
    true_m = WAY_M * np.column_stack([np.cos(turn_rad), np.sin(turn_rad)])
    true_m += START_SD_M * chance.normal(size=true_m.shape)
    error_m = np.array([told.north_m, told.east_m]) - true_m
    inside = inside95(error_m, np.tile(told.covariance_m2, (len(error_m), 1)))
    assert 0.92 < inside.mean() < 0.999


def test_how_far_an_arc_bends_back_is_the_mean_square_that_it_is_said_to_be() -> None:
    for turn_rad in np.radians([1.0, 10.0, 20.0, 30.0, 45.0]):
        exact = (
            0.5 * (1.0 + math.exp(-2.0 * turn_rad**2)) - 2.0 * math.exp(-0.5 * turn_rad**2) + 1.0
        )
        assert bent_back(float(turn_rad**2)) == pytest.approx(exact, rel=0.03)


def test_of_who_passes_nothing_a_heading_is_as_unsure_as_turns_with_tails_are() -> None:
    found = walked(math.radians(2.0), 0.0, [(0.0, 0.0), (96.0, 0.0)])
    _, _, duration_s, _, sd_rad = found.assembled.graph.move.T
    drifted_rad = TeamSettings().drift_sd_rad_s * float(duration_s.sum())
    tails = TURN_DOF / (TURN_DOF - 2.0)
    turned_rad2 = math.radians(2.0) ** 2 + drifted_rad**2 + tails * float(sd_rad @ sd_rad)
    assert turned_rad2 < float(found.ends[0, 3]) < 1.6 * turned_rad2


def gone_about_a_square(axis_factor: float, *, axis: bool = True) -> TeamTracker:
    """Return the tracker of one who has gone twice about a square that lies along the axis.

    A mate stands by: of who is alone no axis is taken for granted.
    """
    tracker = TeamTracker(TeamSettings(axis=axis, given_axis_factor=axis_factor))
    tracker.start("mate", track_start(0.0, heading_sd_rad=math.pi))
    tracker.start("r1", track_start(0.0, heading_sd_rad=math.radians(2.0)))
    for each in range(1, 81):
        quarter = math.radians(90.0 * ((each - 1) // 10))
        step = stride(float(each), 1.2 * math.cos(quarter), 1.2 * math.sin(quarter), sequence=each)
        tracker.move("r1", step)
    return tracker


def test_afterwards_only_who_is_held_to_the_axis_given_is_told_surer() -> None:
    def spread_m2(axis_factor: float, *, axis: bool) -> Floats:
        told = gone_about_a_square(axis_factor, axis=axis).afterwards().tracks["r1"]
        return np.asarray(told.covariance_m2)

    np.testing.assert_allclose(spread_m2(0.5, axis=True), 0.5 * spread_m2(1.0, axis=True))
    np.testing.assert_array_equal(spread_m2(0.5, axis=False), spread_m2(1.0, axis=False))


def test_how_far_straight_moves_are_off_the_axis_is_learnt() -> None:
    found = walked(math.radians(2.0), 0.0, 4 * SQUARE, with_mate=True)
    bent = found.pose.copy()
    bent[:, 2] += math.radians(15.0) * np.random.default_rng(1).normal(size=len(bent))
    straight, crooked = (
        learnt_noise(found.assembled, pose, found.arrow, TeamSettings()).straights
        for pose in (found.pose, bent)
    )
    assert straight < 0.8
    assert crooked > 1.3


def test_how_far_straight_moves_are_off_the_axis_widens_headings_and_moves_nobody() -> None:
    found = walked(math.radians(2.0), 0.0, SQUARE, with_mate=True)
    settings, belief = TeamSettings(), found.belief
    assert belief.mode == "given"
    nearer, farther = (
        solved_from(
            replace(found.assembled, noise=Noise(straights=scale)).believing(belief, settings),
            found.pose.copy(), found.arrow.copy(), belief, settings, 5,
        )
        for scale in (0.5, 2.0)
    )  # fmt: skip
    np.testing.assert_array_equal(nearer.pose, farther.pose)
    assert nearer.ends[1, 3] < 0.8 * farther.ends[1, 3]
