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
from dap_node.scanners.observation import Motion, Scan, SetDown
from dap_node.self_installation import SelfInstallation
from dap_node.settings import DapSettings
from shared.bus.interface import Received
from shared.bus.memory import MemoryBus, MemoryNetwork
from shared.clock import ManualClock
from shared.codec import Refusal, decode, encode, parse_key
from shared.messages import (
    DapEstimate,
    DapInstallation,
    LocalPosition,
    Message,
    NeighbourHeard,
    ProximityEvent,
    RssiReport,
    SetDownHere,
    StationTable,
    StrangerNoticed,
    Truth,
)
from shared.radios.readings import RadioScan, Reading
from shared.strangers import AtLinks
from shared.topics import alive_key, everything_of
from shared.units import NS_PER_S

START_NS = 1_700_000_000 * NS_PER_S
PLACE = LocalPosition(north_m=5.0, east_m=20.0, down_m=0.0, covariance_m2=(0.5, 0.1, 0.4))
INSTALLATION_KEY = "clew/v1/test/dap/dap2/installation"
PLACE_KEY = "clew/v1/test/post/post/dap_place"


class Site:
    """A DAP on a network of its own, and somebody who hears all that is said there."""

    def __init__(self, settings: DapSettings | None = None) -> None:
        network = MemoryNetwork()
        self.others: MemoryBus = network.connect()
        self.heard: list[Received] = []
        self.alive: list[tuple[str, bool]] = []
        self.others.subscribe(everything_of("test"), self.heard.append)
        self.others.watch_alive(
            "clew/v1/test/*/*/alive", lambda key, is_alive: self.alive.append((key, is_alive))
        )
        self.bus = network.connect()
        self.kept: list[StationTable] = []
        self.node = DapNode(self.bus, "test", "dap2", settings, keep_stations=self.kept.append)

    def said(self, kind: type[Message]) -> list[Message]:
        """Return all that the DAP has said of one kind."""
        return [message for message in map(decoded, self.heard) if type(message) is kind]

    def answers(self) -> list[Message]:
        """Return what queries for the installation give."""
        return [decoded(answer) for answer in self.others.query(INSTALLATION_KEY, 1.0)]

    def tell(self, estimate: DapEstimate) -> None:
        """Publish an estimate as a post does."""
        self.others.publish(PLACE_KEY, encode(estimate))


def decoded(received: Received) -> Message:
    key = parse_key(received.key)
    assert not isinstance(key, Refusal)
    message = decode(key, received.payload)
    assert not isinstance(message, Refusal)
    return message


def at(time_s: float) -> int:
    return START_NS + round(time_s * NS_PER_S)


def scans(from_s: float, until_s: float, **rssi_dbm: float) -> Iterator[Scan]:
    for index in range(round((until_s - from_s) / 0.2)):
        yield Scan(at(from_s + 0.2 * index), rssi_dbm)


def estimate(position: LocalPosition = PLACE, time_ns: int = START_NS) -> DapEstimate:
    return DapEstimate(event_time_ns=time_ns, sequence=0, dap_id="dap2", position=position)


@pytest.fixture
def site() -> Iterator[Site]:
    site = Site()
    with site.others, site.bus:
        yield site


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
    events = [event for event in site.said(ProximityEvent) if isinstance(event, ProximityEvent)]
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
    assert isinstance(entered, ProximityEvent)
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
        events = [event for event in site.said(ProximityEvent) if isinstance(event, ProximityEvent)]
        reports = site.said(RssiReport)
    assert {event.responder_id for event in events} == {"r1"}
    assert events[-1].rssi_mean_dbm == pytest.approx(-43.0, abs=1.5)
    assert {report.rssi_dbm for report in reports if isinstance(report, RssiReport)} == {-53.0}


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
    told = [truth for truth in site.said(Truth) if isinstance(truth, Truth)]
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


