"""The vocabulary: every message that crosses the wire, and the one sample that never does.

Each wire message is a frozen struct that travels as a MessagePack map. Units stand in the field
names; positions are metres north, east and down of the incident's origin, headings are radians
clockwise from north. Every number carries its bounds in its type, so that NaN, infinities and
absurd values are refused where bytes become messages. Fields may be added with a default; a
receiver passes over fields it does not know. Anything else needs a new version of the key.
"""

from __future__ import annotations

import math
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
AlertKind: TypeAlias = AlarmKind | Literal["lost_contact", "doubt", "intruder"]
"""What a commander is alerted to: a unit's alarm, silence, what the fusion doubts, a stranger."""

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


class Alarm(Message, frozen=True, kw_only=True):
    """An alarm of a responder's unit begins, gets worse, goes on, or is over.

    An alarm that stands is said again every few seconds, with the time at which its phase began
    in ``event_time_ns``; ``cancelled`` ends it, and is said a few times.
    """

    kind: AlarmKind
    phase: AlarmPhase
    confidence: Confidence
    reason: Words


class NodeHealth(Message, frozen=True, kw_only=True):
    """What a unit finds of its own sensor, in words for who wears it; what is worst first.

    ``level`` is that of the worst finding, ``ok`` if nothing is wrong: findings of that level say
    how the sensor was found.
    """

    level: HealthLevel
    findings: Annotated[tuple[Words, ...], Meta(max_length=16)]


class DropAdvice(Message, frozen=True, kw_only=True):
    """A unit has told its wearer to set a DAP down here: how urgent that is, and why.

    ``boxes_left`` are those that the wearer carries.
    """

    urgency: Confidence
    reason: Words
    boxes_left: Annotated[int, Meta(ge=0, le=1000)]


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


class RssiReport(Message, frozen=True, kw_only=True):
    """One reading of a responder's signal strength at a DAP."""

    responder_id: NodeId
    rssi_dbm: PowerDbm


class ProximityEvent(Message, frozen=True, kw_only=True, omit_defaults=True):
    """A responder is near a DAP, or has just ceased to be.

    ``entered`` and ``left`` bound a stay; ``near`` repeats while it lasts. Mean and variance are
    of the RSSI over the DAP's window, ``sample_count`` the samples in it. A DAP that weighs
    likelihoods also says the log odds that they are near, and what it holds of the range: mean and
    standard deviation.
    """

    responder_id: NodeId
    phase: Literal["entered", "near", "left"]
    rssi_mean_dbm: PowerDbm
    rssi_variance_db2: StandardDeviation
    sample_count: Annotated[int, Meta(ge=0, le=100_000)]
    near_log_odds: Annotated[float, Meta(ge=-100.0, le=100.0)] | None = None
    range_m: Annotated[float, Meta(ge=0.0, le=1e4)] | None = None
    range_sd_m: Annotated[float, Meta(ge=0.0, le=1e4)] | None = None


class RssiPeak(Message, frozen=True, kw_only=True):
    """A responder passed a DAP: when their signal was strongest, how strong, and for how long.

    ``event_time_ns`` is the power-weighted middle of the readings within 6 dB of the strongest,
    ``width_s`` the time over which they were; the sharper, the nearer and the better known.
    """

    responder_id: NodeId
    peak_dbm: PowerDbm
    width_s: Duration
    sample_count: Annotated[int, Meta(ge=1, le=100_000)]


class DapReading(Message, frozen=True, kw_only=True):
    """One reading of a DAP's signal strength at a responder's unit."""

    dap_id: NodeId
    rssi_dbm: PowerDbm


class DapPeak(Message, frozen=True, kw_only=True):
    """A responder passed a DAP, as their unit heard it: what ``RssiPeak`` says, from this side."""

    dap_id: NodeId
    peak_dbm: PowerDbm
    width_s: Duration
    sample_count: Annotated[int, Meta(ge=1, le=100_000)]


class Contact(Message, frozen=True, kw_only=True):
    """Two responders met: one's unit heard the other's, loudest at ``event_time_ns``."""

    other_id: NodeId
    peak_dbm: PowerDbm
    width_s: Duration
    sample_count: Annotated[int, Meta(ge=1, le=100_000)]


