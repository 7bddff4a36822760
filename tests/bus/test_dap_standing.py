"""How a DAP comes to stand: it is told so, its button is pressed, or it finds out by itself."""

from __future__ import annotations

from dap_node.node import DapNode
from dap_node.scanners.observation import Motion, SetDown
from dap_node.self_installation import SelfInstallation
from shared.bus.interface import Received
from shared.bus.memory import MemoryNetwork
from shared.codec import encode
from shared.messages import (
    DapInstallation,
    LocalPosition,
    ProximityEvent,
    SetDownHere,
)
from shared.topics import everything_of
from shared.units import NS_PER_S
from tests.bus.dap_site import (
    PLACE,
    START_NS,
    TABLE,
    Site,
    at,
    radio_scan,
)
from tests.heard import message_in


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
        found = map(message_in, self.heard)
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
    carried = [type(message_in(each)) for each in box.heard[told:]]
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
    assert ProximityEvent in {type(message_in(each)) for each in box.heard[told:]}


def test_a_button_says_that_who_is_loudest_set_it_down() -> None:
    box = Box()
    box.node.take(SetDown(at(0.1), None, None))
    assert box.installations() == []
    for number in range(10):
        box.node.take(radio_scan(0.2 * number, x01=-60.0, x02=-50.0))
    box.node.take(SetDown(at(2.0), None, None))
    (said,) = box.installations()
    assert said.installer_id == "r2"