R1, R2, DAP2, DAP3 = (f"02:00:5e:10:00:{last}" for last in ("01", "02", "82", "83"))
TABLE = StationTable(
    event_time_ns=START_NS,
    sequence=0,
    responders=((R1, "r1"), (R2, "r2")),
    daps=((DAP2, "dap2"), (DAP3, "dap3")),
)
STATIONS_KEY = "clew/v1/test/post/post/stations"


def radio_scan(time_s: float, **dbm: float) -> RadioScan:
    """Return a scan by the last byte of each address, as in ``x01=-50.0``."""
    return RadioScan(
        at(time_s),
        tuple(Reading(f"02:00:5e:10:00:{name[1:]}", rssi) for name, rssi in dbm.items()),
    )


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
        if isinstance(report, RssiReport)
    ] == [("r1", at(0.4), -51.0), ("r2", at(0.45), -60.0)]
    assert site.kept == [TABLE]


def test_a_dap_that_restarts_knows_the_stations_it_kept() -> None:
    with MemoryNetwork().connect() as bus:
        heard: list[Received] = []
        bus.subscribe(everything_of("test"), heard.append)
        DapNode(bus, "test", "dap2", stations=TABLE).take(radio_scan(0.2, x02=-50.0))
        (report,) = map(decoded, heard)
    assert isinstance(report, RssiReport)
    assert report.responder_id == "r2"


def test_other_daps_are_told_of_every_five_seconds_and_its_own_radio_never(site: Site) -> None:
    site.others.publish(STATIONS_KEY, encode(TABLE))
    for index in range(60):
        site.node.take(radio_scan(0.2 * index, x82=-10.0, x83=-60.0 - index % 2))
    assert site.said(RssiReport) == []
    told = [each for each in site.said(NeighbourHeard) if isinstance(each, NeighbourHeard)]
    assert [each.event_time_ns for each in told] == [at(5.0), at(10.0)]
    assert {each.dap_id for each in told} == {"dap3"}
    assert [each.sample_count for each in told] == [26, 25]
    assert told[0].rssi_mean_dbm == -60.5
    assert told[0].rssi_variance_db2 == pytest.approx(0.25)


def set_down(dap_id: str, position: LocalPosition | None) -> bytes:
    return encode(SetDownHere(event_time_ns=START_NS, sequence=0, dap_id=dap_id, position=position))


def test_told_that_it_stands_it_is_installed_by_whom_told_it(site: Site) -> None:
    orders = [("responder/r7", "dap3", None), ("responder/r7", "dap2", None),
              ("post/commander", "dap2", PLACE)]  # fmt: skip
    stages = []
    for number, (who, dap_id, position) in enumerate(orders, 1):
        site.others.publish(f"clew/v1/test/{who}/set_down", set_down(dap_id, position))
        site.node.take(radio_scan(0.2 * number))
        stages.append(site.node.stage)
    assert stages == ["carried", "installed", "placed"]
    assert site.said(DapInstallation) == [
        DapInstallation(event_time_ns=at(0.4), sequence=0, installer_id="r7", position=None),
        DapInstallation(event_time_ns=at(0.6), sequence=1, installer_id=None, position=PLACE),
    ]


def test_said_again_it_is_not_set_down_again(site: Site) -> None:
    for time_s in (0.2, 0.4):
        site.others.publish("clew/v1/test/responder/r7/set_down", set_down("dap2", None))
        site.node.take(radio_scan(time_s))
    assert len(site.said(DapInstallation)) == 1


class Box:
    """A DAP that hears and feels for itself whether it was set down."""

    def __init__(self) -> None:
        network = MemoryNetwork()
        self.heard: list[Received] = []
        self.places: list[bytes | None] = []
        network.connect().subscribe(everything_of("test"), self.heard.append)
        self.node = DapNode(
            network.connect(), "test", "dap2", stations=TABLE, watch=SelfInstallation(),
            keep_place=self.places.append, sends_rssi=False,
        )  # fmt: skip
        self.time_s = 0.0

    def spend(self, seconds: float, dbm: float, swing_m_s2: float) -> None:
        """Pass time with r1 so loud, moved so much."""
        for _ in range(round(seconds * 5)):
            self.time_s += 0.2
            self.node.take(radio_scan(self.time_s, x01=dbm))
            samples = tuple(
                (at(self.time_s - 0.16 + 0.04 * n), (0.0, swing_m_s2 * (-1) ** n, -9.81))
                for n in range(5)
            )
            self.node.take(Motion(at(self.time_s), samples))

    def installations(self) -> list[DapInstallation]:
        """Return all that it said of its place."""
        found = map(decoded, self.heard)
        return [message for message in found if isinstance(message, DapInstallation)]