class NeighbourHeard(Message, frozen=True, kw_only=True):
    """A DAP heard another one: mean and variance of its signal over the last seconds."""

    dap_id: NodeId
    rssi_mean_dbm: PowerDbm
    rssi_variance_db2: StandardDeviation
    sample_count: Annotated[int, Meta(ge=1, le=100_000)]


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


class DapInstallation(Message, frozen=True, kw_only=True):
    """A DAP was set down: when, by whom, and where once that is known.

    Without ``position`` it stands where its installer stood at ``event_time_ns``; the command
    post works that out and tells the DAP, which says it again with the position. A DAP placed at
    a known point (the entrance) has a position from the first and may have no installer. With
    neither it was taken up, and stands nowhere from then on.
    """

    installer_id: NodeId | None
    position: LocalPosition | None


class SetDownHere(Message, frozen=True, kw_only=True):
    """Somebody tells a DAP that it stands now: at ``position``, or else beside who says so.

    A responder's unit says so where its wearer sets the DAP down; a post gives the position.
    """

    dap_id: NodeId
    position: LocalPosition | None


class StationTable(Message, frozen=True, kw_only=True):
    """Whose radios are whose: by it, signal strengths of addresses become those of nodes."""

    responders: Listed
    daps: Listed


class FloorShare(msgspec.Struct, frozen=True, gc=False):
    """How probable it is that somebody is on the floor at the height ``down_m``."""

    down_m: Coordinate
    probability: Probability


class TrackEstimate(Message, frozen=True, kw_only=True):
    """Where the command post holds a responder to be at ``event_time_ns``.

    ``covariance_m2`` is horizontal (nn, ne, ee), ``down_sd_m`` of the height. ``heading_rad`` is
    the heading in the incident's frame. ``last_proximity_time_ns`` is when a DAP last tied the
    track down, if one has. Where one ellipse does not tell it, ``regions_m`` are the outlines
    (north, east) that hold 95 % together. ``floors`` are the likely ones, likeliest first.
    ``status`` is ``reason``ed in words where it is not ``tracking``.
    """

    responder_id: NodeId
    north_m: Coordinate
    east_m: Coordinate
    down_m: Coordinate
    covariance_m2: tuple[Covariance, Covariance, Covariance]
    heading_rad: Angle
    heading_sd_rad: StandardDeviation
    last_proximity_time_ns: TimeNs | None
    down_sd_m: StandardDeviation | None = None
    regions_m: Annotated[tuple[Outline, ...], Meta(max_length=8)] = ()
    floors: Annotated[tuple[FloorShare, ...], Meta(max_length=8)] = ()
    status: TrackStatus = "tracking"
    reason: Annotated[str, Meta(max_length=200)] = ""


class DapEstimate(Message, frozen=True, kw_only=True):
    """Where the command post holds a DAP to stand, since its installation at ``event_time_ns``."""

    dap_id: NodeId
    position: LocalPosition


