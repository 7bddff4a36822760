"""Whom a radio hears: the addresses of a scan become responders and DAPs, by the table (pure).

Who is not in the table is nobody's business: strangers are counted, and told to no one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from shared.messages import NodeId, StationAddress, StationTable
from shared.radios.readings import RadioScan
from shared.stations import Stations
from shared.topics import Role
from shared.units import NS_PER_S

OLDEST_NS = NS_PER_S
"""A reading said to be older is taken to be so old: counters that moved are younger."""

MOST_STRANGERS = 4096
"""Strangers that are told apart; what is beyond is not counted."""


class Heard(NamedTuple):
    """A reading of the signal strength of a responder or a DAP."""

    time_ns: int
    role: Role
    node_id: NodeId
    rssi_dbm: float


class Hearing:
    """Knows whose radio is whose, as far as it was told."""

    def __init__(self, role: Role, node_id: NodeId, table: StationTable | None = None) -> None:
        """``role`` and ``node_id`` are whose radio hears."""
        self._own = (role, node_id)
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
        """Yield what was heard of whom; of the hearer's own radios nothing."""
        for reading in scan.readings:
            owner = self._stations.whose(*reading.names)
            if owner is not None and owner != self._own:
                yield Heard(scan.time_ns - min(reading.age_ns, OLDEST_NS), *owner, reading.rssi_dbm)
            elif owner is None and len(self._strangers) < MOST_STRANGERS:
                self._strangers.add(reading.address)
