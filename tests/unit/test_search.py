"""Searching a building by chance: ways that are there, rooms gone round, DAPs set down once."""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

from shared.simulation.corridors import Corridors, Place, inside
from shared.simulation.installation import installation_truth, is_set_down
from shared.simulation.legs import Climb, Move, Search, Stand
from shared.simulation.plan import Door, Floor, Plan, Room, Stairs, Wall, Way, load_plan
from shared.simulation.scenario import Responder, Scenario, load_scenario
from shared.simulation.search import plain_legs, wall_round
from shared.simulation.set_downs import SET_DOWN_S
from shared.simulation.team_routes import COMES_BY_M
from shared.simulation.walker import simulate_walk

SEED = 3


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("offices")


@pytest.fixture(scope="module")
def plan() -> Plan:
    return load_plan("office_floor")


def test_every_room_has_its_door_on_a_way(plan: Plan) -> None:
    entrances = Corridors(plan).entrances
    assert sorted(entrance.room.name for entrance in entrances) == sorted(
        room.name for room in plan.rooms
    )
    for entrance in entrances:
        assert np.hypot(*np.subtract(entrance.door_m, entrance.place.point_m)) == pytest.approx(1.0)


def test_the_shortest_way_takes_the_ring(plan: Plan) -> None:
    corridors = Corridors(plan)
    start, end = (
        corridors.nearest("ground", (12.0, 20.0)),
        corridors.nearest("ground", (12.0, 45.0)),
    )
    points = [start, *(place for place, stairs in corridors.path(start, end))]
    assert all(place.north_m == 12.0 for place in points)
    length_m = sum(np.hypot(*np.subtract(b[1:], a[1:])) for a, b in pairwise(points))
    assert length_m == pytest.approx(25.0)
    with pytest.raises(ValueError, match="no way leads"):
        corridors.path(start, Place("ground", 99.0, 99.0))
    with pytest.raises(ValueError, match="'attic' has no ways"):
        corridors.nearest("attic", (0.0, 0.0))


@pytest.mark.parametrize("order", [1, -1])
def test_a_room_is_gone_round_inside_along_its_walls(order: int) -> None:
    corners = ((0.0, 0.0), (0.0, 10.0), (4.0, 10.0), (4.0, 6.0), (8.0, 6.0), (8.0, 0.0))
    room = Room("L", "ground", corners[::order])
    way = wall_round(room, 1.0)
    expected = {(1.0, 1.0), (1.0, 9.0), (3.0, 9.0), (3.0, 5.0), (7.0, 5.0), (7.0, 1.0)}
    assert {(round(float(n), 9), round(float(e), 9)) for n, e in way} == expected
    assert all(inside(room, point) for point in way)
    assert not inside(room, np.array([6.0, 8.0]))


def test_an_outline_may_go_straight_on_and_end_where_it_began() -> None:
    square = ((0.0, 0.0), (0.0, 6.0), (5.0, 6.0), (5.0, 0.0))
    drawn = ((0.0, 0.0), (0.0, 3.0), (0.0, 6.0), (5.0, 6.0), (5.0, 6.0), (5.0, 0.0), (0.0, 0.0))
    ways = [wall_round(Room("R", "ground", each)) for each in (square, drawn)]
    assert sorted(ways[0].tolist()) == sorted(ways[1].tolist())


def test_floors_may_count_their_rooms_alike() -> None:
    floors = (Floor("ground", 0.0), Floor("first", 3.0))
    plan = Plan(
        "two rooms called 1, one above the other",
        floors,
        walls=tuple(
            Wall(floor.name, (1.0, 0.0), (1.0, 6.0), doors=(Door(3.0),)) for floor in floors
        ),
        rooms=tuple(
            Room("1", floor.name, ((1.0, 0.0), (6.0, 0.0), (6.0, 6.0), (1.0, 6.0)))
            for floor in floors
        ),
        stairs=(Stairs("up", "ground", "first", (0.0, 6.0), (0.0, 12.0), 20),),
        ways=(Way("ground", ((0.0, 0.0), (0.0, 6.0))), Way("first", ((0.0, 12.0), (0.0, 0.0)))),
    )
    searcher = Responder((0.0, 0.0), (Stand(5.0), Search(rooms=(2, 2)), Stand(5.0)))
    legs = plain_legs(plan, searcher, np.random.default_rng(SEED))
    # Into a room, to its door again, and out of it.
    assert sum(isinstance(leg, Move) and leg.exact for leg in legs) == 2 * 3
    assert any(isinstance(leg, Climb) for leg in legs)


