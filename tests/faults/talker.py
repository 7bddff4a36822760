"""A responder's unit that does nothing but say strides, and keeps them in its journal.

``python -m tests.faults.talker ENDPOINT INCIDENT ID JOURNAL STRIDES_PER_S`` goes on until it is
sent SIGTERM, or killed. With standard input closed it ends as well.
"""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path

from msgspec import structs

from shared.bus.zenoh_bus import ZenohBus
from shared.heartbeat import Heartbeat
from shared.messages import OdometryIncrement
from shared.outbox import JournalledOutbox
from shared.process import configure_logging, stop_on_signals, stop_with_parent
from shared.sender import Sender
from shared.topics import alive_key
from tests.traffic import increment


class Talker:
    """Says strides on a bus, as they happen."""

    def __init__(
        self, bus: ZenohBus, incident: str, node_id: str, outbox: JournalledOutbox
    ) -> None:
        self._bus = bus
        self._sender = Sender(bus, incident, "responder", node_id, outbox)
        self.heartbeat = Heartbeat(bus, incident, "responder", node_id, outbox)
        bus.declare_alive(alive_key(incident, "responder", node_id))

    def say(self) -> None:
        """Say a stride that ends now."""
        number = self._sender.next_sequence(OdometryIncrement)
        stride = structs.replace(increment(number), event_time_ns=time.time_ns())
        self._sender.send(stride)

    def talk(self, strides_per_s: float, stop: threading.Event) -> None:
        """Say strides until ``stop`` is set."""
        while not stop.wait(1.0 / strides_per_s):
            self.say()


def main(endpoint: str, incident: str, node_id: str, journal: str, strides_per_s: str) -> None:
    """Talk until told to stop."""
    configure_logging("warning")
    with (
        stop_on_signals() as stop,
        JournalledOutbox(Path(journal)) as outbox,
        ZenohBus("client", [endpoint], []) as bus,
    ):
        stop_with_parent(stop)
        talker = Talker(bus, incident, node_id, outbox)
        with talker.heartbeat:
            talker.talk(float(strides_per_s), stop)


if __name__ == "__main__":
    main(*sys.argv[1:])
