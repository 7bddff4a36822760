"""Ways along what was walked: the quickest, over stairs, and never through what was not."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from command_post.ways import CRAWL_M_S, WALK_M_S, Point, WalkedGround

STRIDE_M = 1.2


def walk(ground: WalkedGround, responder_id: str, corners_m: list[Point]) -> None:
    place_m = corners_m[0]
    ground.walk(responder_id, 0.0, place_m)
    for corner_m in corners_m[1:]:
        count = math.ceil(math.dist(place_m, corner_m) / STRIDE_M)
        for step in range(1, count + 1):
            share = step / count
            at = [a + share * (b - a) for a, b in zip(place_m, corner_m, strict=True)]
            ground.walk(responder_id, step, (at[0], at[1], at[2]))
        place_m = corner_m


def test_the_way_out_is_the_way_that_was_walked() -> None:
    ground = WalkedGround()
    walk(ground, "r1", [(0, 0, 0), (20, 0, 0), (20, 15, 0)])
    way = ground.way_out((20.0, 15.0, 0.0), heading_rad=math.radians(90.0))
    assert way is not None
    assert way.length_m == pytest.approx(35.0, abs=2.0)
    assert way.walk_s == pytest.approx(35.0 / WALK_M_S, abs=2.0)
    assert way.crawl_s == pytest.approx(way.walk_s * WALK_M_S / CRAWL_M_S)
    assert [leg.turn for leg in way.legs] == ["around", "left"]
    assert way.legs[1].length_m == pytest.approx(20.0, abs=1.5)


def test_a_loop_is_cut_short_where_paths_cross() -> None:
    ground = WalkedGround()
    walk(ground, "r1", [(0, 0, 0), (20, 0, 0), (20, 20, 0), (5, 20, 0), (5, 0, 0)])
    walk(ground, "r1", [(5, 0, 0), (5, 10, 0)])
    way = ground.way_out((5.0, 10.0, 0.0))
    assert way is not None
    assert way.length_m == pytest.approx(15.0, abs=2.0)


def test_the_nearest_of_all_entrances_is_taken() -> None:
    ground = WalkedGround()
    walk(ground, "r1", [(0, 0, 0), (30, 0, 0)])
    walk(ground, "r2", [(40, 0, 0), (30, 0, 0)])
    way = ground.way_out((28.0, 0.0, 0.0))
    assert way is not None
    assert way.places_m[-1][0] == pytest.approx(40.0, abs=1.0)


def test_stairs_are_told_and_take_longer() -> None:
    ground = WalkedGround()
    walk(ground, "r1", [(0, 0, 0), (10, 0, 0), (15, 0, -3), (25, 0, -3)])
    way = ground.way_out((25.0, 0.0, -3.0))
    assert way is not None
    assert [leg.turn for leg in way.legs] == ["on", "downstairs", "on"]
    assert way.walk_s > way.length_m / WALK_M_S + 4.0


def test_a_stair_with_a_landing_is_one_leg() -> None:
    ground = WalkedGround()
    walk(ground, "r1", [(0, 0, 0), (10, 0, 0), (13, 0, -1.7), (13, 2, -1.7), (10, 2, -3.4)])
    walk(ground, "r1", [(10, 2, -3.4), (0, 2, -3.4)])
    way = ground.way_out((0.0, 2.0, -3.4), heading_rad=0.0)
    assert way is not None
    assert [leg.turn for leg in way.legs] == ["on", "downstairs", "on"]
    assert way.legs[1].length_m == pytest.approx(2 * math.hypot(3.0, 1.7) + 2.0, abs=2.0)


def test_where_the_heights_of_two_tracks_differ_there_are_no_stairs() -> None:
    ground = WalkedGround()
    walk(ground, "r1", [(0, 0, 0), (20, 0, 0)])
    # Joined where they cross, nearly two metres lower soon after.
    walk(ground, "r2", [(10, 0, 0.9), (10, 2, 1.9), (10, 15, 1.9)])
    way = ground.way_out((20.0, 0.0, 0.0), heading_rad=math.pi)
    assert way is not None
    assert not {leg.turn for leg in way.legs} & {"upstairs", "downstairs"}
    down = ground.quickest((10.0, 15.0, 1.9), [("r1", (20.0, 0.0, 0.0), math.pi)])
    assert down is not None
    assert [leg.turn for leg in down[1].legs] == ["on", "left"]


def test_where_an_estimate_leapt_there_is_no_way() -> None:
    ground = WalkedGround()
    walk(ground, "r1", [(0, 0, 0), (10, 0, 0)])
    ground.walk("r1", 99.0, (10.0, 30.0, 0.0))
    walk(ground, "r1", [(10, 30, 0), (10, 40, 0)])
    assert ground.way_out((10.0, 40.0, 0.0)) is None
    assert ground.way_out((10.0, 0.0, 0.0)) is not None


def test_who_is_far_from_all_that_was_walked_has_none() -> None:
    ground = WalkedGround()
    assert ground.way_out((0.0, 0.0, 0.0)) is None
    walk(ground, "r1", [(0, 0, 0), (10, 0, 0)])
    assert ground.way_out((10.0, 30.0, 0.0)) is None
    assert ground.way_out((10.0, 2.0, -6.0)) is None


def test_the_rescuer_who_is_soonest_there_is_sent() -> None:
    ground = WalkedGround()
    walk(ground, "r1", [(0, 0, 0), (40, 0, 0)])
    walk(ground, "r2", [(0, 0, 0), (20, 0, 0), (20, 18, 0)])
    goal: Point = (30.0, 0.0, 0.0)
    sent = ground.quickest(goal, [("r2", (20.0, 18.0, 0.0), None), ("r1", (5.0, 0.0, 0.0), None)])
    assert sent is not None
    assert sent[0] == "r1"
    (leg,) = sent[1].legs
    assert leg.turn == "on"
    assert leg.length_m == pytest.approx(25.0, abs=1.5)


@given(st.lists(st.tuples(*(st.floats(-40.0, 40.0),) * 2), min_size=2, max_size=6))
def test_a_way_out_is_never_longer_than_the_way_in(corners: list[tuple[float, float]]) -> None:
    ground = WalkedGround()
    walk(ground, "r1", [(north, east, 0.0) for north, east in corners])
    walked_m = sum(math.dist(a, b) for a, b in itertools.pairwise(corners))
    way = ground.way_out((*corners[-1], 0.0))
    assert way is not None
    # Places are joined within 1.2 m, so a way may be a little longer than what was walked.
    assert way.length_m <= 1.15 * walked_m + 3.0
    assert sum(leg.length_m for leg in way.legs) <= way.length_m + 1e-6
