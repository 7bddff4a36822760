"""What responders' units hear of each other in the packaged exercise."""

from __future__ import annotations

import numpy as np
import pytest

from shared.simulation.meetings import simulate_meetings
from shared.simulation.scenario import Scenario, load_scenario
from shared.simulation.walker import simulate_walk

SEED = 7


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("four_daps")


def test_one_seed_one_world(scenario: Scenario) -> None:
    first, again, other = (
        simulate_meetings(scenario, "r1", seed).rssi_dbm["r2"] for seed in (SEED, SEED, SEED + 1)
    )
    assert np.array_equal(first, again, equal_nan=True)
    assert not np.array_equal(first[:500], other[:500], equal_nan=True)


def test_both_hear_the_same_but_for_noise(scenario: Scenario) -> None:
    mine = simulate_meetings(scenario, "r1", SEED)
    theirs = simulate_meetings(scenario, "r2", SEED)
    mine_dbm = np.interp(
        theirs.time_s,
        mine.time_s[~np.isnan(mine.rssi_dbm["r2"])],
        mine.rssi_dbm["r2"][~np.isnan(mine.rssi_dbm["r2"])],
    )
    difference_db = (mine_dbm - theirs.rssi_dbm["r1"])[theirs.rssi_dbm["r1"] > -60.0]
    assert len(difference_db) > 50
    assert abs(np.median(difference_db)) < 0.6


def test_only_who_takes_part_is_heard(scenario: Scenario) -> None:
    scans = simulate_meetings(scenario, "r1", SEED)
    assert set(scans.rssi_dbm) == {"r2", "r3"}
    r1_s, r3_s = (simulate_walk(scenario, one, SEED).body.time_s for one in ("r1", "r3"))
    heard_s = scans.time_s[~np.isnan(scans.rssi_dbm["r3"])]
    assert max(r1_s[0], r3_s[0]) <= heard_s[0]
    assert heard_s[-1] <= min(r1_s[-1], r3_s[-1])


def test_the_nearer_the_louder(scenario: Scenario) -> None:
    levels_dbm: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(3):
        scans = simulate_meetings(scenario, "r1", seed)
        own_m, _ = simulate_walk(scenario, "r1", seed).body.at(scans.time_s)
        for other_id, rssi_dbm in scans.rssi_dbm.items():
            other_m, _ = simulate_walk(scenario, other_id, seed).body.at(scans.time_s)
            range_m = np.linalg.norm(own_m - other_m, axis=1)
            levels_dbm[True] += rssi_dbm[(range_m < 1.5) & ~np.isnan(rssi_dbm)].tolist()
            levels_dbm[False] += rssi_dbm[(range_m > 8.0) & ~np.isnan(rssi_dbm)].tolist()
    assert np.median(levels_dbm[True]) > -50.0
    assert np.median(levels_dbm[False]) < -60.0
