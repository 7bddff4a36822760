"""Who sets DAPs down after every so far does, and who does as advised sets fewer, further apart."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from shared.simulation.installation import installation_truth, is_set_down
from shared.simulation.scenario import Scenario, load_scenario
from shared.simulation.walker import simulate_walk

SEED = 3


def _places_m(scenario: Scenario) -> list[np.ndarray]:
    carried = [dap_id for dap_id, dap in scenario.daps.items() if dap.position_m is None]
    return [
        installation_truth(scenario, dap_id, SEED)[1]
        for dap_id in carried
        if is_set_down(scenario, dap_id, SEED)
    ]


def test_one_is_set_down_after_every_twenty_metres() -> None:
    scenario = load_scenario("four_daps_spaced")
    walk = simulate_walk(scenario, "r1", SEED)
    body = walk.body
    walked_m = np.append(0.0, np.cumsum(np.hypot(*np.diff(body.position_m[:, :2], axis=0).T)))
    at_m = [float(np.interp(time_s, body.time_s, walked_m)) for time_s in walk.installed.values()]
    apart_m = np.diff([0.0, *at_m])
    assert len(at_m) == 2
    assert np.all((apart_m > 19.5) & (apart_m < 22.0))


def test_advised_ones_stand_apart_and_are_fewer() -> None:
    spaced, advised = (
        _places_m(load_scenario(name)) for name in ("four_daps_spaced", "four_daps_advised")
    )
    nearest_m = min(float(np.linalg.norm(one - other)) for one, other in combinations(advised, 2))
    assert 1 <= len(advised) <= len(spaced)
    assert nearest_m > 6.0


def test_the_same_seed_sets_them_down_alike() -> None:
    one, other = (_places_m(load_scenario("four_daps_advised")) for _ in range(2))
    assert np.array_equal(one, other)
