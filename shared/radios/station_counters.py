"""From what a driver knows of its stations to what was heard of them (pure).

A driver goes on giving the last signal of a station that has long been silent. So one poll is one
sample, and only of the stations whose counters have moved since the poll before.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from shared.messages import StationAddress
from shared.radios.readings import Reading
from shared.units import NS_PER_MS


class Polled(NamedTuple):
    """What a driver knows of one station; ``None`` and empty are what it does not tell.

    ``signal_dbm`` is of the last frame, ``counters`` what is counted of those received.
    """

    address: StationAddress
    counters: tuple[int, ...]
    signal_dbm: float | None = None
    average_dbm: float | None = None
    chains_dbm: tuple[float, ...] = ()
    inactive_ms: int = 0


class StationCounters:
    """Remembers the counters of the poll before. The first poll has nothing to compare with."""

    def __init__(self) -> None:
        self._before: dict[StationAddress, tuple[int, ...]] | None = None

    def readings(self, polled: Iterable[Polled]) -> tuple[Reading, ...]:
        """Return what was heard since the last call, of a poll of all stations.

        Who was not there before has been heard: they came. Where a frame has no signal the running
        mean stands for it; who has neither is left out.
        """
        before, self._before = self._before, {}
        heard = []
        for station in polled:
            self._before[station.address] = station.counters
            if before is None or before.get(station.address) == station.counters:
                continue
            rssi_dbm = station.average_dbm if station.signal_dbm is None else station.signal_dbm
            if rssi_dbm is not None:
                heard.append(_reading(station, rssi_dbm))
        return tuple(heard)

    def forget(self) -> None:
        """Begin anew: the radio has been away, and counts from somewhere else."""
        self._before = None


def known_dbm(value: float | None) -> float | None:
    """Return a signal strength (dBm) if it can be one: drivers say 0 where they know none."""
    return value if value is not None and -120.0 <= value < 0.0 else None


def _reading(station: Polled, rssi_dbm: float) -> Reading:
    return Reading(
        station.address, rssi_dbm, station.inactive_ms * NS_PER_MS,
        station.average_dbm, station.chains_dbm,
    )  # fmt: skip
