"""Somebody at the post who hears strides, collects what is missed, and notes how late each came."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, Self

from shared.bus.inbox import Inbox
from shared.bus.interface import Bus, Received
from shared.codec import Refusal, decode, parse_key
from shared.collector import Collector
from shared.gate import Gate, JournalRun, Missing
from shared.journal import Journal
from shared.messages import OdometryIncrement
from shared.topics import everything_of
from shared.units import NS_PER_S


class Came(NamedTuple):
    """A stride that was let in: when, how late, and whether it came live."""

    at_s: float
    late_s: float
    live: bool


class Hearing:
    """Hears everything of an incident; ``came`` is what was let in of each node, as it came."""

    def __init__(self, bus: Bus, incident: str) -> None:
        self.gate = Gate()
        self.came: dict[str, dict[bytes, Came]] = {}
        self._incident = incident
        self.again: Counter[str] = Counter()
        """Strides that were let in twice, by node: there must be none."""

        self._lock = threading.Lock()
        self._inbox: Inbox[tuple[Received, bool]] = Inbox(100_000)
        self.collector = Collector(
            bus, incident, self.missing, lambda received: self._inbox.put((received, False))
        )
        bus.subscribe(everything_of(incident), lambda received: self._inbox.put((received, True)))
        self._stop = threading.Event()
        self._threads = [
            threading.Thread(target=self._hear),
            threading.Thread(target=self.collector.run, args=(self._stop,)),
        ]

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join()

    def missing(self, behind: Mapping[JournalRun, int]) -> list[Missing]:
        """Say what has not come, to any thread."""
        with self._lock:
            return self.gate.missing(behind)

    def count(self, node_id: str) -> int:
        """Return how many strides of a node have come."""
        return len(self.came.get(node_id, ()))

    def has_heard(self, node_id: str, count: int) -> bool:
        """Say whether so many strides of a node have come."""
        return self.count(node_id) >= count

    def lateness_s(self, since_s: float, until_s: float, *, live: bool) -> list[float]:
        """Return how late strides were that came between two times (monotonic)."""
        every = [came for of_node in self.came.values() for came in tuple(of_node.values())]
        return [c.late_s for c in every if since_s <= c.at_s <= until_s and c.live == live]

    def refilled_s(self) -> float:
        """Return when the last stride came that had been missed (monotonic)."""
        every = [came for of_node in self.came.values() for came in tuple(of_node.values())]
        return max(came.at_s for came in every if not came.live)

    def assert_has_all_of(self, journals: Mapping[str, Path]) -> int:
        """Check that what is in each node's journal has come, once; return how much that is."""
        assert not self.again
        total = 0
        for node_id, path in journals.items():
            said = strides_in(path)
            assert said == set(self.came[node_id]), node_id
            total += len(said)
        return total

    def _hear(self) -> None:
        while not self._stop.is_set():
            for received, live in self._inbox.get_all(0.05):
                with self._lock:
                    why = self.gate.admit(*received)
                if why is None:
                    self._note(received, live)

    def _note(self, received: Received, live: bool) -> None:
        key = parse_key(received.key)
        if isinstance(key, Refusal):
            return
        message = decode(key, received.payload)
        if not isinstance(message, OdometryIncrement):
            return
        late_s = (time.time_ns() - message.event_time_ns) / NS_PER_S
        of_node = self.came.setdefault(key.node_id, {})
        self.again[key.node_id] += received.payload in of_node
        self.again = +self.again
        of_node[received.payload] = Came(time.monotonic(), late_s, live)


def strides_in(path: Path) -> set[bytes]:
    """Return the strides that a journal holds, which nobody has open, as they were said."""
    journal = Journal(path)
    rows = journal.rows(1, 2**62, 10**9, 10**12)
    journal.close()
    return {row.payload for row in rows if row.key.endswith("/increment")}
