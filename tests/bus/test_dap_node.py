"""A DAP among others: what it says, answers and hears."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from threading import Event, Thread

import pytest

from dap_node.at_work import Company, follow
from dap_node.calibration import CalibrationSettings
from dap_node.node import DapNode
from dap_node.proximity import ProximitySettings
from dap_node.scanners.observation import Scan, SetDown
from dap_node.settings import DapSettings
from shared.bus.interface import Received
from shared.bus.memory import MemoryNetwork
from shared.clock import ManualClock
from shared.codec import encode
from shared.messages import (
    DapInstallation,
    LocalPosition,
    NeighbourHeard,
    ProximityEvent,
    RssiReport,
    StrangerNoticed,
    Truth,
)
from shared.radios.readings import RadioScan, Reading
from shared.strangers import AtLinks
from shared.topics import alive_key, everything_of
from tests.bus.dap_site import (
    PLACE,
    PLACE_KEY,
    R2,
    START_NS,
    STATIONS_KEY,
    TABLE,
    Site,
    at,
    estimate,
    radio_scan,
    scans,
)
from tests.heard import message_in


def installation(sequence: int, position: LocalPosition | None) -> DapInstallation:
    return DapInstallation(
        event_time_ns=START_NS, sequence=sequence, installer_id="r1", position=position
    )


def test_it_says_and_answers_where_it_was_installed(site: Site) -> None:
    assert site.answers() == []
    site.node.take(SetDown(START_NS, "r1", None))
    assert site.said(DapInstallation) == site.answers() == [installation(0, None)]
    site.tell(estimate())
    site.node.take(Scan(at(0.2), {}))
    assert site.said(DapInstallation) == [installation(0, None), installation(1, PLACE)]
    assert site.answers() == [installation(1, PLACE)]
    assert site.node.stage == "placed"


def test_what_it_is_told_again_it_does_not_say_again(site: Site) -> None:
    site.node.take(SetDown(START_NS, "r1", None))
    for _ in range(3):
        site.tell(estimate())
        site.node.take(Scan(at(0.2), {}))
    assert len(site.said(DapInstallation)) == 2


def test_it_reports_every_reading_and_who_is_near(site: Site) -> None:
    site.node.take(SetDown(START_NS, None, PLACE))
    for scan in scans(0.2, 3.0, r1=-42.0, r2=-80.0):
        site.node.take(scan)
    for scan in scans(3.0, 8.0, r2=-80.0):
        site.node.take(scan)
    reports = site.said(RssiReport)
    assert [report.sequence for report in reports] == list(range(len(reports)))
    assert len(reports) == 2 * 14 + 25
    events = site.said(ProximityEvent)
    assert [event.phase for event in events] == ["entered", "near", "near", "left"]
    assert {event.responder_id for event in events} == {"r1"}
    assert [event.sequence for event in events] == list(range(4))
    assert (events[0].event_time_ns, events[0].sample_count) == (at(0.5), 4)
    assert (events[0].rssi_mean_dbm, events[0].rssi_variance_db2) == (-42.0, 0.0)
    assert events[0].range_m is None


def test_one_that_weighs_likelihoods_also_says_how_near_and_how_sure() -> None:
    settings = DapSettings(proximity=ProximitySettings(method="likelihood"))
    site = Site(settings)
    with site.others, site.bus:
        for scan in scans(0.2, 5.0, r1=-36.0):
            site.node.take(scan)
        entered, *_ = site.said(ProximityEvent)
    assert entered.near_log_odds is not None
    assert entered.near_log_odds >= settings.proximity.range.enter_log_odds
    assert entered.range_m is not None
    assert entered.range_sd_m is not None


def test_one_that_is_calibrated_by_its_installer_hears_them_as_near() -> None:
    site = Site(DapSettings(calibration=CalibrationSettings(beside_sd_db=0.5)))
    with site.others, site.bus:
        site.node.take(SetDown(START_NS, "r1", PLACE))
        for scan in scans(0.2, 6.0, r1=-53.0, r2=-53.0):
            site.node.take(scan)
        events = site.said(ProximityEvent)
        reports = site.said(RssiReport)
    assert {event.responder_id for event in events} == {"r1"}
    assert events[-1].rssi_mean_dbm == pytest.approx(-43.0, abs=1.5)
    assert {report.rssi_dbm for report in reports} == {-53.0}


@pytest.mark.parametrize(
    ("key", "payload", "reason"),
    [
        (PLACE_KEY, b"\xc1 no MessagePack", "not_messagepack"),
        (PLACE_KEY, encode(installation(0, None)), "invalid"),
        (PLACE_KEY, bytes(70_000), "too_large"),
    ],
)
def test_garbage_is_counted_and_harmless(site: Site, key: str, payload: bytes, reason: str) -> None:
    site.node.take(SetDown(START_NS, "r1", None))
    site.others.publish(key, payload)
    site.others.publish(key, payload)
    site.tell(estimate())
    site.node.take(Scan(at(0.2), {}))
    assert site.node.refusals == {reason: 2}
    assert site.answers() == [installation(1, PLACE)]
    assert site.bus.handler_failures == 0


def test_estimates_before_it_stands_and_of_other_times_are_passed_over(site: Site) -> None:
    site.tell(estimate())
    site.node.take(SetDown(START_NS, "r1", None))
    site.tell(estimate(time_ns=START_NS + 1))
    site.node.take(Scan(at(0.2), {}))
    assert site.node.stage == "installed"
    assert not site.node.refusals


def test_it_is_alive_until_it_closes(site: Site) -> None:
    token = alive_key("test", "dap", "dap2")
    assert site.alive == [(token, True)]
    site.bus.close()
    assert site.alive == [(token, True), (token, False)]


def test_only_a_simulated_dap_tells_the_truth_now_and_then(site: Site) -> None:
    site.node.take(SetDown(START_NS, "r1", None))
    site.node.take(Scan(at(0.2), {}))
    assert site.said(Truth) == []
    site.node.take(SetDown(at(1.0), "r1", None, truth_m=(1.0, 2.0, -3.0)))
    for scan in scans(1.2, 22.0):
        site.node.take(scan)
    told = site.said(Truth)
    assert [truth.sequence for truth in told] == [0, 1, 2]
    assert {(truth.north_m, truth.east_m, truth.down_m) for truth in told} == {(1.0, 2.0, -3.0)}


def test_it_follows_its_scanner_until_it_is_stopped(site: Site) -> None:
    stop = Event()

    def endless() -> Iterator[Scan]:
        for index in count():
            if index == 3:
                stop.set()
            yield Scan(at(0.2 * index), {"r1": -60.0})

    follow(site.node, endless(), ManualClock(START_NS), stop)
    assert len(site.said(RssiReport)) == 3


def test_it_stays_for_responders_that_are_alive() -> None:
    network = MemoryNetwork()
    with network.connect() as bus, network.connect() as responder:
        company = Company(bus, "test")
        responder.declare_alive(alive_key("test", "responder", "r1"))
        responder.declare_alive(alive_key("elsewhere", "responder", "r1"))
        waiter = Thread(target=company.wait_until_gone, args=(Event(),))
        waiter.start()
        assert waiter.is_alive()
        responder.close()
        waiter.join(20.0)
        assert not waiter.is_alive()


def test_addresses_become_responders_once_a_post_has_told_whose_they_are(site: Site) -> None:
    site.node.take(radio_scan(0.2, x01=-50.0))
    assert site.heard == []
    site.others.publish(STATIONS_KEY, encode(TABLE))
    site.node.take(radio_scan(0.4, x01=-51.0, x7f=-30.0))
    site.node.take(RadioScan(at(0.6), (Reading(R2, -60.0, age_ns=150_000_000),)))
    site.others.publish(STATIONS_KEY, encode(TABLE))
    site.node.take(radio_scan(0.8))
    assert [
        (report.responder_id, report.event_time_ns, report.rssi_dbm)
        for report in site.said(RssiReport)
    ] == [("r1", at(0.4), -51.0), ("r2", at(0.45), -60.0)]
    assert site.kept == [TABLE]


def test_a_dap_that_restarts_knows_the_stations_it_kept() -> None:
    with MemoryNetwork().connect() as bus:
        heard: list[Received] = []
        bus.subscribe(everything_of("test"), heard.append)
        DapNode(bus, "test", "dap2", stations=TABLE).take(radio_scan(0.2, x02=-50.0))
        (report,) = map(message_in, heard)
    assert isinstance(report, RssiReport)
    assert report.responder_id == "r2"


def test_other_daps_are_told_of_every_five_seconds_and_its_own_radio_never(site: Site) -> None:
    site.others.publish(STATIONS_KEY, encode(TABLE))
    for index in range(60):
        site.node.take(radio_scan(0.2 * index, x82=-10.0, x83=-60.0 - index % 2))
    assert site.said(RssiReport) == []
    told = site.said(NeighbourHeard)
    assert [each.event_time_ns for each in told] == [at(5.0), at(10.0)]
    assert {each.dap_id for each in told} == {"dap3"}
    assert [each.sample_count for each in told] == [26, 25]
    assert told[0].rssi_mean_dbm == -60.5
    assert told[0].rssi_variance_db2 == pytest.approx(0.25)


def test_it_tells_the_post_once_whom_its_router_refuses() -> None:
    site = Site()
    at_links = AtLinks({}, {})
    node = DapNode(site.bus, "test", "dap2", at_links=at_links, role_of=lambda _: "responder")
    node.take(Scan(START_NS, {}))
    at_links = AtLinks({"foreign": 3, "broken_off": 1}, {("r1", "r2"): 5})
    node = DapNode(site.bus, "test", "dap2", at_links=at_links, role_of=lambda _: "responder")
    for _ in range(3):
        node.take(Scan(START_NS, {}))
    told = site.said(StrangerNoticed)
    assert [(each.role, each.node_id, each.words) for each in told] == [
        ("responder", "r1", "says what is r2's to say, and is not let"),
        ("dap", "dap2", "a link was refused: who dials has a certificate of another authority"),
    ]
