"""What a unit's own radio hears: DAPs that it passes, units that it meets."""

from __future__ import annotations

from edge_agent.radio_watch import Passed, RadioWatch
from shared.messages import StationTable
from shared.radios.readings import RadioScan, Reading
from shared.rssi_peaks import PeakDetector, PeakSettings
from shared.units import NS_PER_S

OWN, OTHER, DAP = "02:00:5e:10:00:01", "02:00:5e:10:00:02", "02:00:5e:10:00:81"
TABLE = StationTable(
    event_time_ns=0, sequence=0, responders=((OWN, "r1"), (OTHER, "r2")), daps=((DAP, "d1"),)
)
START_NS = 1_700_000_000 * NS_PER_S
LEVELS = [-70, -64, -58, -52, -46, -43, -46, -52, -58, -64, -70, -76]


def walk_by(watch: RadioWatch, *addresses: str) -> list[Passed]:
    """Pass all of them at once, a step every 0.6 s, three scans each."""
    return [
        watch.take(
            RadioScan(
                START_NS + round((0.6 * step + 0.2 * third) * NS_PER_S),
                tuple(Reading(address, float(dbm)) for address in addresses),
            )
        )
        for step, dbm in enumerate(LEVELS)
        for third in range(3)
    ]


def test_a_pass_of_a_dap_is_told_as_the_dap_would_tell_it() -> None:
    passed = walk_by(RadioWatch("r1", TABLE), DAP, OWN, "02:00:5e:10:00:7f")
    (peak,) = [peak for each in passed for peak in each.daps]
    assert [peak for each in passed for peak in each.responders] == []
    readings = [heard for each in passed for heard in each.readings]
    assert {heard.node_id for heard in readings} == {"d1"}
    assert len(readings) == 3 * len(LEVELS)
    theirs = PeakDetector(PeakSettings())
    found = []
    for heard in readings:
        theirs.add(heard.time_ns, "r1", heard.rssi_dbm)
        found += theirs.tick(heard.time_ns)
    (dap_side,) = found
    assert abs(peak.time_ns - dap_side.time_ns) < 0.2 * NS_PER_S
    assert abs(peak.peak_dbm - dap_side.peak_dbm) < 1.0


def test_another_unit_is_met() -> None:
    passed = walk_by(RadioWatch("r1", TABLE), OTHER)
    (peak,) = [peak for each in passed for peak in each.responders]
    assert peak.station_id == "r2"
    assert not any(each.readings or each.daps for each in passed)


def test_a_radio_is_calibrated_and_nobody_is_known_without_a_table() -> None:
    watch = RadioWatch("r1", offset_db=5.0)
    assert not any(each.readings for each in walk_by(watch, DAP))
    assert watch.learn(TABLE)
    assert not watch.learn(TABLE)
    later = RadioWatch("r1", TABLE, offset_db=5.0)
    (peak,) = [peak for each in walk_by(later, DAP) for peak in each.daps]
    (plain,) = [peak for each in walk_by(RadioWatch("r1", TABLE), DAP) for peak in each.daps]
    assert abs(peak.peak_dbm - plain.peak_dbm - 5.0) < 1e-9
