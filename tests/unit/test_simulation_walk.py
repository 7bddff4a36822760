"""Where simulated responders walk: through doors, up stairs, as far and as fast as people do."""

from __future__ import annotations

import numpy as np
import pytest

from shared.simulation.installation import REACH_M, installation_truth
from shared.simulation.legs import Climb, Gait, Move, Ride
from shared.simulation.plan import Room
from shared.simulation.scenario import SCENARIOS, Scenario, load_scenario
from shared.simulation.walker import Walk, simulate_walk
from tests.simulated_walks import gait_walk, lone_walk

PACKAGED = sorted(path.stem for path in SCENARIOS.glob("*.toml"))


def strides_of(walk: Walk, gait: Gait) -> np.ndarray:
    return walk.stride_m[[made == gait for made in walk.gaits]]


def corners_of(room: Room) -> tuple[np.ndarray, np.ndarray]:
    corners = np.array(room.corners_m)
    return corners.min(axis=0), corners.max(axis=0)


@pytest.fixture(scope="module", params=PACKAGED)
def packaged(request: pytest.FixtureRequest) -> Scenario:
    """A scenario; all that is asked of it comes in a row, so that its walks are made once."""
    return load_scenario(request.param)


@pytest.mark.parametrize("seed", [1, 0])
def test_nobody_walks_through_a_wall(packaged: Scenario, seed: int) -> None:
    for responder_id in packaged.responders:
        walk = simulate_walk(packaged, responder_id, seed)
        for way_m in (walk.body.position_m, walk.foot.place_m):
            assert not packaged.building.walls_crossed(way_m[:-1], way_m[1:]).any()


def test_everyone_begins_and_ends_standing(packaged: Scenario) -> None:
    for responder_id, responder in packaged.responders.items():
        walk = simulate_walk(packaged, responder_id, seed=0)
        first_s, last_s = walk.body.time_s[[0, -1]]
        assert first_s == responder.start_s
        for moments in (np.linspace(first_s, first_s + 3.0, 50), np.linspace(last_s - 3.0, last_s)):
            position_m, angles_rad = walk.foot.pose(moments)
            assert np.ptp(position_m, axis=0).max() < 1e-3
            assert np.degrees(np.ptp(angles_rad, axis=0)).max() < 0.3
            body_m, _ = walk.body.at(moments)
            assert not np.ptp(body_m, axis=0).any()


def test_the_course_is_83_5_m_long_and_walked_by_three_different_people() -> None:
    scenario = load_scenario("course")
    legs = [responder.route for responder in scenario.responders.values()]
    assert len(legs) == 3
    assert legs[0] == legs[1] == legs[2]
    assert course_length_m(scenario) == pytest.approx(83.5, abs=0.05)
    walks = [simulate_walk(scenario, responder_id, seed=0) for responder_id in scenario.responders]
    assert len({len(walk.gaits) for walk in walks} | {walk.stride_m[3] for walk in walks}) > 3
    for walk in walks:
        # A boot goes a little further than the course: it kneels down and turns on the spot.
        assert walk.stride_m.sum() == pytest.approx(84.2, abs=0.5)


def course_length_m(scenario: Scenario) -> float:
    """Length along the course's legs as one would measure it with a tape."""
    responder = scenario.responders["r1"]
    here, total_m = np.array(responder.start_m), 0.0
    for leg in responder.route:
        if isinstance(leg, Move):
            for point in leg.to_m:
                total_m += float(np.hypot(*(np.array(point) - here)))
                here = np.array(point)
        elif isinstance(leg, Climb):
            stairs = scenario.building.flight(leg.stairs)
            run_m = stairs.tread_m * stairs.steps
            rise_m = scenario.building.floor_height_m(stairs.upper_floor)
            rise_m -= scenario.building.floor_height_m(stairs.lower_floor)
            total_m += float(np.hypot(run_m, rise_m))
            ends = np.array([stairs.foot_m, stairs.head_m])
            here = ends[np.argmax(np.hypot(*(ends - here).T))]
    return total_m


@pytest.mark.parametrize(
    ("gait", "published_m"),
    [("walk", 1.2), ("fast_walk", 1.8), ("crawl", 0.6), ("stairs_up", 0.67), ("stairs_down", 0.67)],
)
def test_strides_of_the_course_are_as_published(gait: Gait, published_m: float) -> None:
    scenario = load_scenario("course")
    lengths_m = np.concatenate(
        [
            strides_of(simulate_walk(scenario, responder_id, seed), gait)
            for responder_id in scenario.responders
            for seed in range(3)
        ]
    )
    assert np.median(lengths_m) == pytest.approx(published_m, rel=0.06)


def test_stairs_end_on_the_other_floor() -> None:
    for gait, rise_m in (("stairs_up", 3.3), ("stairs_down", -1.98)):
        walk = simulate_walk(gait_walk(gait, 0.0), "r1", seed=0)  # type: ignore[arg-type]
        assert -walk.body.position_m[-1, 2] == pytest.approx(rise_m)
        climbed_m = walk.stance_position_m[0, 2] - walk.stance_position_m[-1, 2]
        assert climbed_m == pytest.approx(rise_m, abs=0.002)
        assert np.all(np.diff(walk.body.position_m[:, 2]) * np.sign(-rise_m) >= 0.0)


def test_a_ladder_is_climbed_upright_and_faced_both_ways() -> None:
    there_and_back = (Climb("ladder"), Climb("ladder"))
    scenario = lone_walk(*there_and_back, start_m=(12.0, -4.0), floor="fifth")
    walk = simulate_walk(scenario, "r1", seed=0)
    assert walk.body.position_m[:, 2].min() == pytest.approx(-19.8, abs=0.01)
    assert walk.body.position_m[-1, 2] == pytest.approx(-16.5)
    assert np.ptp(walk.body.heading_rad) < 0.01
    assert np.ptp(walk.body.position_m[:, 0]) == pytest.approx(0.6, abs=0.01)


