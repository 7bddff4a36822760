"""The words of the vocabulary: bounded numbers, names, and what every message says."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

NodeId: TypeAlias = Annotated[str, Meta(pattern=r"^[A-Za-z0-9_-]{1,32}$")]
"""Names a responder, a DAP, a post or an incident; also a chunk of a key."""

TimeNs: TypeAlias = Annotated[int, Meta(ge=0, le=2**63 - 1)]
"""Nanoseconds since 1970-01-01 UTC on the clock of the node that says so."""

Sequence: TypeAlias = Annotated[int, Meta(ge=0, le=2**63 - 1)]
Coordinate: TypeAlias = Annotated[float, Meta(ge=-1e6, le=1e6)]
Displacement: TypeAlias = Annotated[float, Meta(ge=-100.0, le=100.0)]
StandardDeviation: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e6)]
Angle: TypeAlias = Annotated[float, Meta(ge=-1e4, le=1e4)]
Covariance: TypeAlias = Annotated[float, Meta(ge=-1e12, le=1e12)]
PowerDbm: TypeAlias = Annotated[float, Meta(ge=-200.0, le=100.0)]
Duration: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e6)]
Probability: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]
SensorReading: TypeAlias = Annotated[float, Meta(ge=-1e5, le=1e5)]
HIGHEST_PRESSURE_PA = 1e6
Pressure: TypeAlias = Annotated[float, Meta(ge=0.0, le=HIGHEST_PRESSURE_PA)]
BatchRow: TypeAlias = Annotated[int, Meta(ge=0, le=2**31 - 1)]

Vector3: TypeAlias = tuple[float, float, float]

Outline: TypeAlias = Annotated[tuple[tuple[Coordinate, Coordinate], ...], Meta(max_length=64)]
"""Corners (north, east) of a polygon, in order; the last is joined to the first."""

StationAddress: TypeAlias = Annotated[
    str,
    Meta(
        pattern=r"^([0-9a-f]{2}(:[0-9a-f]{2}){5}"
        r"|[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}(/[0-9]{1,5}/[0-9]{1,5})?)$"
    ),
]
"""What a radio calls itself: a MAC or Bluetooth address, a UUID, or a beacon's UUID/major/minor."""

Listed: TypeAlias = Annotated[tuple[tuple[StationAddress, NodeId], ...], Meta(max_length=2000)]
"""Addresses, and whose radio each is."""

Mount: TypeAlias = Literal["boot", "chest", "waist", "vehicle"]
"""Where the sensor is: on a boot, at the chest or in the hand, on the belt, in a vehicle."""

Activity: TypeAlias = Literal[
    "unknown", "stand", "walk", "fast", "run", "side_step", "crawl", "stairs_up", "stairs_down",
    "ladder", "lift",
]  # fmt: skip
"""What a wearer does over an increment. Lying still and falling are alarms, not movements."""

TrackStatus: TypeAlias = Literal["tracking", "dead_reckoning", "lost", "recovering"]
AlarmKind: TypeAlias = Literal["motionless", "fall", "mayday"]
AlarmPhase: TypeAlias = Literal["pre_alarm", "alarm", "cancelled"]
AlertKind: TypeAlias = AlarmKind | Literal[
    "lost_contact", "low_battery", "low_air", "left_team", "dap_dead", "dap_moved", "doubt",
    "intruder",
]  # fmt: skip
"""What a commander is alerted to: a unit's alarm, silence or want, a doubt, a stranger."""

AlertStage: TypeAlias = Literal["raised", "acknowledged", "assigned", "resolved"]
UNKNOWN_FACING_SD_RAD = 1.81
"""Standard deviation of a direction of which nothing is known: π/√3, uniform around the circle."""

HealthLevel: TypeAlias = Literal["ok", "warning", "fault"]
OrderKind: TypeAlias = Literal["evacuate", "roll_call", "message"]
MOST_WORDS = 200
MOST_LOST = 64
Words: TypeAlias = Annotated[str, Meta(min_length=1, max_length=MOST_WORDS)]

RunId: TypeAlias = Annotated[str, Meta(pattern=r"^[0-9a-f]{16}$")]
"""Names a run of numbers (``shared.seal``), in hexadecimal: a journal's, or a process's."""

MessageNumber: TypeAlias = Annotated[int, Meta(ge=0, le=2**63 - 1)]
"""Of a message within its run, from 1; 0 stands before the first."""
Confidence: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]


ClockOffsetNs: TypeAlias = Annotated[int, Meta(ge=-(2**62), le=2**62)]


class Message(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """What every wire message says: when it happened, and its number under its key.

    ``event_time_ns`` is when the thing told happened, on the sender's clock. ``sequence`` counts
    the messages of one key from 0, so that a gap or a repeat can be seen.
    """

    event_time_ns: TimeNs
    sequence: Sequence


class LocalPosition(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """A place in the incident's frame, with its horizontal covariance (nn, ne, ee) in m²."""

    north_m: Coordinate
    east_m: Coordinate
    down_m: Coordinate
    covariance_m2: tuple[Covariance, Covariance, Covariance]
