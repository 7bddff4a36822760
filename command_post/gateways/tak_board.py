"""What TAK is told of an incident, and when (pure): the newest of everything, alarms until over."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from command_post.confidence import HEADING_KNOWN_RAD, radii95_m
from command_post.gateways.cot import NOT_KNOWN_M, Shown, alarm_event, dap_event, responder_event
from command_post.roster import Roster
from shared.codec import Refusal, decode, parse_key
from shared.geodesy import Origin
from shared.messages import Alert, LocalPosition, OriginSet, TrackEstimate
from shared.units import NS_PER_S

AGAIN_NS = 5 * NS_PER_S
"""Whoever has not moved, and an alarm that stands, is told again so often."""

CANCELLED_TIMES = 3
"""That an alarm is over is told so often: a client that misses it would sound on."""

SD_TO_95 = 1.96
_ALARMS = frozenset({"mayday", "fall", "motionless"})


class _Alarm(NamedTuple):
    alert: Alert
    cancels_left: int | None


class TakBoard:
    """Takes in what the post publishes; gives the events that are due."""

    def __init__(self, incident: str, origin: Origin | None) -> None:
        """Without ``origin`` nothing is told until the post says where the incident is."""
        self._incident = incident
        self.origin = origin
        self._tracks: dict[str, TrackEstimate] = {}
        self._alarms: dict[int, _Alarm] = {}
        self._roster: Roster | None = None
        self._told_ns: dict[str, int] = {}
        self._changed: set[str] = set()

    def publish(self, key_text: str, payload: bytes) -> None:
        """Take in a message that the post has published; most are passed over."""
        key = parse_key(key_text)
        if isinstance(key, Refusal) or key.topic not in ("track", "alert", "origin"):
            return
        match decode(key, payload):
            case TrackEstimate() as track:
                self._tracks[track.responder_id] = track
                self._changed.add(self._uid(track.responder_id))
            case Alert() as alert if alert.kind in _ALARMS and alert.role == "responder":
                over = alert.stage == "resolved"
                self._alarms[alert.number] = _Alarm(alert, CANCELLED_TIMES if over else None)
                self._told_ns.pop(_alarm_name(alert), None)

            case OriginSet() as message:
                self.origin = Origin.said(message)
                self._told_ns.clear()

    def show(self, roster: Roster) -> None:
        """Take in the newest roster."""
        self._roster = roster

    def due(self, now_ns: int) -> Iterator[bytes]:
        """Yield the events that are to be told at ``now_ns`` of the post's clock."""
        if self.origin is None:
            return
        yield from self._due(self.origin, now_ns)

    def _due(self, origin: Origin, now_ns: int) -> Iterator[bytes]:
        for responder_id, track in sorted(self._tracks.items()):
            uid = self._uid(responder_id)
            if uid in self._changed or self._is_due(uid, now_ns):
                self._told_ns[uid] = now_ns
                yield self._responder(track, origin, now_ns)
        self._changed.clear()
        for dap_id, place in self._daps():
            uid = self._uid(dap_id)
            if self._is_due(uid, now_ns):
                self._told_ns[uid] = now_ns
                shown = self._shown(dap_id, place, None, origin)
                yield dap_event(shown, now_ns, "access point")
        yield from self._due_alarms(origin, now_ns)

    def _due_alarms(self, origin: Origin, now_ns: int) -> Iterator[bytes]:
        for number, (alert, left) in list(self._alarms.items()):
            name = _alarm_name(alert)
            if not self._is_due(name, now_ns):
                continue
            self._told_ns[name] = now_ns
            shown = self._alarmed(alert.node_id, origin)
            yield alarm_event(shown, now_ns, alert.kind, cancelled=left is not None)
            if left is not None:
                self._alarms[number] = _Alarm(alert, left - 1)
                if left == 1:
                    del self._alarms[number], self._told_ns[name]

    def _is_due(self, name: str, now_ns: int) -> bool:
        told_ns = self._told_ns.get(name)
        return told_ns is None or not 0 <= now_ns - told_ns < AGAIN_NS

    def _daps(self) -> Iterator[tuple[str, LocalPosition]]:
        for row in () if self._roster is None else self._roster.daps:
            if row.position is not None:
                yield row.dap_id, row.position

    def _responder(self, track: TrackEstimate, origin: Origin, now_ns: int) -> bytes:
        shown = self._shown(track.responder_id, _position(track), track.down_sd_m, origin)
        known = track.heading_sd_rad < HEADING_KNOWN_RAD
        course_deg = math.degrees(track.heading_rad) + origin.bearing_deg if known else None
        remarks = f"{track.status}: {track.reason}" if track.reason else track.status
        return responder_event(shown, now_ns, course_deg, remarks)

    def _alarmed(self, responder_id: str, origin: Origin) -> Shown:
        """Return where whoever is in need is; without a track, somewhere about the incident."""
        track = self._tracks.get(responder_id)
        if track is not None:
            return self._shown(responder_id, _position(track), track.down_sd_m, origin)
        somewhere = origin.geodetic(0.0, 0.0, 0.0)
        return Shown(self._uid(responder_id), responder_id, somewhere, NOT_KNOWN_M, None)

    def _shown(
        self, node_id: str, place: LocalPosition, down_sd_m: float | None, origin: Origin
    ) -> Shown:
        return Shown(
            self._uid(node_id),
            node_id,
            origin.geodetic(place.north_m, place.east_m, place.down_m),
            radii95_m(place.covariance_m2)[0],
            None if down_sd_m is None else SD_TO_95 * down_sd_m,
        )

    def _uid(self, node_id: str) -> str:
        return f"clew-{self._incident}-{node_id}"


def _position(track: TrackEstimate) -> LocalPosition:
    return LocalPosition(
        north_m=track.north_m,
        east_m=track.east_m,
        down_m=track.down_m,
        covariance_m2=track.covariance_m2,
    )


def _alarm_name(alert: Alert) -> str:
    return f"alert {alert.number}"
