"""What the DAPs of the packaged exercise hear."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from shared.simulation.installation import installation_truth
from shared.simulation.radio import RadioChannel, simulate_scans
from shared.simulation.radio_figures import range_rows, show
from shared.simulation.scenario import Scenario, load_scenario
from shared.simulation.walker import simulate_walk

SEED = 7


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("four_daps")


def test_one_seed_one_world(scenario: Scenario) -> None:
    time_s, rssi_dbm = RadioChannel(scenario, "dap2", "r2", SEED).readings()
    again_s, again_dbm = RadioChannel(scenario, "dap2", "r2", SEED).readings()
    other_s, _ = RadioChannel(scenario, "dap2", "r2", SEED + 1).readings()
    assert np.array_equal(time_s, again_s)
    assert np.array_equal(rssi_dbm, again_dbm)
    assert not np.array_equal(time_s, other_s)


def test_a_dap_hears_from_its_installation_on_who_is_there(scenario: Scenario) -> None:
    installed_s, _, installer_id = installation_truth(scenario, "dap3", SEED)
    assert installer_id == "r2"
    for responder_id in scenario.responders:
        time_s, rssi_dbm = RadioChannel(scenario, "dap3", responder_id, SEED).readings()
        there_s = simulate_walk(scenario, responder_id, SEED).body.time_s
        assert time_s[0] > max(installed_s, there_s[0])
        assert time_s[-1] <= there_s[-1]
        assert np.all(np.diff(time_s) > 0.0)
        assert np.array_equal(rssi_dbm, np.round(rssi_dbm))


def test_all_responders_are_heard_in_the_same_scans(scenario: Scenario) -> None:
    scans = simulate_scans(scenario, "dap2", SEED)
    assert set(scans.rssi_dbm) == {"r1", "r2", "r3"}
    for responder_id, column_dbm in scans.rssi_dbm.items():
        time_s, rssi_dbm = RadioChannel(scenario, "dap2", responder_id, SEED).readings()
        heard = ~np.isnan(column_dbm)
        assert np.array_equal(scans.time_s[heard], time_s)
        assert np.array_equal(column_dbm[heard], rssi_dbm)


def test_who_stands_still_is_read_alike(scenario: Scenario) -> None:
    """Real access points spread by about 1 dB while nothing moves."""
    time_s, rssi_dbm = RadioChannel(scenario, "dap1", "r1", SEED).readings()
    standing = rssi_dbm[time_s < 6.0]
    assert len(standing) > 20
    assert 0.5 < standing.std() < 1.5


def test_figures_are_like_measured_ones(scenario: Scenario) -> None:
    """Measured: 4 to 6 dB from place to place at one range, 1 dB at one place; far links vary."""
    rows = {row.from_m: row for row in range_rows(scenario, range(4))}
    assert rows[0.0].mean_dbm > rows[2.0].mean_dbm > rows[6.0].mean_dbm > rows[12.0].mean_dbm
    assert all(3.0 < rows[from_m].across_places_db < 8.0 for from_m in (1.0, 4.0, 8.0))
    assert rows[1.0].standing_variance_db2 < 1.5
    assert rows[12.0].walking_variance_db2 > 1.2 * rows[1.0].walking_variance_db2
    assert rows[0.0].lost < 0.1 < rows[40.0].lost


def test_the_figures_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    show(scenario="stairwell", seeds=1)
    shown = capsys.readouterr().out
    assert "across" in shown
    assert "0 to 1" in shown
    assert "nan" not in shown


def test_a_quicker_scan_reads_more(scenario: Scenario) -> None:
    quick = replace(scenario, radio=replace(scenario.radio, scan_rate_hz=10.0))
    often_s, _ = RadioChannel(quick, "dap1", "r1", SEED).readings()
    seldom_s, _ = RadioChannel(scenario, "dap1", "r1", SEED).readings()
    assert 1.8 < len(often_s) / len(seldom_s) < 2.2
