"""All may pass a known DAP aside of it: many passes say little more than a few, and it stands."""

from __future__ import annotations

import math

import pytest

from command_post.fusion.team.assembly import NO_AXIS
from command_post.fusion.team.dap_places import daps_of, places_of
from command_post.fusion.team.height_assembly import Heights, solve_heights
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import NOTHING
from command_post.fusion.team.solving import Solved, solve
from shared.units import NS_PER_S
from tests.stride_world import at_ns, installation, stride, track_start
from tests.unit.test_team_tracker import peak_at

SETTINGS = TeamSettings(axis=False)
STRIDE_M = 1.2
TO_AND_FRO = 16
ASIDE_M = 0.8
PLACE_M = (0.5 * TO_AND_FRO * STRIDE_M, ASIDE_M)


def passed_often(passes: int, *, known: bool = True) -> tuple[TeamLog, Solved, Heights]:
    """Solve the way of one who goes to and fro, and often passes a DAP in the middle, aside of it.

    There they stop. It is known to stand ``ASIDE_M`` east of that way, or they set it down.
    """
    log = TeamLog()
    log.add_start("r1", track_start(0.0, heading_sd_rad=0.01))
    log.add_dap("dap1", installation(1.0, None if known else "r1", PLACE_M if known else None))
    strides = passes * TO_AND_FRO - TO_AND_FRO // 2
    for k in range(strides):
        way_m = STRIDE_M if k // TO_AND_FRO % 2 == 0 else -STRIDE_M
        log.add_move("r1", stride(2.0 + k, way_m, 0.0, sequence=k))
        if k % TO_AND_FRO == TO_AND_FRO // 2 - 1:
            log.add_peak("dap1", peak_at(2.0 + k, "r1"))
    until_ns = at_ns(3.0 + strides)
    solved = solve(log, until_ns, NOTHING, NO_AXIS, SETTINGS, 20)
    assert solved is not None
    return log, solved, solve_heights(log, solved.assembled, until_ns, SETTINGS)


@pytest.mark.parametrize("passes", [4, 40])
def test_many_passes_of_one_dap_are_not_surer_than_how_far_aside_they_may_lie(passes: int) -> None:
    _, solved, _ = passed_often(passes)
    nn, _, ee, *_ = solved.ends[0].tolist()
    aside_m2 = float(solved.assembled.aside_m2[0])
    aside_m = SETTINGS.aside_share * SETTINGS.sharpness.sd_at_m(-40.0)
    assert aside_m2 == pytest.approx(aside_m * aside_m)
    assert 0.8 * aside_m2 < min(nn, ee)


def test_a_known_dap_stays_where_it_is_known_to_stand() -> None:
    log, solved, heights = passed_often(10)
    shown = daps_of(log, solved, heights)["dap1"].position
    passed_m = solved.arrow[solved.assembled.place_column(0) :]
    off_m = math.hypot(shown.north_m - PLACE_M[0], shown.east_m - PLACE_M[1])
    passed_off_m = math.hypot(passed_m[0] - PLACE_M[0], passed_m[1] - PLACE_M[1])
    assert passed_off_m > 0.05
    assert off_m < 0.3 * passed_off_m
    assert shown.covariance_m2[2] < float(solved.shared[-1, -1])


@pytest.mark.parametrize("known", [True, False])
def test_what_was_found_by_passes_is_where_it_is_passed(known: bool) -> None:
    _, solved, heights = passed_often(10, known=known)
    (told,) = places_of(solved, heights, {"dap1"})["dap1"]
    assert told.found != known
    assert (float(solved.assembled.aside_m2[0]) > 0.0) == known


def test_a_dap_that_a_clock_put_right_sets_down_before_1970_is_shown() -> None:
    log, _, _ = passed_often(2)
    log.daps["dap1"] = [each._replace(time_ns=-2 * NS_PER_S) for each in log.daps["dap1"]]
    until_ns = at_ns(100.0)
    solved = solve(log, until_ns, NOTHING, NO_AXIS, SETTINGS, 20)
    assert solved is not None
    heights = solve_heights(log, solved.assembled, until_ns, SETTINGS)
    assert daps_of(log, solved, heights)["dap1"].installed_ns == -2 * NS_PER_S
