"""An incident for Foxglove and Lichtblick (pure): what the post says, as messages that they draw.

A map (where the origin is known), a three-dimensional scene and a log. The scene's frame
``incident`` has x east, y north and z up; each responder is a frame in it too, to be followed. All
of it is made of what the post said, of each responder once a second at most.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import msgspec

from command_post.confidence import HEADING_KNOWN_RAD
from command_post.gateways.foxglove_schemas import (
    COVARIANCE_KNOWN,
    ERROR,
    FATAL,
    INFO,
    LINE_LOOP,
    WARNING,
    ArrowPrimitive,
    Color,
    CubePrimitive,
    CylinderPrimitive,
    Drawable,
    FrameTransform,
    GeoJSON,
    LinePrimitive,
    LocationFix,
    Log,
    Pose,
    Quaternion,
    SceneEntity,
    SceneEntityDeletion,
    SceneUpdate,
    SpherePrimitive,
    TextPrimitive,
    Time,
    Vector3,
)
from command_post.gateways.geojson import Scene, feature_collection
from command_post.roster import DapRow
from command_post.web.board import TrackView, track_view
from shared.geodesy import Origin
from shared.messages import (
    Alert,
    DapEstimate,
    LocalPosition,
    Message,
    Order,
    OriginSet,
    OutsideWord,
    TrackEstimate,
    TrackStatus,
)
from shared.units import NS_PER_S

FRAME = "incident"
TRACK_PERIOD_NS = NS_PER_S
MAP_PERIOD_NS = 10 * NS_PER_S
"""The regions on the map are told so often: each time all of them, which is much."""

UNKNOWN_SD_M = 5.0
"""For a height that nobody tells how well it is known."""

_COLORS: dict[TrackStatus, Color] = {
    "tracking": Color(0.0, 0.45, 0.7, 1.0),
    "dead_reckoning": Color(0.9, 0.6, 0.0, 1.0),
    "recovering": Color(0.8, 0.47, 0.65, 1.0),
    "lost": Color(0.84, 0.37, 0.0, 1.0),
}
"""Of Okabe and Ito's palette, which colour-blind people can tell apart."""

_DAP_COLOR = Color(0.0, 0.62, 0.45, 1.0)
_BADLY = frozenset({"mayday", "fall", "motionless"})


class Drawing(NamedTuple):
    """A message to be drawn, under its topic, as of when."""

    topic: str
    message: Drawable
    time_ns: int


class FoxgloveBoard:
    """Takes in what the post says; gives what is to be drawn of it."""

    def __init__(self, origin: Origin | None) -> None:
        """Without ``origin`` nothing is drawn on the map."""
        self._origin = origin
        self._told_ns: dict[str, int] = {}
        self._tracks: dict[str, TrackEstimate] = {}
        self._daps: dict[str, LocalPosition] = {}
        self._mapped_ns: int | None = None

    def take(self, message: Message, time_ns: int) -> Iterator[Drawing]:
        """Yield what is to be drawn of ``message``, which was said at ``time_ns``."""
        match message:
            case TrackEstimate(responder_id=name):
                self._tracks[name] = message
                told_ns = self._told_ns.get(name)
                if told_ns is None or not 0 <= time_ns - told_ns < TRACK_PERIOD_NS:
                    yield from self._track(message, time_ns)
            case DapEstimate(dap_id=name, position=place):
                self._daps[name] = place
                yield _dap(name, place, time_ns)
            case Alert():
                yield Drawing("/log", _alert_log(message), time_ns)
            case Order():
                to = ", ".join(message.to) or "everybody"
                words = f"{message.kind.replace('_', ' ')} to {to}: {message.text}".rstrip(": ")
                yield Drawing("/log", Log(_time(time_ns), WARNING, words, "post"), time_ns)
            case OriginSet():
                self._origin, self._mapped_ns = Origin.said(message), None
            case OutsideWord():
                words = f"{message.kind} of {message.callsign}: {message.words}".rstrip(": ")
                yield Drawing("/log", Log(_time(time_ns), INFO, words, "outside"), time_ns)
        mapped_ns = self._mapped_ns
        if mapped_ns is None or not 0 <= time_ns - mapped_ns < MAP_PERIOD_NS:
            yield from self._map(time_ns)

    def take_up(self, dap_id: str, time_ns: int) -> Iterator[Drawing]:
        """Yield that an access point is where it stood no more, if it is drawn."""
        if self._daps.pop(dap_id, None) is not None:
            gone = SceneEntityDeletion(_time(time_ns), dap_id)
            yield Drawing(f"/daps/{dap_id}", SceneUpdate([], [gone]), time_ns)

    @property
    def daps(self) -> frozenset[str]:
        """The access points that are drawn."""
        return frozenset(self._daps)

    def standing(self, time_ns: int) -> Iterator[Drawing]:
        """Yield everything as it stands, for who has not seen it."""
        for _, track in sorted(self._tracks.items()):
            yield from self._track(track, time_ns)
        for name, place in sorted(self._daps.items()):
            yield _dap(name, place, time_ns)
        yield from self._map(time_ns)

    def _track(self, track: TrackEstimate, time_ns: int) -> Iterator[Drawing]:
        self._told_ns[track.responder_id] = time_ns
        topic = f"/responders/{track.responder_id}"
        yield Drawing(f"{topic}/frame", _frame(track), time_ns)
        yield Drawing(f"{topic}/scene", SceneUpdate([_responder(track_view(track))]), time_ns)
        if self._origin is not None:
            yield Drawing(f"{topic}/location", _location(track, self._origin), time_ns)

    def _map(self, time_ns: int) -> Iterator[Drawing]:
        if self._origin is None or not self._tracks:
            return
        self._mapped_ns = time_ns
        daps = tuple(
            DapRow(name, "installed", "", place, None, None, None, None)
            for name, place in self._daps.items()
        )
        scene = Scene([track_view(each) for each in self._tracks.values()], {}, daps)
        text = msgspec.json.encode(feature_collection(scene, self._origin)).decode()
        yield Drawing("/map", GeoJSON(text), time_ns)


