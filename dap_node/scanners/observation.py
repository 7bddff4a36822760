"""What a scanner reports, in the order of time, whatever the radio."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

from shared.messages import LocalPosition, NodeId, StationAddress, Vector3


class ScannerError(ValueError):
    """A source cannot be used. The text names it, what is wrong, and what to do."""


class Scan(NamedTuple):
    """One look at all stations: the signal strength of each that was heard, maybe of none.

    A DAP knows no time but that of its scans, so a scanner reports them steadily.
    """

    time_ns: int
    rssi_dbm: Mapping[NodeId, float]


class Reading(NamedTuple):
    """The signal strength of a radio, and how long before the scan it was heard.

    ``average_dbm`` is the driver's running mean, ``chains_dbm`` is what each antenna heard, where
    the driver tells them. ``aliases`` are what else the radio calls itself.
    """

    address: StationAddress
    rssi_dbm: float
    age_ns: int = 0
    average_dbm: float | None = None
    chains_dbm: tuple[float, ...] = ()
    aliases: tuple[StationAddress, ...] = ()

    @property
    def names(self) -> tuple[StationAddress, ...]:
        """All that the radio calls itself."""
        return (self.address, *self.aliases)


class RadioScan(NamedTuple):
    """One look at all stations by their addresses: whose they are is for the table to say."""

    time_ns: int
    readings: tuple[Reading, ...]


class Motion(NamedTuple):
    """What the DAP's own accelerometer read: times, and specific force in its axes (m/s²)."""

    time_ns: int
    samples: tuple[tuple[int, Vector3], ...]


class SetDown(NamedTuple):
    """The DAP was installed: by whom if by a responder, and where if that is known beforehand.

    If neither is known it was by who is heard loudest. ``truth_m`` is where it really stands (NED),
    which only a simulation knows.
    """

    time_ns: int
    installer_id: NodeId | None
    position: LocalPosition | None
    truth_m: Vector3 | None = None


Observation: TypeAlias = Scan | RadioScan | Motion | SetDown
