"""What is wrong with the nodes of an exercise: heard, and told, as such a fault makes it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from dap_node.commands.rehearse import rehearse_dap
from dap_node.scanners.observation import PutElsewhere, SetDown
from dap_node.scanners.simulated import SimulatedScanner
from shared.bus.wire_log import read_wire_log
from shared.codec import decode, parse_key
from shared.messages import ProximityEvent, Truth
from shared.simulation.faults import Fault
from shared.simulation.installation import places_of
from shared.simulation.meetings import simulate_meetings
from shared.simulation.radio import Scans, simulate_scans
from shared.simulation.scenario import Scenario, load_scenario
from shared.topics import Key
from shared.units import NS_PER_S

SEED = 3
SINCE_S = 10.0
ELSEWHERE_M = (0.5, 14.0, 0.0)


@pytest.fixture(scope="module")
def exercise() -> Scenario:
    return load_scenario("corridor")


def faulty(scenario: Scenario, **faults: Fault) -> Scenario:
    return replace(scenario, faults=faults)


def differ(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.bool_]:
    both = ~(np.isnan(one) & np.isnan(other))
    return np.asarray((one != other) & both)


def test_a_dap_is_heard_from_where_somebody_put_it(exercise: Scenario) -> None:
    moved = faulty(exercise, dap1=Fault(since_s=SINCE_S, moved_to_m=ELSEWHERE_M))
    as_it_was, now = (simulate_scans(each, "dap1", SEED) for each in (exercise, moved))
    changed = differ(as_it_was.rssi_dbm["r1"], now.rssi_dbm["r1"])
    assert not changed[now.time_s < SINCE_S].any()
    assert changed[now.time_s >= SINCE_S].mean() > 0.5
    (put,) = (
        each
        for each in SimulatedScanner(moved, "dap1", SEED).observations(0)
        if isinstance(each, PutElsewhere)
    )
    assert put == PutElsewhere(round(SINCE_S * NS_PER_S), ELSEWHERE_M)


def test_two_daps_go_by_each_others_names(exercise: Scenario) -> None:
    swapped = faulty(exercise, dap2=Fault(swapped_with="dap1"))
    (own, other), (others, owns) = (places_of(swapped, name, SEED) for name in ("dap1", "dap2"))
    boxes = [each.box_id for each in (own, other, others, owns)]
    assert boxes == ["dap1", "dap2", "dap2", "dap1"]
    assert np.array_equal(other.place_m, others.place_m)
    assert other.since_s == owns.since_s == others.since_s > own.since_s


def test_two_responders_radios_go_by_each_others_names(exercise: Scenario) -> None:
    swapped = faulty(exercise, r1=Fault(since_s=SINCE_S, swapped_with="r2"))
    right, wrong = (simulate_scans(each, "dap1", SEED) for each in (exercise, swapped))
    since = right.time_s >= SINCE_S

    def same(one: Scans, name: str, other: Scans, by: str, when: NDArray[np.bool_]) -> bool:
        return np.array_equal(one.rssi_dbm[name][when], other.rssi_dbm[by][when], equal_nan=True)

    assert same(right, "r1", wrong, "r1", ~since)
    assert same(right, "r1", wrong, "r2", since)
    assert same(right, "r2", wrong, "r1", since)
    for scenario, installer_id in ((exercise, "r1"), (swapped, "r2")):
        first = next(SimulatedScanner(scenario, "dap2", SEED).observations(0))
        assert isinstance(first, SetDown)
        assert first.installer_id == installer_id
    met, still_met = (simulate_meetings(each, "r1", SEED) for each in (exercise, swapped))
    assert np.array_equal(met.rssi_dbm["r2"], still_met.rssi_dbm["r2"], equal_nan=True)


def test_what_was_heard_is_sent_once_more(exercise: Scenario) -> None:
    replayed = faulty(exercise, dap1=Fault(replays_s=8.0))
    as_it_was, now = (simulate_scans(each, "dap1", SEED) for each in (exercise, replayed))
    heard_dbm = as_it_was.rssi_dbm["r1"]
    loudest_s = float(now.time_s[np.nanargmax(heard_dbm)])
    again = np.abs(now.time_s - loudest_s - 8.0) < 1.0
    assert np.nanmax(now.rssi_dbm["r1"][again]) == np.nanmax(heard_dbm)
    louder = np.isnan(heard_dbm) | (now.rssi_dbm["r1"] >= heard_dbm)
    assert louder.all()


def test_a_daps_clock_is_ahead(tmp_path: Path, exercise: Scenario) -> None:
    wrong = faulty(exercise, dap1=Fault(clock_ahead_s=2.0))
    times_ns = []
    for name, scenario in (("right", exercise), ("wrong", wrong)):
        rehearse_dap(scenario, "dap1", SEED, tmp_path / name, sends_rssi=False)
        told = []
        for sent_ns, key_text, payload in read_wire_log(tmp_path / name / "dap1.wire"):
            key = parse_key(key_text)
            assert isinstance(key, Key)
            message = decode(key, payload)
            if isinstance(message, ProximityEvent | Truth):
                told.append((sent_ns, message.event_time_ns))
        times_ns.append(np.array(told))
    later_ns = times_ns[1] - times_ns[0]
    assert (later_ns == [0, 2 * NS_PER_S]).all()


def test_a_dap_carried_off_is_put_back(exercise: Scenario) -> None:
    moved = Fault(since_s=SINCE_S, until_s=20.0, moved_by_m=(0.0, 3.0, 0.0))
    stood, off, back = places_of(faulty(exercise, dap1=moved), "dap1", SEED)
    assert (off.since_s, back.since_s) == (SINCE_S, 20.0)
    assert off.place_m == pytest.approx(stood.place_m + np.array([0.0, 3.0, 0.0]))
    assert np.array_equal(back.place_m, stood.place_m)


def test_two_radios_are_swapped_back(exercise: Scenario) -> None:
    fault = Fault(since_s=SINCE_S, until_s=20.0, swapped_with="r2")
    right, wrong = (
        simulate_scans(each, "dap1", SEED) for each in (exercise, faulty(exercise, r1=fault))
    )
    assert differ(right.rssi_dbm["r1"], wrong.rssi_dbm["r1"]).any()
    back = right.time_s >= 20.0
    assert not differ(right.rssi_dbm["r1"], wrong.rssi_dbm["r1"])[back].any()


def test_who_jams_a_dap_is_heard_instead_of_who_passes(exercise: Scenario) -> None:
    fault = Fault(since_s=SINCE_S, until_s=60.0, jammed=True)
    right, wrong = (
        simulate_scans(each, "dap1", SEED) for each in (exercise, faulty(exercise, dap1=fault))
    )
    is_so = fault.is_so(right.time_s)
    for name, heard_dbm in wrong.rssi_dbm.items():
        assert np.array_equal(heard_dbm[~is_so], right.rssi_dbm[name][~is_so], equal_nan=True)
    jammed_dbm = np.concatenate([heard_dbm[is_so] for heard_dbm in wrong.rssi_dbm.values()])
    assert 0.0 < np.isfinite(jammed_dbm).mean() < 0.5
    assert np.nanmin(jammed_dbm) >= -65.0


def test_a_clock_is_ahead_for_a_while() -> None:
    fault = Fault(since_s=SINCE_S, until_s=20.0, clock_ahead_s=2.0)
    ahead_s = [fault.clock_ahead_at_s(each) for each in (9.0, 10.0, 19.0, 20.0)]
    assert ahead_s == [0.0, 2.0, 2.0, 0.0]


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"since_s": 20.0, "until_s": 20.0}, "after since_s"),
        ({"moved_to_m": ELSEWHERE_M, "moved_by_m": ELSEWHERE_M}, "moved_to_m"),
    ],
)
def test_a_fault_that_cannot_be_is_told(fields: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        Fault(**fields)
