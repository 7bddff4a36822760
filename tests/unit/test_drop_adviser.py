"""A DAP is asked for where ways meet, after a long way without, and before the link breaks."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from shared.config import ConfigError, checked
from shared.drop_adviser import Advice, AdviserSettings, DropAdviser
from shared.messages import Activity
from shared.units import NS_PER_S

STRIDE_M = 1.2
STRIDE_NS = round(1.1 * NS_PER_S)


class _Walk:
    """Somebody who walks with an adviser, past one DAP at the origin if they hear it."""

    def __init__(self, boxes: int = 3, wall_db: float = 0.0, *, hears: bool = True) -> None:
        self.adviser = DropAdviser(boxes)
        self.advice: list[Advice] = []
        self.walked_m = 0.0
        self.said_at_m: list[float] = []
        self._place_m = [0.0, 0.0]
        self._heading_rad = 0.0
        self._now_ns = 0
        self._wall_db = wall_db
        self._hears = hears

    def go(
        self, length_m: float, turn_deg: float = 0.0, activity: Activity = "walk",
        climb_m: float = 0.0,
    ) -> None:  # fmt: skip
        self._heading_rad += math.radians(turn_deg)
        for _ in range(round(length_m / STRIDE_M)):
            north_m = STRIDE_M * math.cos(self._heading_rad)
            east_m = STRIDE_M * math.sin(self._heading_rad)
            self._place_m = [self._place_m[0] + north_m, self._place_m[1] + east_m]
            self._now_ns += STRIDE_NS
            self.walked_m += STRIDE_M
            if self._hears:
                range_m = max(math.hypot(*self._place_m), 1.0)
                level_dbm = -40.0 - 22.0 * math.log10(range_m) - self._wall_db * (range_m > 5.0)
                for back in range(4):
                    self.adviser.hear(self._now_ns - back * 200_000_000, "dap1", level_dbm)
            told = self.adviser.move(self._now_ns, (north_m, east_m, -climb_m), activity)
            if told is not None:
                self.advice.append(told)
                self.said_at_m.append(self.walked_m)


def test_a_junction_far_enough_from_the_last_dap_is_the_place() -> None:
    walk = _Walk()
    walk.go(10.8)
    assert walk.advice == []
    walk.go(6.0, turn_deg=90.0)
    (advice,) = walk.advice
    assert "at a junction" in advice.reason
    assert 0.6 <= advice.urgency <= 1.0
    assert walk.said_at_m[0] < 10.8 + 3.0


def test_nothing_is_asked_for_while_a_dap_is_near() -> None:
    walk = _Walk()
    walk.go(4.8)
    walk.go(4.8, turn_deg=90.0)
    assert walk.advice == []


def test_a_link_that_breaks_is_a_reason_on_a_straight_way_too_and_walls_are_guessed() -> None:
    clear, walled = _Walk(), _Walk(wall_db=32.0)
    clear.go(10.0)
    walled.go(10.0)
    assert clear.advice == []
    assert "link at" in walled.advice[0].reason
    assert "walls or more" in walled.advice[0].reason


def test_without_any_radio_the_metres_and_the_turns_tell() -> None:
    walk = _Walk(hears=False)
    walk.go(8.4)
    walk.go(6.0, turn_deg=-80.0)
    (advice,) = walk.advice
    assert "m since the last DAP" in advice.reason


def test_stairs_are_a_place_at_their_ends_and_not_between() -> None:
    walk = _Walk(hears=False)
    walk.go(8.4)
    walk.go(6.0, activity="stairs_up", climb_m=0.7)
    assert walk.advice == []
    walk.go(3.0)
    assert "at the stairs" in walk.advice[0].reason


def test_who_searches_a_room_is_not_told_at_every_corner() -> None:
    walk = _Walk(hears=False)
    walk.go(12.0)
    walk.adviser.set_down()
    for _ in range(3):
        walk.go(8.4, turn_deg=90.0)
        walk.go(4.8, turn_deg=90.0)
    assert len(walk.advice) <= 2


def test_a_side_way_with_many_turns_wants_fewer_than_one_straight_on() -> None:
    straight, bent = _Walk(boxes=9, hears=False), _Walk(boxes=9, hears=False)
    for turn_deg in (0.0, 90.0, 90.0, -90.0, 90.0, 90.0):
        straight.go(14.4)
        bent.go(14.4, turn_deg=turn_deg)
    assert 0 < len(bent.advice) < len(straight.advice)


def test_another_storey_is_come_into_anew() -> None:
    walk = _Walk(boxes=9, hears=False)
    for turn_deg in (0.0, 90.0, 90.0):
        walk.go(9.6, turn_deg=turn_deg)
    walk.go(6.0, turn_deg=-90.0, activity="stairs_up", climb_m=0.7)
    said = len(walk.advice)
    walk.go(9.6, turn_deg=-90.0)
    assert walk.advice[said].reason.startswith("at the stairs")


def test_advice_is_not_said_twice_of_one_place_and_never_without_boxes() -> None:
    walk = _Walk(hears=False)
    walk.go(9.6)
    walk.go(1.2, turn_deg=60.0)
    walk.go(1.2, turn_deg=-60.0)
    walk.go(1.2, turn_deg=60.0)
    assert len(walk.advice) == 1
    empty = _Walk(boxes=0, wall_db=40.0)
    empty.go(40.0)
    empty.go(10.0, turn_deg=90.0)
    assert empty.advice == []


def test_who_has_set_one_down_is_not_asked_for_the_next_at_once() -> None:
    walk = _Walk(hears=False)
    walk.go(9.6)
    walk.go(1.2, turn_deg=90.0)
    walk.adviser.set_down()
    assert walk.adviser.boxes == 2
    walk.go(4.8)
    walk.go(1.2, turn_deg=90.0)
    assert len(walk.advice) == 1


def test_the_later_it_is_the_farther_apart_they_stand() -> None:
    walk = _Walk(hears=False)
    for _ in range(70):
        said = len(walk.advice)
        walk.go(1.2)
        if len(walk.advice) > said:
            walk.adviser.set_down()
    apart_m = [after - before for before, after in pairwise([0.0, *walk.said_at_m])]
    assert len(apart_m) == 3
    assert apart_m[0] == pytest.approx(10.8, abs=1.3)
    assert apart_m == sorted(apart_m)
    assert apart_m[-1] > 1.2 * apart_m[0]


@pytest.mark.parametrize("changes", [{"drop_at": 0.7}, {"weak_dbm": -90.0}])
def test_thresholds_the_wrong_way_round_are_refused(changes: dict[str, float]) -> None:
    with pytest.raises((ValueError, ConfigError)):
        checked(AdviserSettings(**changes))
