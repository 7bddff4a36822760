"""How somebody moves and where they say that they are: from a responder's unit, or a person."""

from __future__ import annotations

import math
from typing import Literal

import msgspec

from shared.messages.values import (
    UNKNOWN_FACING_SD_RAD,
    Activity,
    Angle,
    BatchRow,
    Confidence,
    Coordinate,
    Covariance,
    Displacement,
    LocalPosition,
    Message,
    Mount,
    NodeId,
    Pressure,
    SensorReading,
    StandardDeviation,
    TimeNs,
    Vector3,
)

WITHOUT_GYRO: Vector3 = (math.nan, math.nan, math.nan)
"""The angular rate that a sensor without a gyroscope reads."""


class ImuSample(msgspec.Struct, frozen=True, gc=False):
    """One reading of an inertial sensor, as a source hands it to a mount. Not a wire message.

    ``force_m_s2`` is specific force (a sensor at rest reads +g upwards), ``rate_rad_s`` angular
    rate (``WITHOUT_GYRO`` where there is none), ``field_ut`` the magnetic field where there is a
    magnetometer; all in the sensor's own right-handed frame. ``pressure_pa`` is the air's,
    absolute: a barometer is slower than the rest, and the samples between its readings have none.
    ``temperature_c`` is the sensor's own, where it tells it. ``time_ns`` is the source's clock.
    """

    time_ns: int
    force_m_s2: Vector3
    rate_rad_s: Vector3
    field_ut: Vector3 | None = None
    pressure_pa: float | None = None
    temperature_c: float | None = None


class TrackStart(Message, frozen=True, kw_only=True):
    """A responder goes in, or their agent begins anew: where they stand, how well they head.

    Without ``position`` the agent does not know: they stand where the post had them last, or, if
    it never had, at the incident's origin.
    """

    position: LocalPosition | None
    heading_sd_rad: StandardDeviation
    mount: Mount
    method: NodeId


class OdometryIncrement(Message, frozen=True, kw_only=True):
    """Movement since the last increment, in the agent's own north-east-down frame.

    A boot gives one a stride, chest and waist one a step. The agent's north is off from the
    incident's by a heading offset that the fusion finds. ``event_time_ns`` ends the movement,
    ``start_time_ns`` begins it; ``heading_rad`` is which way the wearer faces at its end, in the
    agent's frame, and ``facing_sd_rad`` how well the agent knows it there: it has to find out how
    the sensor is worn. ``activity`` is what the wearer did, as sure as ``activity_confidence``.
    ``covariance`` is the upper triangle, row by row, of that of (d_north, d_east, d_down,
    d_heading): m², m·rad, rad².
    """

    start_time_ns: TimeNs
    d_north_m: Displacement
    d_east_m: Displacement
    d_down_m: Displacement
    d_heading_rad: Angle
    heading_rad: Angle
    covariance: tuple[
        Covariance, Covariance, Covariance, Covariance, Covariance,
        Covariance, Covariance, Covariance, Covariance, Covariance,
    ]  # fmt: skip
    mount: Mount
    activity: Activity = "unknown"
    activity_confidence: Confidence = 0.0
    facing_sd_rad: StandardDeviation = UNKNOWN_FACING_SD_RAD


class ImuBatch(Message, frozen=True, kw_only=True):
    """Raw inertial samples, for the record: exactly what the mount was given, ``n`` rows.

    ``force_m_s2``, ``rate_rad_s`` and ``field_ut`` are flat, x, y, z of the first sample first
    (3·n numbers); ``rate_rad_s`` is empty without a gyroscope, ``field_ut`` without a magnetometer.
    ``pressure_pa`` has the barometer's readings alone, ``pressure_rows`` the sample of each,
    counted from 0 and rising. ``event_time_ns`` is the last sample's.
    """

    time_ns: tuple[TimeNs, ...]
    force_m_s2: tuple[SensorReading, ...]
    rate_rad_s: tuple[SensorReading, ...]
    field_ut: tuple[SensorReading, ...]
    pressure_pa: tuple[Pressure, ...] = ()
    pressure_rows: tuple[BatchRow, ...] = ()


class PositionFix(Message, frozen=True, kw_only=True):
    """Somebody says where a responder is at ``event_time_ns``, give or take its covariance.

    ``gnss`` from the unit while it lasts outside, ``known_point`` where they report to stand (the
    door, the engine), ``commander`` by a click on the map.
    """

    responder_id: NodeId
    source: Literal["gnss", "known_point", "commander"]
    position: LocalPosition


class HeightFix(Message, frozen=True, kw_only=True):
    """Somebody says on what height a responder, or a DAP, is at ``event_time_ns``: its floor."""

    node: Literal["responder", "dap"]
    node_id: NodeId
    down_m: Coordinate
    sd_m: StandardDeviation


class Truth(Message, frozen=True, kw_only=True):
    """Where a simulated responder or DAP really is. Recorded for the score, never fused."""

    north_m: Coordinate
    east_m: Coordinate
    down_m: Coordinate
