"""A map held to an axis may lie otherwise: by right angles, or along no axis; what is told then."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from command_post.fusion.team.assembly import NO_AXIS, Rival
from command_post.fusion.team.quarters import (
    LEAST_SHARE,
    with_likeliest_quarter,
    with_other_ways,
)
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solving import Solved, solved_from
from command_post.fusion.team.whole_turns import turned_as_one
from tests.unit.test_team_axis import SQUARE, walked

SETTINGS = TeamSettings()


def told(heading_sd_deg: float, askew_deg: float, team: int = 1) -> Solved:
    """Return the ways of who walked a square so far askew, knowing their heading so well."""
    heading_sd_rad, askew_rad = math.radians(heading_sd_deg), math.radians(askew_deg)
    found = walked(heading_sd_rad, askew_rad, SQUARE, team=team, with_mate=team == 1)
    return with_other_ways(found, SETTINGS, 5)


def share_of(found: Solved, mode: str) -> float:
    """Return how likely a belief is beside that of a solution."""
    (share,) = [each.share for each in found.belief.rivals if each.mode == mode]
    return share


def turned_deg(ways: Sequence[tuple[float, Solved]]) -> list[float]:
    """Return how far each way's end is turned."""
    return [math.degrees(way.pose[-1, 2]) for _, way in ways]


def test_who_goes_far_off_the_axis_may_go_square_to_it() -> None:
    found = told(20.0, 33.0)
    ((chains, ways),) = found.turns
    turned_rad = np.array([way.pose[-1, 2] for _, way in ways])
    square = int(np.abs(turned_rad - math.radians(57.0)).argmin())
    assert chains == (1,)
    assert turned_rad[0] == pytest.approx(math.radians(-33.0), abs=0.05)
    assert turned_rad[square] == pytest.approx(math.radians(57.0), abs=0.05)
    (free,) = [degrees for degrees, (_, way) in zip(turned_deg(ways), ways, strict=True)
               if way.belief.mode == "free"]  # fmt: skip
    assert free == pytest.approx(0.0, abs=2.0)
    less_likely = math.exp(-0.5 * (57.0**2 - 33.0**2) / 20.0**2)
    assert ways[square][0] / ways[0][0] == pytest.approx(less_likely, rel=0.2)
    assert sum(share for share, _ in ways) == pytest.approx(1.0)
    assert np.array_equal(ways[0][1].pose, found.pose)
    assert found.ends[1, 3] > 10.0 * ways[0][1].ends[1, 3]


def test_who_knows_their_heading_may_not() -> None:
    found = told(2.0, 0.0)
    turned_rad = [way.pose[-1, 2] for turns in found.turns for _, way in turns.ways]
    assert np.abs([*turned_rad, found.pose[-1, 2]]).max() < 0.1


def test_an_axis_is_believed_in_with_as_much_doubt_as_legs_leave() -> None:
    few, many = (
        walked(math.radians(2.0), 0.0, corners, with_mate=True)
        for corners in (SQUARE[:3], 3 * SQUARE)
    )
    doubts = [share_of(found, "none") for found in (few, many)]
    assert 0.5 > doubts[0] > 10.0 * doubts[1] > 0.0


def rival(of: Solved, share: float) -> Rival:
    return Rival(of.belief.mode, of.belief.axis_rad, of.belief.sd_rad, share)


def test_who_is_held_to_no_axis_may_be_where_that_given_has_them() -> None:
    given = walked(math.radians(2.0), 0.0, SQUARE, with_mate=True)
    askew = walked(math.radians(2.0), math.radians(8.0), SQUARE, with_mate=True)
    unheld = askew._replace(
        assembled=askew.assembled.believing(NO_AXIS, SETTINGS),
        belief=NO_AXIS._replace(units=askew.belief.units, rivals=(rival(given, 0.05),)),
    )
    unheld = solved_from(unheld.assembled, unheld.pose, unheld.arrow, unheld.belief, SETTINGS, 12)
    ((_, ways),) = with_other_ways(unheld, SETTINGS, 5).turns
    assert [share for share, _ in ways] == pytest.approx([0.95, 0.05])
    assert ways[0][1] is unheld
    turned_rad = [float(way.pose[-1, 2]) for _, way in ways]
    assert abs(turned_rad[0]) < 0.03 < -0.05 - turned_rad[1]
    unlikely = unheld._replace(belief=unheld.belief._replace(rivals=(rival(given, 0.02),)))
    assert with_other_ways(unlikely, SETTINGS, 5) is unlikely


def test_a_map_that_was_turned_by_a_right_angle_is_turned_back_as_a_whole() -> None:
    found = walked(math.radians(20.0), 0.0, SQUARE, with_mate=True)
    pose, arrow = turned_as_one(found, (1,), 1, math.pi / 2.0)
    wrong = solved_from(found.assembled, pose, arrow, found.belief, SETTINGS, 12)
    assert wrong.pose[-1, 2] == pytest.approx(math.pi / 2.0, abs=0.1)
    back = with_likeliest_quarter(wrong, SETTINGS)
    assert back.pose[-1, 2] == pytest.approx(found.pose[-1, 2], abs=0.01)
    assert with_likeliest_quarter(found, SETTINGS) is found


def test_who_are_tied_to_nobody_are_each_told_along_the_axis_and_as_they_may_lie_besides() -> None:
    found = told(30.0, 10.0, team=2)
    assert found.belief.mode == "given"
    assert [chains for chains, _ in found.turns] == [(0,), (1,)]
    for (chain,), ways in found.turns:
        end = int(found.assembled.graph.first[chain + 1]) - 1
        turned = [math.degrees(way.pose[end, 2]) for _, way in ways]
        assert turned[0] == pytest.approx(-10.0, abs=3.0)
        assert min(abs(each) for each in turned) < 4.0


def test_of_a_map_that_lies_as_headings_have_it_the_axis_given_is_told_as_well() -> None:
    found = told(15.0, 36.0)
    assert found.belief.mode == "free"
    ((_, ways),) = found.turns
    assert turned_deg(ways)[0] == pytest.approx(0.0, abs=3.0)
    given = [share for share, way in ways if way.belief.mode == "given"]
    assert 0.5 > sum(given) > LEAST_SHARE