def _dap(dap_id: str, place: LocalPosition, time_ns: int) -> Drawing:
    at = Pose(_place(place.north_m, place.east_m, place.down_m))
    entity = SceneEntity(
        timestamp=_time(time_ns), frame_id=FRAME, id=dap_id,
        cubes=[CubePrimitive(at, Vector3(0.4, 0.4, 0.4), _DAP_COLOR)],
        texts=[_label(at.position, dap_id, _DAP_COLOR)],
    )  # fmt: skip
    return Drawing(f"/daps/{dap_id}", SceneUpdate([entity]), time_ns)


def _frame(track: TrackEstimate) -> FrameTransform:
    return FrameTransform(
        _time(track.event_time_ns), FRAME, track.responder_id,
        _place(track.north_m, track.east_m, track.down_m), _turned(track.heading_rad),
    )  # fmt: skip


def _responder(view: TrackView) -> SceneEntity:
    """Return somebody with the region that holds them, their name, and which way they face."""
    color = _COLORS[view.status]
    place = _place(view.north_m, view.east_m, view.down_m)
    faces = [
        ArrowPrimitive(Pose(place, _turned(view.heading_rad)), 0.8, 0.15, 0.4, 0.4, color)
    ] if view.heading_sd_rad < HEADING_KNOWN_RAD else []  # fmt: skip
    longer_m, shorter_m = (round(2.0 * axis_m, 2) for axis_m in view.axes95_m)
    faint = msgspec.structs.replace(color, a=0.25)
    disc = CylinderPrimitive(
        Pose(place, _turned(view.bearing_rad)), Vector3(longer_m, shorter_m, 0.05), 1.0, 1.0, faint
    )
    outlines = [
        LinePrimitive(
            LINE_LOOP, Pose(Vector3(0.0, 0.0, place.z)), 0.1, False,
            [Vector3(round(east_m, 1), round(north_m, 1), 0.0) for north_m, east_m in outline],
            color,
        )
        for outline in view.regions_m
    ]  # fmt: skip
    name = view.responder_id
    words = name if view.status == "tracking" else f"{name}, {view.status.replace('_', ' ')}"
    return SceneEntity(
        timestamp=_time(view.time_ns), frame_id=FRAME, id=name, arrows=faces,
        spheres=[SpherePrimitive(Pose(place), Vector3(0.5, 0.5, 0.5), color)],
        cylinders=[] if outlines else [disc], lines=outlines,
        texts=[_label(place, words, color)],
    )  # fmt: skip


def _label(place: Vector3, words: str, color: Color) -> TextPrimitive:
    above = msgspec.structs.replace(place, z=round(place.z + 1.0, 2))
    return TextPrimitive(Pose(above), True, 0.8, False, color, words)


def _location(track: TrackEstimate, origin: Origin) -> LocationFix:
    place = origin.geodetic(track.north_m, track.east_m, track.down_m)
    ee, en, nn = _covariance_on_earth(track.covariance_m2, origin.bearing_deg)
    up_sd_m = UNKNOWN_SD_M if track.down_sd_m is None else track.down_sd_m
    covariance = [ee, en, 0.0, en, nn, 0.0, 0.0, 0.0, up_sd_m**2]
    return LocationFix(
        _time(track.event_time_ns), track.responder_id,
        round(place.latitude_deg, 7), round(place.longitude_deg, 7), round(place.height_m, 2),
        [round(each, 2) for each in covariance], COVARIANCE_KNOWN, _COLORS[track.status],
    )  # fmt: skip


def _covariance_on_earth(
    covariance_m2: tuple[float, float, float], bearing_deg: float
) -> tuple[float, float, float]:
    """Return ee, en, nn by true north of a covariance nn, ne, ee by the incident's."""
    nn, ne, ee = covariance_m2
    cos, sin = math.cos(math.radians(bearing_deg)), math.sin(math.radians(bearing_deg))
    return (
        sin * sin * nn + 2.0 * sin * cos * ne + cos * cos * ee,
        sin * cos * (nn - ee) + (cos * cos - sin * sin) * ne,
        cos * cos * nn - 2.0 * sin * cos * ne + sin * sin * ee,
    )


def _alert_log(alert: Alert) -> Log:
    by = f" by {alert.by}" if alert.by else ""
    words = f"{alert.kind.replace('_', ' ')} {alert.node_id} {alert.stage}{by}: {alert.words}"
    level = (FATAL if alert.kind in _BADLY else ERROR) if alert.stage == "raised" else INFO
    return Log(_time(alert.event_time_ns), level, words.rstrip(": "), alert.role)


def _place(north_m: float, east_m: float, down_m: float) -> Vector3:
    return Vector3(round(east_m, 2), round(north_m, 2), round(-down_m, 2))


def _turned(bearing_rad: float) -> Quaternion:
    """Return what turns x (east) to a bearing, which is clockwise from north."""
    half_rad = 0.5 * (0.5 * math.pi - bearing_rad)
    return Quaternion(z=round(math.sin(half_rad), 4), w=round(math.cos(half_rad), 4))


def _time(time_ns: int) -> Time:
    return Time(*divmod(time_ns, NS_PER_S))
