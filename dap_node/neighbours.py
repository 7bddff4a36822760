"""Other DAPs that are heard (pure)."""

from __future__ import annotations

from typing import NamedTuple

from shared.messages import NodeId
from shared.radios.hearing import OLDEST_NS
from shared.rssi_window import Readings, Summary, sum_up
from shared.units import NS_PER_S

NEIGHBOUR_PERIOD_NS = 5 * NS_PER_S


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
