"""The scanner of a simulated exercise: the installation and all scans, in the order of time."""

from __future__ import annotations

import numpy as np
import pytest

from dap_node.proximity import ProximitySettings
from dap_node.scanners.observation import Scan, SetDown
from dap_node.scanners.simulated import EMPTY_SCANS_S, SimulatedScanner
from shared.simulation.installation import installation_truth
from shared.simulation.radio import RadioChannel
from shared.simulation.scenario import Scenario, load_scenario
from shared.units import NS_PER_S

SEED = 3
START_NS = 1_700_000_000 * NS_PER_S


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("four_daps")


def test_the_installation_comes_first_and_then_scans(scenario: Scenario) -> None:
    first, *rest = SimulatedScanner(scenario, "dap3", SEED).observations(START_NS)
    time_s, place_m, installer_id = installation_truth(scenario, "dap3", SEED)
    assert isinstance(first, SetDown)
    assert first.time_ns == START_NS + round(time_s * NS_PER_S)
    assert (first.installer_id, first.position) == (installer_id, None)
    assert first.truth_m == tuple(place_m)
    assert all(isinstance(observation, Scan) for observation in rest)
    times_ns = [first.time_ns, *(scan.time_ns for scan in rest)]
    assert times_ns == sorted(set(times_ns))


def test_a_dap_at_a_known_place_says_so(scenario: Scenario) -> None:
    first = next(SimulatedScanner(scenario, "dap1", SEED).observations(START_NS))
    assert isinstance(first, SetDown)
    assert first.installer_id is None
    assert first.position is not None
    assert first.truth_m == (first.position.north_m, first.position.east_m, first.position.down_m)


def test_every_reading_is_in_its_scan(scenario: Scenario) -> None:
    scans = [
        observation
        for observation in SimulatedScanner(scenario, "dap2", SEED).observations(0)
        if isinstance(observation, Scan)
    ]
    for responder_id in scenario.responders:
        time_s, rssi_dbm = RadioChannel(scenario, "dap2", responder_id, SEED).readings()
        heard = [
            (scan.time_ns, scan.rssi_dbm[responder_id])
            for scan in scans
            if responder_id in scan.rssi_dbm
        ]
        times_ns = [round(time * NS_PER_S) for time in time_s]
        assert heard == list(zip(times_ns, rssi_dbm, strict=True))


def test_scanning_goes_on_until_every_stay_has_ended(scenario: Scenario) -> None:
    observations = list(SimulatedScanner(scenario, "dap2", SEED).observations(0))
    last_heard_ns = max(
        observation.time_ns
        for observation in observations
        if isinstance(observation, Scan) and observation.rssi_dbm
    )
    assert observations[-1].time_ns - last_heard_ns >= ProximitySettings().silence_s * NS_PER_S
    gaps_s = np.diff([observation.time_ns for observation in observations]) / NS_PER_S
    assert gaps_s.max() < 2.0 / scenario.radio.scan_rate_hz
    assert ProximitySettings().silence_s < EMPTY_SCANS_S


def test_an_unknown_dap_is_told_which_there_are(scenario: Scenario) -> None:
    with pytest.raises(ValueError, match=r"no DAP 'dap9'.*dap1, dap2, dap3, dap4"):
        SimulatedScanner(scenario, "dap9", SEED)
