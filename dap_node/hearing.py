"""Whom the DAP hears: the addresses of a scan become responders and DAPs, by the table (pure).

Who is not in the table is nobody's business: strangers are counted, and told to no one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from dap_node.scanners.observation import RadioScan
from shared.messages import NodeId, StationAddress, StationTable
from shared.rssi_window import Readings, Summary, sum_up
from shared.stations import Stations
from shared.topics import Role
from shared.units import NS_PER_S

OLDEST_NS = NS_PER_S
"""A reading said to be older is taken to be so old: counters that moved are younger."""

MOST_STRANGERS = 4096
"""Strangers that are told apart; what is beyond is not counted."""

NEIGHBOUR_PERIOD_NS = 5 * NS_PER_S


class Heard(NamedTuple):
    """A reading of the signal strength of a responder or a DAP."""

    time_ns: int
    role: Role
    node_id: NodeId
    rssi_dbm: float


class Hearing:
    """Knows whose radio is whose, as far as it was told."""

    def __init__(self, dap_id: NodeId, table: StationTable | None = None) -> None:
        self._own = ("dap", dap_id)
        self._table = table
        self._stations = Stations(table)
        self._strangers: set[StationAddress] = set()

    @property
    def strangers(self) -> int:
        """How many radios were heard that are nobody's in the table."""
        return len(self._strangers)

    def learn(self, table: StationTable) -> bool:
        """Take in a table in place of the one before; say whether it differs."""
        known = self._table
        if known is not None and (known.responders, known.daps) == (table.responders, table.daps):
            return False
        self._table, self._stations = table, Stations(table)
        self._strangers.clear()
        return True

    def sort_out(self, scan: RadioScan) -> Iterator[Heard]:
        """Yield what was heard of whom; of this DAP's own radios nothing."""
        for reading in scan.readings:
            owner = self._stations.whose(*reading.names)
            if owner is not None and owner != self._own:
                yield Heard(scan.time_ns - min(reading.age_ns, OLDEST_NS), *owner, reading.rssi_dbm)
            elif owner is None and len(self._strangers) < MOST_STRANGERS:
                self._strangers.add(reading.address)


class Neighbour(NamedTuple):
    """Another DAP, and what was heard of it."""

    dap_id: NodeId
    heard: Summary


class NeighbourWatch:
    """Sums up what is heard of other DAPs, every five seconds."""

    def __init__(self) -> None:
        self._readings: dict[NodeId, Readings] = {}
        self._due_ns: int | None = None

    def hear(self, time_ns: int, dap_id: NodeId, rssi_dbm: float) -> None:
        """Take in a reading."""
        self._readings.setdefault(dap_id, Readings()).add(time_ns, rssi_dbm)

    def tick(self, now_ns: int) -> list[Neighbour]:
        """Return what there is to tell, by DAP. ``now_ns`` must not go back."""
        if self._due_ns is None:
            self._due_ns = now_ns + NEIGHBOUR_PERIOD_NS
        if now_ns < self._due_ns:
            return []
        since_ns, self._due_ns = self._due_ns - NEIGHBOUR_PERIOD_NS, now_ns + NEIGHBOUR_PERIOD_NS
        heard, self._readings = self._readings, {}
        windows = {
            dap_id: readings.between(since_ns - OLDEST_NS, now_ns)
            for dap_id, readings in sorted(heard.items())
        }
        return [Neighbour(dap_id, sum_up(window)) for dap_id, window in windows.items() if window]
