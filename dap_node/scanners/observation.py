"""What a scanner reports, in the order of time, whatever the radio."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

from shared.messages import LocalPosition, NodeId, Vector3
from shared.radios.readings import RadioScan


class Scan(NamedTuple):
    """One look at all stations: the signal strength of each that was heard, maybe of none.

    A DAP knows no time but that of its scans, so a scanner reports them steadily.
    """

    time_ns: int
    rssi_dbm: Mapping[NodeId, float]


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


class PutElsewhere(NamedTuple):
    """Somebody put the DAP at ``truth_m`` (NED) and told nobody: only a simulation knows."""

    time_ns: int
    truth_m: Vector3


Observation: TypeAlias = Scan | RadioScan | Motion | SetDown | PutElsewhere
