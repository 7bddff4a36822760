"""The unit's own radio, listened to on a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Self

import structlog

from edge_agent.drop_desk import Beacon, DropDesk
from edge_agent.radio_watch import RadioWatch
from shared.bus.inbox import Inbox
from shared.bus.interface import Received
from shared.codec import Refusal, decode, parse_key
from shared.gate import Gate
from shared.kept_stations import KeptStations
from shared.messages import Contact, DapPeak, DapReading, StationTable
from shared.node import Node
from shared.radios.live import LiveSource, gathered
from shared.radios.readings import RadioScan
from shared.topics import Key

TICK_S = 0.25
MOST_TABLES = 16

_log = structlog.stdlib.get_logger(__name__)


class RadioDesk:
    """Says which DAPs the wearer passes and whom they meet, as the unit's radio hears them.

    The ``drop_desk`` of a wearer who carries DAPs hears how loud each is, too. Without sources it
    does nothing.
    """

    def __init__(
        self,
        node: Node,
        sources: Sequence[LiveSource[RadioScan]],
        kept: KeptStations,
        offset_db: float = 0.0,
        drop_desk: DropDesk | None = None,
    ) -> None:
        """``offset_db`` is added to what is heard: see ``RadioWatch``."""
        self._sources = sources
        self._offset_db = offset_db
        self._drop_desk = drop_desk
        self._kept = kept
        self._clock = node.clock
        self._sender = node.sender()
        self._gate = Gate(node.verifier)
        self._watch = RadioWatch(node.node_id, kept.load(), offset_db)
        self._inbox: Inbox[Received] = Inbox(MOST_TABLES)
        self._last_ns = 0
        self._stop = threading.Event()
        # No daemon: it is inside Zenoh when it speaks.
        self._thread = threading.Thread(target=self._run, name="radio", daemon=False)
        if sources:
            node.bus.subscribe(str(Key(node.incident, "post", "*", "stations")), self._inbox.put)

    def __enter__(self) -> Self:
        if self._sources:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        if self._sources:
            self._thread.join()

    def take(self, scan: RadioScan | None) -> None:
        """Take in a scan, or that there was none, after what posts have told; say what follows."""
        for received in self._inbox.get_all():
            self._heed(received)
        scan = scan or RadioScan(self._clock.now_ns(), ())
        self._last_ns = max(self._last_ns, scan.time_ns)
        passed = self._watch.take(scan._replace(time_ns=self._last_ns))
        for heard in passed.readings:
            if self._drop_desk is not None:
                calibrated_dbm = heard.rssi_dbm + self._offset_db
                self._drop_desk.hear(Beacon(heard.time_ns, heard.node_id, calibrated_dbm))
            number = self._sender.next_sequence(DapReading)
            self._sender.send(
                DapReading(
                    event_time_ns=heard.time_ns, sequence=number,
                    dap_id=heard.node_id, rssi_dbm=heard.rssi_dbm,
                )
            )  # fmt: skip
        for peak in passed.daps:
            number = self._sender.next_sequence(DapPeak)
            self._sender.send(
                DapPeak(
                    event_time_ns=peak.time_ns, sequence=number, dap_id=peak.station_id,
                    peak_dbm=peak.peak_dbm, width_s=peak.width_s, sample_count=peak.sample_count,
                )
            )  # fmt: skip
        for peak in passed.responders:
            number = self._sender.next_sequence(Contact)
            self._sender.send(
                Contact(
                    event_time_ns=peak.time_ns, sequence=number, other_id=peak.station_id,
                    peak_dbm=peak.peak_dbm, width_s=peak.width_s, sample_count=peak.sample_count,
                )
            )  # fmt: skip

    def _run(self) -> None:
        for scan in gathered(self._sources, self._clock.now_ns, self._stop, TICK_S):
            self.take(scan)

    def _heed(self, received: Received) -> None:
        key = parse_key(received.key)
        if isinstance(key, Refusal) or self._gate.admit(*received) is not None:
            return
        table = decode(key, received.payload)
        if isinstance(table, StationTable) and self._watch.learn(table):
            self._kept.keep(table)
            _log.info("stations", responders=len(table.responders), daps=len(table.daps))