@pytest.mark.parametrize(("floor", "peak_m_s"), [("fifth", 2.5), ("second", 1.67)])
def test_a_lift_gathers_speed_and_carries_foot_and_body_alike(floor: str, peak_m_s: float) -> None:
    """Short of 3.1 m, where 1.2 m/s² takes it to 2.5 m/s and back, it is slower."""
    ride = Ride(floor, speed_m_s=2.5, acceleration_m_s2=1.2)
    scenario = lone_walk(ride, floor="first")
    walk = simulate_walk(scenario, "r1", seed=0)
    time_s = np.arange(0.0, walk.body.time_s[-1], 0.02)
    foot_m, _ = walk.foot.pose(time_s)
    body_m, _ = walk.body.at(time_s)
    assert np.ptp(foot_m[:, :2], axis=0).max() < 0.01
    assert np.ptp(foot_m[:, 2] - body_m[:, 2]) < 0.03
    speed_m_s = -np.diff(foot_m[:, 2]) / 0.02
    assert speed_m_s.max() == pytest.approx(peak_m_s, rel=0.05)
    smooth = np.convolve(speed_m_s, np.ones(10) / 10, "valid")
    assert np.abs(np.diff(smooth) / 0.02).max() == pytest.approx(1.2, abs=0.15)


def test_side_steps_go_sideways_and_a_u_turn_is_made_on_the_spot() -> None:
    left = simulate_walk(gait_walk("side_left", 3.0), "r1", seed=0)
    assert np.degrees(left.body.heading_rad) == pytest.approx(90.0)
    assert left.body.position_m[-1] == pytest.approx([3.0, 0.0, 0.0])
    out_and_back = Move("walk", ((6.0, 0.0), (0.0, 0.0)))
    walk = simulate_walk(lone_walk(out_and_back), "r1", seed=0)
    assert walk.body.position_m[:, 0].max() == pytest.approx(6.0, abs=0.01)
    assert abs(np.degrees(walk.body.heading_rad[-1])) == pytest.approx(180.0, abs=1.0)


def test_a_straight_is_faced_along_right_up_to_where_its_corner_is_rounded() -> None:
    out = Move("walk", ((10.0, 0.0), (10.0, 8.0)))
    body = simulate_walk(lone_walk(out), "r1", seed=0).body
    north_m, east_m, _ = body.position_m.T
    first, second = (east_m < 1e-9) & (north_m < 9.0), (north_m > 10.0 - 1e-9) & (east_m > 1.0)
    assert first.sum() > 5
    assert second.sum() > 5
    assert np.degrees(body.heading_rad[first]) == pytest.approx(0.0, abs=1e-6)
    assert np.degrees(body.heading_rad[second]) == pytest.approx(90.0, abs=1e-6)


def test_a_crawling_boot_stands_near_vertical() -> None:
    walk = simulate_walk(gait_walk("crawl", 5.0), "r1", seed=0)
    _, angles_rad = walk.foot.pose(walk.stance_time_s[2:])
    assert np.degrees(angles_rad[:, 1]).max() < -70.0


def test_a_dap_is_set_down_within_reach_of_who_stands_there() -> None:
    scenario = load_scenario("four_daps")
    time_s, position_m, installer_id = installation_truth(scenario, "dap1", seed=3)
    assert (time_s, position_m.tolist(), installer_id) == (0.0, [-0.9, 0.6, 0.0], None)
    for dap_id, expected in (("dap2", "r1"), ("dap3", "r2"), ("dap4", "r2")):
        time_s, position_m, installer_id = installation_truth(scenario, dap_id, seed=3)
        assert installer_id == expected
        walk = simulate_walk(scenario, expected, seed=3)
        body_m, _ = walk.body.at(np.array([time_s - 1.0, time_s, time_s + 1.0]))
        assert not np.ptp(body_m, axis=0).any()
        assert np.linalg.norm(position_m - body_m[1]) == pytest.approx(REACH_M)


def test_the_four_daps_scenario_is_the_published_one() -> None:
    scenario = load_scenario("four_daps")
    walks = {name: simulate_walk(scenario, name, seed=0) for name in scenario.responders}
    for walk in walks.values():
        assert np.hypot(*walk.body.position_m[0, :2]) < 1.5
    known_m = {dap_id: installation_truth(scenario, dap_id, 0)[1] for dap_id in scenario.daps}

    def passes(responder_id: str, dap_id: str) -> int:
        away_m = np.linalg.norm(walks[responder_id].body.position_m - known_m[dap_id], axis=1)
        return int(np.count_nonzero(np.diff((away_m < 3.0).astype(int)) == 1))

    assert passes("r1", "dap2") >= 3
    assert passes("r2", "dap2") >= 1
    assert all(passes("r3", dap_id) >= 1 for dap_id in ("dap2", "dap3", "dap4"))
    unvisited = next(room for room in scenario.building.rooms if room.name == "N8")
    low_m, high_m = corners_of(unvisited)

    def inside(responder_id: str) -> np.ndarray:
        way_m = walks[responder_id].body.position_m[:, :2]
        return np.asarray(np.all((way_m > low_m) & (way_m < high_m), axis=1))

    assert inside("r3")[-1]
    assert not inside("r1").any()
    assert not inside("r2").any()
    assert 180.0 < max(walk.body.time_s[-1] for walk in walks.values()) < 300.0
