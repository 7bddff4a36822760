"""A unit's radio, once a post has told it whose radios are whose."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from threading import Event

from edge_agent.radio_desk import RadioDesk
from shared.bus.interface import Received
from shared.bus.zenoh_bus import open_zenoh
from shared.clock import PacedClock, SystemClock
from shared.codec import encode
from shared.kept_stations import KeptStations
from shared.messages import DapPeak, DapReading, StationTable
from shared.node import Node
from shared.outbox import JournalledOutbox
from shared.radios.readings import RadioScan, Reading
from shared.units import NS_PER_S
from tests.heard import message_in
from tests.waiting import wait_for

DAP = "02:00:5e:10:00:81"
TABLE = StationTable(event_time_ns=5, sequence=0, responders=(), daps=((DAP, "d1"),))
START_NS = 1_700_000_000 * NS_PER_S
LEVELS = [-70, -60, -50, -43, -50, -60, -70, -76, -76]


class PassingBy:
    """A radio that hears a DAP pass, again and again."""

    name = "script"
    is_away = False

    def listen(
        self, deliver: Callable[[RadioScan], None], now_ns: Callable[[], int], stop: Event
    ) -> None:
        """Deliver scans, in a hurry, by a clock of its own."""
        time_ns = now_ns()
        while not stop.is_set():
            for dbm in LEVELS:
                for _ in range(4):
                    time_ns += NS_PER_S // 5
                    deliver(RadioScan(time_ns, (Reading(DAP, float(dbm)),)))
                    stop.wait(0.002)


def test_it_tells_which_daps_it_passes(tmp_path: Path) -> None:
    journal = tmp_path / "r1.journal"
    heard: dict[str, list[Received]] = {"dap_rssi": [], "dap_peak": []}
    with (
        open_zenoh("router", listen=["tcp/127.0.0.1:0"]) as post,
        open_zenoh("client", post.locators()) as bus,
        JournalledOutbox(journal) as outbox,
    ):
        node = Node(
            bus, "fire", "responder", "r1", outbox, None, PacedClock(SystemClock()), START_NS,
            Event(),
        )  # fmt: skip
        for topic, found in heard.items():
            post.subscribe(f"clew/v1/fire/responder/r1/{topic}", found.append)
        with RadioDesk(node, [PassingBy()], KeptStations(journal)):
            key = "clew/v1/fire/post/post/stations"

            def told() -> bool:
                post.publish(key, encode(TABLE))
                return bool(heard["dap_peak"])

            wait_for(told, "a peak")
    peak, reading = (message_in(heard[topic][0]) for topic in ("dap_peak", "dap_rssi"))
    assert isinstance(peak, DapPeak)
    assert isinstance(reading, DapReading)
    assert peak.dap_id == reading.dap_id == "d1"
    assert peak.peak_dbm > -50.0
    assert KeptStations(journal).load() == TABLE
