"""A DAP on a network of its own, and what is said to it and heard of it there."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

from dap_node.node import DapNode
from dap_node.scanners.observation import Scan
from dap_node.settings import DapSettings
from shared.bus.interface import Received
from shared.bus.memory import MemoryBus, MemoryNetwork
from shared.codec import encode
from shared.messages import (
    DapEstimate,
    LocalPosition,
    Message,
    StationTable,
)
from shared.radios.readings import RadioScan, Reading
from shared.topics import everything_of
from shared.units import NS_PER_S
from tests.heard import message_in

START_NS = 1_700_000_000 * NS_PER_S
PLACE = LocalPosition(north_m=5.0, east_m=20.0, down_m=0.0, covariance_m2=(0.5, 0.1, 0.4))
INSTALLATION_KEY = "clew/v1/test/dap/dap2/installation"
PLACE_KEY = "clew/v1/test/post/post/dap_place"

R1, R2, DAP2, DAP3 = (f"02:00:5e:10:00:{last}" for last in ("01", "02", "82", "83"))
TABLE = StationTable(
    event_time_ns=START_NS,
    sequence=0,
    responders=((R1, "r1"), (R2, "r2")),
    daps=((DAP2, "dap2"), (DAP3, "dap3")),
)
STATIONS_KEY = "clew/v1/test/post/post/stations"

Said = TypeVar("Said")


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

    def said(self, kind: type[Said]) -> list[Said]:
        """Return all that the DAP has said of one kind."""
        return [message for message in map(message_in, self.heard) if isinstance(message, kind)]

    def answers(self) -> list[Message]:
        """Return what queries for the installation give."""
        return [message_in(answer) for answer in self.others.query(INSTALLATION_KEY, 1.0)]

    def tell(self, estimate: DapEstimate) -> None:
        """Publish an estimate as a post does."""
        self.others.publish(PLACE_KEY, encode(estimate))


def at(time_s: float) -> int:
    return START_NS + round(time_s * NS_PER_S)


def scans(from_s: float, until_s: float, **rssi_dbm: float) -> Iterator[Scan]:
    for index in range(round((until_s - from_s) / 0.2)):
        yield Scan(at(from_s + 0.2 * index), rssi_dbm)


def estimate(position: LocalPosition = PLACE, time_ns: int = START_NS) -> DapEstimate:
    return DapEstimate(event_time_ns=time_ns, sequence=0, dap_id="dap2", position=position)


def radio_scan(time_s: float, **dbm: float) -> RadioScan:
    """Return a scan by the last byte of each address, as in ``x01=-50.0``."""
    return RadioScan(
        at(time_s),
        tuple(Reading(f"02:00:5e:10:00:{name[1:]}", rssi) for name, rssi in dbm.items()),
    )