class ClockSpan(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """What a journal has from ``first_number`` on was dated by a clock that was off by that."""

    first_number: MessageNumber
    offset_ns: ClockOffsetNs
    uncertainty_ns: TimeNs


class ClockStatement(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """How far the clock of the post ``post_id`` is ahead of a node's, as the node found out.

    It is ``offset_ns`` at the time of the beat, give or take ``uncertainty_ns``, and grows by
    ``drift`` (seconds a second). A process that dates its messages by a clock that was read anew
    begins a span: ``spans`` are the journal's, by number, where it has more than one.
    """

    post_id: NodeId
    offset_ns: ClockOffsetNs
    uncertainty_ns: TimeNs
    drift: Annotated[float, Meta(ge=-1e-3, le=1e-3)]
    spans: Annotated[tuple[ClockSpan, ...], Meta(max_length=32)] = ()


class Beat(Message, frozen=True, kw_only=True):
    """A node is at work, at ``event_time_ns``; what its journal holds for those who missed it.

    ``run`` is the journal's and ``last_number`` its newest message's, of which those before
    ``kept_from`` are there no more and those up to ``acknowledged`` are known to be safe elsewhere.
    The disk has ``lost`` some between: nobody is to wait for them. ``clock`` is what the node knows
    of its clock, ``None`` if nothing.
    """

    run: RunId
    last_number: MessageNumber
    kept_from: MessageNumber
    acknowledged: MessageNumber
    clock: ClockStatement | None = None
    lost: Annotated[tuple[MessageNumber, ...], Meta(max_length=MOST_LOST)] = ()


class SafeUpTo(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """All messages of a journal up to ``number`` are on the disk of whoever says so."""

    role: Literal["responder", "dap", "post"]
    node_id: NodeId
    run: RunId
    number: MessageNumber


class Receipt(Message, frozen=True, kw_only=True):
    """What the post has safe of the nodes' journals: they need not keep it for the post's sake."""

    safe: Annotated[tuple[SafeUpTo, ...], Meta(max_length=256)]


class Order(Message, frozen=True, kw_only=True):
    """The post orders responders: those in ``to``, everybody if that is empty.

    It stands until each has acknowledged it. With the key it came under, ``sequence`` names it.
    ``said_ns`` is when the post says it again, on its own clock; ``None`` when it says it first. So
    who hears it can tell it from what somebody kept and says long after.
    """

    kind: OrderKind
    to: Annotated[tuple[NodeId, ...], Meta(max_length=256)]
    text: Annotated[str, Meta(max_length=200)]
    said_ns: TimeNs | None = None


class OrderRequest(Message, frozen=True, kw_only=True):
    """A commander wants the post to order those in ``to`` something, everybody if that is empty.

    To ``withdraw`` is to wait no longer until they acknowledge what they were ordered.
    """

    kind: OrderKind | Literal["withdraw"]
    to: Annotated[tuple[NodeId, ...], Meta(max_length=256)]
    text: Annotated[str, Meta(max_length=200)]


class OrderAnswer(Message, frozen=True, kw_only=True):
    """The post has done what ``commander_id`` requested under that number, or says why not.

    ``waited_for`` are those who are to acknowledge it.
    """

    commander_id: NodeId
    request_sequence: Sequence
    refusal: Annotated[str, Meta(max_length=400)] | None
    waited_for: Annotated[tuple[NodeId, ...], Meta(max_length=4096)]


class OrderReply(Message, frozen=True, kw_only=True):
    """A responder's unit has an order (``received``), or its wearer says so (``acknowledged``)."""

    post_id: NodeId
    order_sequence: Sequence
    stage: Literal["received", "acknowledged"]


class Alert(Message, frozen=True, kw_only=True):
    """How something that the commander is alerted to stands, since ``event_time_ns``.

    ``number`` names it at its post. ``since_ns`` is when it was raised. ``by`` is who brought it
    to its ``stage``, ``None`` for the post itself; ``assigned_to`` whom it was given to.
    """

    number: Sequence
    kind: AlertKind
    role: Literal["responder", "dap", "post"]
    node_id: NodeId
    since_ns: TimeNs
    stage: AlertStage
    words: Annotated[str, Meta(max_length=MOST_WORDS)]
    by: NodeId | None
    assigned_to: NodeId | None


class AlertRequest(Message, frozen=True, kw_only=True):
    """Somebody at the post acknowledges, assigns (to ``assigned_to``) or resolves an alert."""

    number: Sequence
    stage: Literal["acknowledged", "assigned", "resolved"]
    assigned_to: NodeId | None


class StrangerNoticed(Message, frozen=True, kw_only=True):
    """The post's gate turns away what is said in a node's name, and why."""

    role: Literal["responder", "dap", "post"]
    node_id: NodeId
    words: Words


class OutsideWord(Message, frozen=True, kw_only=True):
    """What somebody in another system (TAK) says: a marker on their map, a message, a mayday.

    ``uid`` and ``callsign`` are theirs; ``cancel`` takes a mayday of that ``uid`` back.
    """

    kind: Literal["marker", "message", "mayday", "cancel"]
    uid: Words
    callsign: Words
    words: Annotated[str, Meta(max_length=MOST_WORDS)]
    position: LocalPosition | None


class ExerciseStart(Message, frozen=True, kw_only=True):
    """A simulated exercise begins: its clock reads ``event_time_ns`` now and runs at ``speed``."""

    scenario: Annotated[str, Meta(min_length=1, max_length=200)]
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)]
    speed: Annotated[float, Meta(gt=0.0, le=1e4)]


class Truth(Message, frozen=True, kw_only=True):
    """Where a simulated responder or DAP really is. Recorded for the score, never fused."""

    north_m: Coordinate
    east_m: Coordinate
    down_m: Coordinate
