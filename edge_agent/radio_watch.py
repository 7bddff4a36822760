"""Which DAPs a unit's own radio passes, and which other units it meets (pure).

Some radios see the links of a network from this side only.
"""

from __future__ import annotations

from typing import NamedTuple

from edge_agent.contacts import ContactWatch
from shared.messages import NodeId, StationTable
from shared.radios.hearing import Heard, Hearing
from shared.radios.readings import RadioScan
from shared.rssi_peaks import Peak, PeakSettings


class Passed(NamedTuple):
    """What a scan gave: readings of DAPs, and peaks of DAPs and of responders that are over."""

    readings: tuple[Heard, ...]
    daps: tuple[Peak, ...]
    responders: tuple[Peak, ...]


class RadioWatch:
    """Takes what the unit's radio hears, and says when each was loudest.

    ``offset_db`` is added to all readings: it brings those of a DAP at a clear metre to -40 dBm.
    """

    def __init__(
        self, responder_id: NodeId, table: StationTable | None = None, offset_db: float = 0.0
    ) -> None:
        self._hearing = Hearing("responder", responder_id, table)
        self._offset_db = offset_db
        self._daps = ContactWatch(PeakSettings())
        self._responders = ContactWatch(PeakSettings())

    def learn(self, table: StationTable) -> bool:
        """Take in whose radio is whose; say whether that is news."""
        return self._hearing.learn(table)

    def take(self, scan: RadioScan) -> Passed:
        """Take in what was heard; times of scans must not go back."""
        readings = []
        for heard in self._hearing.sort_out(scan):
            is_dap = heard.role == "dap"
            watch = self._daps if is_dap else self._responders
            watch.hear(heard.time_ns, heard.node_id, heard.rssi_dbm + self._offset_db)
            if is_dap:
                readings.append(heard)
        return Passed(
            tuple(readings),
            tuple(self._daps.pass_time(scan.time_ns)),
            tuple(self._responders.pass_time(scan.time_ns)),
        )
