"""What keeps the heading: a magnetometer among steel, and the building's dominant direction."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from edge_agent.inertial.heading_aid import HeadingAid
from shared.simulation.magnetic import MagneticField, MagneticSettings
from tests.drifting_walk import Magnetometer, follow, headings_along

DRIFT_RAD_S = math.radians(3.0) / 60.0
OFFICE_M = ((24.0, 0.0), (24.0, 9.0), (0.0, 9.0), (0.0, 30.0), (-15.0, 30.0), (-15.0, 0.0))
ROUND_M = [(18.0 * math.cos(a), 18.0 * math.sin(a)) for a in np.linspace(0.1, 2.0 * math.pi, 60)]
SEEDS = range(4)


def magnetometer(
    seed: int,
    *,
    disturbance_ut: float = 6.0,
    iron_ut: Sequence[float] = (0.0, 0.0, 0.0),
    axes: NDArray[np.float64] | None = None,
) -> Magnetometer:
    settings = MagneticSettings(disturbance_ut=disturbance_ut, disturbance_length_m=2.5)
    field = MagneticField(settings, np.random.default_rng(seed))
    reads = np.eye(3) if axes is None else axes

    def read(place_m: NDArray[np.float64], heading_rad: float) -> NDArray[np.float64]:
        north, east, down = field.at(place_m[None])[0].tolist()
        c, s = math.cos(heading_rad), math.sin(heading_rad)
        sensed = reads @ [c * north + s * east, c * east - s * north, down]
        return np.asarray(sensed + np.array(iron_ut))

    return read


def office() -> Iterator[float]:
    return headings_along(OFFICE_M)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_magnetometer_limits_a_long_drift_and_knows_how_well(seed: int) -> None:
    chance = np.random.default_rng(seed)
    found = follow(HeadingAid(), office(), 30.0, DRIFT_RAD_S, magnetometer(seed), chance)
    end_rad = found.error_rad[-300:]
    assert np.abs(end_rad).mean() < 0.2 * DRIFT_RAD_S * 1800.0
    assert np.abs(end_rad).max() < 2.5 * found.sd_rad
    assert found.told_rad2 > 0.0


FAULTS: dict[str, dict[str, Any]] = {
    "a boot of steel": {"iron_ut": (25.0, -10.0, 15.0)},
    "scaled axes": {"axes": np.diag([1.15, 0.85, 1.1])},
    "both, and much steel about": {
        "iron_ut": (15.0, 15.0, 0.0),
        "axes": np.diag([0.9, 1.1, 1.0]),
        "disturbance_ut": 12.0,
    },
    "axes swapped": {"axes": np.eye(3)[[1, 0, 2]]},
    "axes reversed": {"axes": np.diag([1.0, -1.0, -1.0])},
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_bad_magnetometer_does_no_more_harm_than_it_says(fault: str, seed: int) -> None:
    read = magnetometer(seed, **FAULTS[fault])
    found = follow(HeadingAid(), office(), 15.0, 0.0, read, np.random.default_rng(seed))
    assert np.abs(found.error_rad).max() < math.radians(20.0)
    assert np.abs(found.error_rad[-100:]).max() < 3.0 * found.sd_rad


@pytest.mark.parametrize("seed", SEEDS)
def test_over_a_minute_a_magnetometer_changes_next_to_nothing(seed: int) -> None:
    chance = np.random.default_rng(seed)
    found = follow(HeadingAid(), office(), 1.0, 0.0, magnetometer(seed), chance)
    assert np.abs(found.error_rad).max() < math.radians(1.0)


def test_readings_that_are_no_number_are_passed_over() -> None:
    def read(place_m: NDArray[np.float64], heading_rad: float) -> NDArray[np.float64]:
        return np.array([math.nan, math.inf, heading_rad])

    found = follow(HeadingAid(), office(), 2.0, DRIFT_RAD_S, read, np.random.default_rng(1))
    assert found.told_rad2 == 0.0


@pytest.mark.parametrize("turned_deg", [0.0, 30.0])
def test_corridors_hold_a_heading(turned_deg: float) -> None:
    headings = (heading + math.radians(turned_deg) for heading in office())
    aid = HeadingAid(dominant_direction=True)
    found = follow(aid, headings, 20.0, DRIFT_RAD_S, None, np.random.default_rng(1))
    assert np.abs(found.error_rad).max() < math.radians(4.0)
    assert np.abs(found.error_rad[-300:]).max() < 3.0 * found.sd_rad


AMISS: dict[str, Sequence[tuple[float, float]]] = {
    "a round course": ROUND_M,
    "wings at 45°": ((30.0, 0.0), (51.0, 21.0), (21.0, 21.0), (0.0, 0.0)),
    "three ways at 60°": ((20.0, 0.0), (10.0, 17.3), (0.0, 0.0)),
}


@pytest.mark.parametrize("where", AMISS)
def test_a_way_without_a_dominant_direction_is_not_bent(where: str) -> None:
    aid, way = HeadingAid(dominant_direction=True), headings_along(AMISS[where])
    found = follow(aid, way, 15.0, 0.0, None, np.random.default_rng(2))
    assert np.abs(found.error_rad).max() < math.radians(1.0)


def test_the_building_is_not_asked_by_default() -> None:
    found = follow(HeadingAid(), office(), 5.0, DRIFT_RAD_S, None, np.random.default_rng(1))
    np.testing.assert_allclose(found.error_rad[-1], 300.0 * DRIFT_RAD_S, rtol=0.01)
    assert found.told_rad2 == 0.0
