"""When a building is held to have an axis, and that given to be it."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from command_post.fusion.team.axis import (
    cost_of_legs,
    first_of_corridor,
    legs,
    likely_axis,
    witnesses,
)
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import NOTHING
from command_post.fusion.team.solving import Solved, commit
from tests.stride_world import at_ns, stride, track_start

SD_RAD = math.radians(6.0)
SQUARE = [(0.0, 0.0), (12.0, 0.0), (12.0, 12.0), (0.0, 12.0), (0.0, 0.0), (12.0, 0.0)]


def walked(
    heading_sd_rad: float,
    askew_rad: float,
    corners: list[tuple[float, float]],
    planned_rad: float | None = None,
    team: int = 1,
    *,
    with_mate: bool = False,
) -> Solved:
    """Return the commit after a way past corners, turned by ``askew_rad``, of each of a team.

    A mate, of whose heading nothing is known, comes before them and has not moved yet.
    """
    log = TeamLog()
    if with_mate:
        log.add_start("mate", track_start(0.0, heading_sd_rad=math.pi))
    for each in range(team):
        responder_id = f"r{each}"
        log.add_start(responder_id, track_start(0.0, heading_sd_rad=heading_sd_rad))
        number = 0
        for (north_m, east_m), (to_north_m, to_east_m) in pairwise(corners):
            leg = complex(to_north_m - north_m, to_east_m - east_m) * np.exp(1j * askew_rad)
            for _ in range(round(abs(leg) / 1.2)):
                number += 1
                step = 1.2 * leg / abs(leg)
                moved = stride(2.0 + number, step.real, step.imag, sequence=number)
                log.add_move(responder_id, moved)
    found = commit(log, at_ns(3.0 + number), NOTHING, TeamSettings(planned_axis_rad=planned_rad))
    assert found is not None
    return found


def test_directions_are_alike_modulo_a_right_angle() -> None:
    about_rad = np.radians([20.0, 110.0, 22.0, -71.0, 200.0, 60.0])
    assert likely_axis(about_rad, SD_RAD) == pytest.approx(math.radians(20.0), abs=0.04)


def test_who_hardly_knows_their_heading_is_not_turned_to_the_axis_given() -> None:
    found = walked(math.radians(30.0), math.radians(20.0), SQUARE)
    assert found.belief.mode == "free"
    assert np.abs(found.pose[:, 2]).max() < math.radians(4.0)


def test_who_knows_their_heading_shows_that_the_axis_is_the_one_given() -> None:
    found = walked(math.radians(2.0), math.radians(3.0), SQUARE, with_mate=True)
    assert found.belief.mode == "given"
    assert found.pose[-1, 2] == pytest.approx(math.radians(-3.0), abs=math.radians(2.5))


def test_of_who_is_alone_at_an_incident_no_axis_is_taken_for_granted() -> None:
    found = walked(math.radians(2.0), math.radians(3.0), SQUARE)
    assert found.belief.mode == "free"
    assert np.abs(found.pose[:, 2]).max() < math.radians(1.0)


def test_who_knows_their_heading_shows_that_the_axis_is_another() -> None:
    assert walked(math.radians(2.0), math.radians(40.0), SQUARE).belief.mode == "free"


def test_a_round_way_shows_no_axis() -> None:
    around = np.radians(np.arange(0.0, 700.0, 12.0))
    ring = [(15.0 * math.sin(each), 15.0 - 15.0 * math.cos(each)) for each in around.tolist()]
    assert walked(math.radians(2.0), 0.0, ring).belief.mode == "none"


def test_a_few_moves_show_no_axis() -> None:
    assert walked(math.radians(2.0), 0.0, SQUARE[:2]).belief.mode == "none"


def test_a_plan_is_believed_where_headings_come_near_it() -> None:
    found = walked(math.radians(5.0), math.radians(40.0), SQUARE, math.radians(42.0))
    assert (found.belief.mode, found.belief.axis_rad) == ("given", math.radians(42.0))
    assert found.pose[-1, 2] == pytest.approx(math.radians(2.0), abs=math.radians(1.5))


def test_a_plan_of_another_house_is_not() -> None:
    found = walked(math.radians(5.0), math.radians(40.0), SQUARE, math.radians(20.0))
    assert found.belief.mode == "free"
    assert np.abs(found.pose[:, 2]).max() < math.radians(4.0)


def test_moves_one_after_another_in_one_direction_are_one_leg() -> None:
    node = np.array([0, 1, 2, 4, 5, 6])
    direction_rad = np.radians([178.0, -178.0, 176.0, 175.0, 90.0, 91.0])
    assert legs(node, direction_rad).tolist() == [0, 0, 0, 1, 2, 2]
    assert legs(node[:0], direction_rad[:0]).size == 0


def test_out_and_back_shows_no_axis() -> None:
    out_and_back = [SQUARE[0], SQUARE[1]] * 3
    found = walked(math.radians(5.0), math.radians(12.0), out_and_back)
    assert found.belief.mode == "none"
    assert np.abs(found.pose[:, 2]).max() < math.radians(1.0)


def test_all_of_a_team_on_one_way_are_one_witness_of_each_corridor() -> None:
    lone, team = (walked(math.radians(2.0), 0.0, SQUARE, team=size) for size in (1, 4))
    moves = len(lone.assembled.graph.straight)
    assert len(team.assembled.graph.straight) == 4 * moves
    told = [len(witnesses(each.assembled.graph, each.pose).straight) for each in (lone, team)]
    assert told[0] == told[1] == moves * 4 // 5


def test_who_walks_a_corridor_askew_again_and_again_says_nothing_against_its_axis() -> None:
    east_m = 24.0 * math.tan(math.radians(5.0))
    to_and_fro = [(30.0, 6.0 + east_m), (6.0, 6.0), (30.0, 6.0 - east_m), (6.0, 6.0)] * 6
    corners = [(0.0, 0.0), (0.0, 6.0), (6.0, 6.0), *to_and_fro, (6.0, 14.0), (-2.0, 14.0)]
    found = walked(math.radians(2.0), 0.0, corners, with_mate=True)
    assert found.belief.mode == "given"
    assert max(each.share for each in found.belief.rivals) < 0.4


def test_legs_in_one_strip_are_of_one_corridor() -> None:
    hall, back = [0.0, 0.0, 10.0, 0.0], [12.0, 1.0, 4.0, 0.2]
    beside, further, across = [0.0, 4.0, 10.0, 4.0], [20.0, 0.0, 30.0, 0.0], [5.0, -5.0, 5.0, 5.0]
    askew = [2.0, -1.0, 8.0, 1.0]
    table = np.array([hall, back, beside, further, across, askew, hall])
    first = first_of_corridor(table[:, :2].copy(), table[:, 2:].copy())
    assert first.tolist() == [0, 0, 2, 3, 4, 5, 0]


def test_a_few_ways_across_a_hall_show_no_axis() -> None:
    legs_m = 14.0 * np.exp(1j * np.radians([20.0, 155.0, 320.0, 95.0, 260.0]))
    corners = [(each.real, each.imag) for each in np.append(0.0, np.cumsum(legs_m)).tolist()]
    assert walked(math.radians(20.0), 0.0, corners).belief.mode == "none"


def plain_cost_of_legs(
    straight: np.ndarray, off_rad: np.ndarray, leg: np.ndarray, share: float
) -> tuple[float, float]:
    """Return the same by densities: along the axis, or anywhere and straight on from there."""

    def cauchy(off: np.ndarray) -> np.ndarray:
        return np.asarray(1.0 / (math.pi * SD_RAD * (1.0 + (off / SD_RAD) ** 2)))

    legs_cost = 0.0
    for number in range(leg[-1] + 1):
        own = leg == number
        along = np.prod(cauchy(off_rad[own]))
        bends_rad = np.angle(np.exp(1j * np.diff(straight[own, 0])))
        anywhere = 2.0 / math.pi * np.prod(cauchy(bends_rad))
        legs_cost -= 2.0 * math.log((share * along + (1.0 - share) * anywhere) / anywhere)
    return float(2.0 * np.log1p((off_rad / SD_RAD) ** 2).sum()), legs_cost


def test_legs_cost_what_their_densities_say() -> None:
    straight = np.column_stack([np.radians([178.0, -177.0, 175.0, 20.0, 24.0]), np.full(5, SD_RAD)])
    off_rad = np.radians([2.0, -3.0, 4.0, 40.0, 44.0])
    leg = np.array([0, 0, 0, 1, 1])
    assert cost_of_legs(straight, off_rad, leg, 0.8) == pytest.approx(
        plain_cost_of_legs(straight, off_rad, leg, 0.8)
    )


def test_a_long_leg_aside_of_an_axis_says_no_more_against_it_than_a_short_one_may() -> None:
    straight, off_rad = np.full((300, 2), SD_RAD), np.full(300, math.radians(45.0))
    most = -2.0 * math.log(0.2)
    _, of_legs = cost_of_legs(straight, off_rad, np.zeros(300, np.int64), 0.8)
    assert of_legs == pytest.approx(most)
    _, of_legs = cost_of_legs(straight[:0], off_rad[:0], np.zeros(0, np.int64), 0.8)
    assert of_legs == 0.0


def test_one_leg_along_shows_no_axis_to_who_may_head_anywhere() -> None:
    corners = [(0.0, 0.0), (12.0, 0.0), (12.0, 12.0)]
    assert walked(math.radians(30.0), math.radians(10.0), corners).belief.mode != "given"