def test_searchers_go_into_as_many_rooms_as_told(scenario: Scenario) -> None:
    for responder_id in scenario.responders:
        walk = simulate_walk(scenario, responder_id, SEED)
        entered = {
            room.name
            for room in scenario.building.rooms
            if any(inside(room, fall.body_m[:2]) for fall in walk.footfalls)
        }
        assert 4 <= len(entered) <= 6


def test_seeds_search_differently_and_one_seed_always_alike(scenario: Scenario) -> None:
    again = load_scenario("offices")
    one, same, other = (
        simulate_walk(exercise, "r2", seed).body.position_m
        for exercise, seed in ((scenario, 1), (again, 1), (scenario, 2))
    )
    np.testing.assert_array_equal(one, same)
    assert one.shape != other.shape or not np.allclose(one, other)


def test_the_first_to_come_by_sets_down_and_nobody_sets_down_beside(scenario: Scenario) -> None:
    sites_m = np.array([site.place_m for site in scenario.building.sites])
    set_down: dict[tuple[int, int], str] = {}
    for seed in range(3):
        for dap_id, installer_id in scenario.installations:
            if not is_set_down(scenario, dap_id, seed):
                with pytest.raises(ValueError, match="never set down"):
                    installation_truth(scenario, dap_id, seed)
                continue
            time_s, place_m, by = installation_truth(scenario, dap_id, seed)
            assert by == installer_id
            body = simulate_walk(scenario, installer_id, seed).body
            held_m, _ = body.at(np.array([time_s - 0.4 * SET_DOWN_S, time_s + 0.4 * SET_DOWN_S]))
            np.testing.assert_allclose(held_m[0], held_m[1], atol=1e-6)
            site = int(np.argmin(np.hypot(*(sites_m - place_m[:2]).T)))
            assert np.hypot(*(held_m[0, :2] - sites_m[site])) < COMES_BY_M
            assert set_down.setdefault((seed, site), dap_id) == dap_id
            for other_id in scenario.responders.keys() - {installer_id}:
                walk = simulate_walk(scenario, other_id, seed)
                left = [dap for dap in scenario.responders[other_id].carries
                        if walk.installed.get(dap, np.inf) >= time_s]  # fmt: skip
                before = walk.body.time_s < time_s - SET_DOWN_S
                away_m = np.hypot(*(walk.body.position_m[before, :2] - sites_m[site]).T)
                assert not left or not (away_m < 0.5 * COMES_BY_M).any()
    assert len(set_down) > 15


def test_a_turned_exercise_is_the_same_but_for_the_turn(scenario: Scenario) -> None:
    turned = load_scenario("offices_diagonal")
    c = np.sqrt(0.5)
    turn = np.array([[c, -c], [c, c]])
    door_m, door_turned_m = (
        np.array(each.daps["door"].position_m, dtype=float) for each in (scenario, turned)
    )
    np.testing.assert_allclose(door_turned_m, [*(turn @ door_m[:2]), door_m[2]])
    walls_m = scenario.building.wall_pieces_m
    np.testing.assert_allclose(turned.building.wall_pieces_m, walls_m @ turn.T, atol=1e-9)
    assert turned.responders["r2"].heading_deg == 135.0
    walk = simulate_walk(turned, "r2", SEED)
    np.testing.assert_allclose(
        walk.body.position_m[0, :2], turn @ scenario.responders["r2"].start_m
    )
    middle_m = walk.body.position_m[:, :2] @ turn
    assert np.ptp(middle_m[:, 1]) > np.ptp(middle_m[:, 0])


def test_every_process_walks_alike_however_it_hashes() -> None:
    script = (
        "from shared.simulation.scenario import load_scenario\n"
        "from shared.simulation.walker import simulate_walk\n"
        "walk = simulate_walk(load_scenario('three_floors'), 'r3', 2)\n"
        "print(walk.body.position_m.sum(), walk.body.time_s[-1], walk.installed)\n"
    )
    told = {
        subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, "PYTHONHASHSEED": seed}, capture_output=True, text=True, check=True,
        ).stdout
        for seed in ("1", "2")
    }  # fmt: skip
    assert len(told) == 1
    assert "r3-1" in told.pop()