def test_it_says_by_itself_that_it_was_set_down_and_taken_up() -> None:
    box = Box()
    box.spend(10.0, dbm=-40.0, swing_m_s2=2.0)
    box.spend(5.0, dbm=-40.0, swing_m_s2=0.0)
    box.spend(10.0, dbm=-65.0, swing_m_s2=0.0)
    (down,) = box.installations()
    assert (down.installer_id, down.position) == ("r1", None)
    assert abs(down.event_time_ns - at(10.0)) < NS_PER_S
    assert box.places[-1] is not None
    told = len(box.heard)
    box.spend(10.0, dbm=-40.0, swing_m_s2=2.0)
    _, up = box.installations()
    assert (up.installer_id, up.position) == (None, None)
    assert box.node.stage == "carried"
    assert box.places[-1] is None
    # Who carries it is near it, which says nothing.
    carried = [type(decoded(each)) for each in box.heard[told:]]
    assert carried.count(ProximityEvent) <= 2
    before = len(box.heard)
    box.spend(5.0, dbm=-40.0, swing_m_s2=2.0)
    assert len(box.heard) == before


def test_swept_along_it_lies_still_again_and_is_to_be_found_by_who_passes() -> None:
    box = Box()
    box.spend(10.0, dbm=-40.0, swing_m_s2=2.0)
    box.spend(15.0, dbm=-65.0, swing_m_s2=0.0)
    box.spend(10.0, dbm=-75.0, swing_m_s2=2.0)
    box.spend(30.0, dbm=-75.0, swing_m_s2=0.0)
    *_, up, lies = box.installations()
    assert (up.at_rest, lies.at_rest, lies.installer_id, lies.position) == (False, True, None, None)
    assert abs(lies.event_time_ns - at(35.0)) < NS_PER_S
    assert box.node.stage == "installed"
    again = DapNode(MemoryNetwork().connect(), "test", "dap2", sends_rssi=False)
    said = box.places[-1]
    assert said is not None
    again.go_on(said)
    assert again.stage == "installed"
    told = len(box.heard)
    box.spend(5.0, dbm=-42.0, swing_m_s2=0.0)
    assert ProximityEvent in {type(decoded(each)) for each in box.heard[told:]}


def test_a_button_says_that_who_is_loudest_set_it_down() -> None:
    box = Box()
    box.node.take(SetDown(at(0.1), None, None))
    assert box.installations() == []
    for number in range(10):
        box.node.take(radio_scan(0.2 * number, x01=-60.0, x02=-50.0))
    box.node.take(SetDown(at(2.0), None, None))
    (said,) = box.installations()
    assert said.installer_id == "r2"


def test_it_tells_the_post_once_whom_its_router_refuses() -> None:
    site = Site()
    at_links = AtLinks({}, {})
    node = DapNode(site.bus, "test", "dap2", at_links=at_links, role_of=lambda _: "responder")
    node.take(Scan(START_NS, {}))
    at_links = AtLinks({"foreign": 3, "broken_off": 1}, {("r1", "r2"): 5})
    node = DapNode(site.bus, "test", "dap2", at_links=at_links, role_of=lambda _: "responder")
    for _ in range(3):
        node.take(Scan(START_NS, {}))
    told = [each for each in site.said(StrangerNoticed) if isinstance(each, StrangerNoticed)]
    assert [(each.role, each.node_id, each.words) for each in told] == [
        ("responder", "r1", "says what is r2's to say, and is not let"),
        ("dap", "dap2", "a link was refused: who dials has a certificate of another authority"),
    ]
