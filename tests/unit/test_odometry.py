"""Strides with their errors alone: as large as told, lasting where they last, and from the seed."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from shared.simulation.faults import Fault
from shared.simulation.legs import Move
from shared.simulation.odometry import Stride, UnitStart, simulate_odometry
from shared.simulation.odometry_errors import OdometrySettings
from shared.simulation.scenario import Scenario
from shared.simulation.walker import simulate_walk
from tests.simulated_walks import lone_walk

ERRORS = [name for name in OdometrySettings.__struct_fields__ if name != "source"]
NONE = msgspec.structs.replace(
    OdometrySettings(), **dict.fromkeys(ERRORS, 0.0) | {"strides_a_jump": 1e9}
)


BACK_AND_FORTH = Move("walk", ((30.0, 0.0), (30.0, 20.0), (0.0, 20.0), (0.0, 0.0)) * 2)


@pytest.fixture(scope="module")
def exercise() -> Scenario:
    return lone_walk(BACK_AND_FORTH)


def without_errors(scenario: Scenario, heading_sd_deg: float = 0.0, **kept: float) -> Scenario:
    responders = {
        name: msgspec.structs.replace(each, heading_sd_deg=heading_sd_deg)
        for name, each in scenario.responders.items()
    }
    odometry = msgspec.structs.replace(NONE, **kept)
    return msgspec.structs.replace(scenario, odometry=odometry, responders=responders)


def strides_of(scenario: Scenario, responder_id: str, seed: int) -> list[Stride]:
    said = simulate_odometry(scenario, responder_id, seed)
    return [each for each in said if isinstance(each, Stride)]


def test_without_errors_strides_add_up_to_the_way(exercise: Scenario) -> None:
    exact = without_errors(exercise)
    walk = simulate_walk(exact, "r1", 1)
    start, *strides = simulate_odometry(exact, "r1", 1)
    assert isinstance(start, UnitStart)
    assert start.position is not None
    assert start.position.covariance_m2 == (0.0, 0.0, 0.0)
    assert len(strides) == len(walk.gaits)
    places_m = np.array([fall.place_m for fall in walk.footfalls])
    moved_m = np.array([each.displacement_m for each in strides if isinstance(each, Stride)])
    np.testing.assert_allclose(np.cumsum(moved_m, axis=0), places_m[1:] - places_m[0], atol=1e-9)
    last = strides[-1]
    assert isinstance(last, Stride)
    assert last.heading_rad == pytest.approx(walk.footfalls[-1].facing_rad)
    assert last.gait == walk.gaits[-1]


def test_strides_follow_one_another_in_time(exercise: Scenario) -> None:
    strides = strides_of(exercise, "r1", 2)
    times_s = [time for each in strides for time in (each.start_s, each.end_s)]
    assert times_s == sorted(times_s)
    walk = simulate_walk(exercise, "r1", 2)
    assert walk.body.time_s[0] < strides[0].start_s
    assert strides[-1].end_s < walk.body.time_s[-1]


@pytest.mark.parametrize(
    ("kept", "share"),
    [({"scale": 0.02}, 0.02), ({"place_m": 0.1}, None), ({"height_m": 0.05}, None)],
)
def test_lengths_err_as_told(
    exercise: Scenario, kept: dict[str, float], share: float | None
) -> None:
    exact, erring = without_errors(exercise), without_errors(exercise, **kept)
    error_m, ratios = [], []
    for seed in range(40):
        true_m, said_m = (
            np.array([each.displacement_m for each in strides_of(scenario, "r1", seed)])
            for scenario in (exact, erring)
        )
        error_m.append(said_m - true_m)
        ratios.append(np.sum(said_m * true_m) / np.sum(true_m**2))
    if share is not None:
        assert np.std(ratios) == pytest.approx(share, rel=0.3)
        return
    spread_m = np.std(np.concatenate(error_m), axis=0)
    level_m, height_m = kept.get("place_m", 0.0), kept.get("height_m", 0.0)
    np.testing.assert_allclose(spread_m, [level_m, level_m, height_m], rtol=0.05, atol=1e-9)


def test_the_heading_drifts_walks_and_jumps_as_told(exercise: Scenario) -> None:
    def north_off_deg(**kept: float) -> list[np.ndarray]:
        exact, erring = without_errors(exercise), without_errors(exercise, **kept)
        return [
            np.degrees([
                true.heading_rad - said.heading_rad
                for true, said in zip(
                    strides_of(exact, "r1", seed), strides_of(erring, "r1", seed), strict=True
                )
            ])
            for seed in range(40)
        ]  # fmt: skip

    walked = np.concatenate([np.diff(off) for off in north_off_deg(heading_deg=0.5)])
    assert np.std(walked) == pytest.approx(0.5, rel=0.05)
    jumps = np.concatenate(
        [np.diff(off) for off in north_off_deg(jump_deg=6.0, strides_a_jump=20.0)]
    )
    jumped = jumps[np.abs(jumps) > 1e-9]
    assert len(jumps) / len(jumped) == pytest.approx(20.0, rel=0.2)
    assert np.std(jumped) == pytest.approx(6.0, rel=0.15)
    drifts = [
        off[-1] / (simulate_walk(exercise, "r1", seed).body.time_s[-1])
        for seed, off in enumerate(north_off_deg(rate_bias_deg_s=0.05))
    ]
    assert np.std(drifts) == pytest.approx(0.05, rel=0.3)


def test_a_heading_that_is_off_turns_the_way(exercise: Scenario) -> None:
    exact, turned = without_errors(exercise), without_errors(exercise, heading_sd_deg=30.0)
    start = next(simulate_odometry(turned, "r1", 4))
    assert isinstance(start, UnitStart)
    assert start.heading_sd_rad == pytest.approx(math.radians(30.0))
    true_m, said_m = (
        sum(complex(*each.displacement_m[:2]) * (index + 1) for index, each in enumerate(strides))
        for strides in (strides_of(exact, "r1", 4), strides_of(turned, "r1", 4))
    )
    assert abs(said_m) == pytest.approx(abs(true_m))
    off_rad = strides_of(exact, "r1", 4)[0].heading_rad - strides_of(turned, "r1", 4)[0].heading_rad
    assert off_rad != 0.0
    assert said_m / true_m == pytest.approx(complex(math.cos(off_rad), -math.sin(off_rad)))


def test_strides_go_missing_and_nobody_says_so(exercise: Scenario) -> None:
    losing = without_errors(exercise, missed=0.1)
    walked = sum(len(simulate_walk(losing, "r1", seed).gaits) for seed in range(10))
    said = sum(len(strides_of(losing, "r1", seed)) for seed in range(10))
    assert said / walked == pytest.approx(0.9, abs=0.02)


def test_a_unit_that_restarts_knows_neither_place_nor_heading(exercise: Scenario) -> None:
    faults = {"r1": Fault(restarts_s=(50.0, 90.0), scale=1.2)}
    said = list(simulate_odometry(msgspec.structs.replace(exercise, faults=faults), "r1", 3))
    starts = [each for each in said if isinstance(each, UnitStart)]
    assert [start.time_s for start in starts[1:]] == [50.0, 90.0]
    assert all(start.position is None for start in starts[1:])
    assert all(start.heading_sd_rad == math.pi for start in starts[1:])
    times_s = [each.time_s if isinstance(each, UnitStart) else each.end_s for each in said]
    assert times_s == sorted(times_s)
    whole = strides_of(exercise, "r1", 3)
    longer = [each for each in said if isinstance(each, Stride)]
    assert len(longer) == len(whole)
    lengths_m = [
        sum(math.hypot(*each.displacement_m[:2]) for each in way) for way in (longer, whole)
    ]
    assert lengths_m[0] / lengths_m[1] == pytest.approx(1.2, rel=0.01)


def test_another_unit_on_the_boot_does_not_say_that_it_is_turned(exercise: Scenario) -> None:
    exact = without_errors(exercise)
    fault = Fault(since_s=30.0, turned_deg=90.0)
    right = strides_of(exact, "r1", 1)
    wrong = strides_of(msgspec.structs.replace(exact, faults={"r1": fault}), "r1", 1)
    for one, other in zip(right, wrong, strict=True):
        north_m, east_m, down_m = one.displacement_m
        if one.end_s < fault.since_s:
            assert other == one
        elif one.start_s > fault.since_s + 3.0:
            np.testing.assert_allclose(other.displacement_m, (east_m, -north_m, down_m), atol=1e-9)
        assert other.d_heading_rad == pytest.approx(one.d_heading_rad)
