"""What the page shows, as it is now (pure): tracks with the ways behind them, roster, alerts.

Whoever watches asks for what has changed since they last asked. However slow they are, they get the
newest of each, and nobody waits for them.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

import msgspec

from command_post.confidence import CHI_SQUARE_95, axes95
from command_post.coverage import Coverage, Site
from command_post.desks.alert_desk import MOST_ALERTS
from command_post.floors import Floor, floors_of
from command_post.roster import DapRow, ResponderRow, Roster
from command_post.roster_json import roster_json
from shared.codec import Refusal, decode, parse_key
from shared.geodesy import Origin
from shared.messages import (
    Alert,
    NodeId,
    OrderAnswer,
    OriginSet,
    Outline,
    OutsideWord,
    TrackEstimate,
    TrackStatus,
    Vector3,
)
from shared.units import NS_PER_S

SILENCE_S = 20.0
SILENT_SPEED_M_S = 0.5
"""Who is not heard for longer than that may have gone on so fast since an estimate was told."""

TRAIL_POINTS = 300
TRAIL_SPACING_M = 0.5
"""Points of a way behind somebody: so many, so far apart at least; the oldest go first."""

MOST_ANSWERS = 64
MOST_OUTSIDE = 200
"""Of what others put on the map the newest are shown."""

_SHOWN = frozenset({"track", "alert", "order_answer", "origin", "outside"})


class TrackView(msgspec.Struct, frozen=True):
    """Where a responder is held to be at ``time_ns``, for who draws it.

    ``axes95_m`` are the semi-axes of the 95 % ellipse, the longer first; ``bearing_rad`` is which
    way the longer runs, clockwise from north. Where ``regions_m`` are given they hold the 95 %.
    ``floor_down_m`` is the likeliest floor, as probable as ``floor_probability``.
    """

    responder_id: NodeId
    time_ns: int
    north_m: float
    east_m: float
    down_m: float
    axes95_m: tuple[float, float]
    bearing_rad: float
    regions_m: tuple[Outline, ...]
    heading_rad: float
    heading_sd_rad: float
    status: TrackStatus
    reason: str
    floor_down_m: float
    floor_probability: float


class _Told(NamedTuple):
    """A track as it was published, and when (post's clock)."""

    view: TrackView
    at_ns: int


class Changes(msgspec.Struct, frozen=True, omit_defaults=True):
    """What has changed up to ``version``. ``trails`` only where they are given whole."""

    version: int
    tracks: list[TrackView] = []
    alerts: list[Alert] = []
    answers: list[OrderAnswer] = []
    roster: msgspec.Raw | None = None
    floors: list[Floor] | None = None
    sites: list[Site] | None = None
    origin: Origin | None = None
    outside: list[OutsideWord] | None = None
    trails: dict[NodeId, list[Vector3]] | None = None


class Board:
    """Takes in what the post publishes and its roster; tells what has changed since a version.

    Version 0 is before everything. One thread at a time: the server sees to that.
    """

    def __init__(self) -> None:
        self.version = 0
        self._now_ns = 0
        self._told: dict[NodeId, _Told] = {}
        self._tracks: dict[NodeId, tuple[int, TrackView]] = {}
        self._trails: dict[NodeId, deque[Vector3]] = {}
        self._alerts: dict[int, tuple[int, Alert]] = {}
        self._answers: deque[tuple[int, OrderAnswer]] = deque(maxlen=MOST_ANSWERS)
        self.daps: tuple[DapRow, ...] = ()
        self._roster: tuple[int, msgspec.Raw] = (0, msgspec.Raw(b"null"))
        self._floors: tuple[int, list[Floor]] = (0, [])
        self._coverage = Coverage()
        self._sites: tuple[int, list[Site]] = (0, [])
        self._origin: tuple[int, Origin | None] = (0, None)
        self._outside: tuple[int, dict[str, OutsideWord]] = (0, {})

    def publish(self, key_text: str, payload: bytes) -> None:
        """Take in a message that the post has published; what the page does not show is passed."""
        key = parse_key(key_text)
        if isinstance(key, Refusal) or key.topic not in _SHOWN:
            return
        message = decode(key, payload)
        if isinstance(message, Refusal):
            return
        self.version += 1
        match message:
            case TrackEstimate():
                view = track_view(message)
                self._told[message.responder_id] = _Told(view, self._now_ns)
                self._tracks[message.responder_id] = (self.version, view)
                self._coverage.take(message)
                self._lengthen(view)
            case Alert():
                self._alerts[message.number] = (self.version, message)
                self._forget_alert()
            case OrderAnswer():
                self._answers.append((self.version, message))
            case OriginSet():
                self._origin = (self.version, Origin.said(message))
            case OutsideWord():
                shown = with_outside(self._outside[1], message)
                if shown is not None:
                    self._outside = (self.version, shown)

    @property
    def origin(self) -> Origin | None:
        """Where on the Earth the incident is, if anybody has said so."""
        return self._origin[1]

    def _forget_alert(self) -> None:
        """Forget the first that is resolved, where there are more than the post itself keeps."""
        if len(self._alerts) > MOST_ALERTS:
            resolved = (n for n, (_, each) in self._alerts.items() if each.stage == "resolved")
            self._alerts.pop(next(resolved, -1), None)

    def show(self, roster: Roster) -> None:
        """Take in the newest roster."""
        self.version += 1
        self._now_ns = roster.now_ns
        self.daps = roster.daps
        self._roster = (self.version, msgspec.Raw(roster_json(roster)))
        self._grow(roster.responders)
        floors = floors_of(
            [*(view.floor_down_m for _, view in self._tracks.values()),
             *(dap.position.down_m for dap in roster.daps if dap.position is not None)]
        )  # fmt: skip
        if floors != self._floors[1]:
            self._floors = (self.version, floors)
        sites = self._coverage.sites(dap.position for dap in roster.daps if dap.position)
        if sites != self._sites[1]:
            self._sites = (self.version, sites)

    def since(self, version: int) -> Changes:
        """Return what has changed since ``version``; since 0, everything, and trails whole."""
        whole = version == 0
        changed_floors, floors = self._floors
        return Changes(
            self.version,
            tracks=[view for changed, view in self._tracks.values() if changed > version],
            alerts=[alert for changed, alert in self._alerts.values() if changed > version],
            answers=[one for changed, one in self._answers if changed > version and not whole],
            roster=self._roster[1] if self._roster[0] > version else None,
            floors=floors if changed_floors > version else None,
            sites=self._sites[1] if self._sites[0] > version else None,
            origin=self._origin[1] if self._origin[0] > version else None,
            outside=[*self._outside[1].values()] if self._outside[0] > version else None,
            trails={name: list(way) for name, way in self._trails.items()} if whole else None,
        )

    def _grow(self, rows: Iterable[ResponderRow]) -> None:
        """Have those who are not heard be somewhere in a region that grows."""
        for row in rows:
            told = self._told.get(row.responder_id)
            if told is not None:
                view = grown(told.view, row, (self._now_ns - told.at_ns) / NS_PER_S)
                if view is not told.view:
                    self._tracks[row.responder_id] = (self.version, view)

    def _lengthen(self, view: TrackView) -> None:
        way = self._trails.setdefault(view.responder_id, deque(maxlen=TRAIL_POINTS))
        place = _place(view)
        if not way or max(abs(a - b) for a, b in zip(place, way[-1], strict=True)) >= (
            TRAIL_SPACING_M
        ):
            way.append(place)


def _place(view: TrackView) -> Vector3:
    return (view.north_m, view.east_m, view.down_m)


def grown(view: TrackView, row: ResponderRow, since_s: float) -> TrackView:
    """Return where somebody is of whom ``view`` was told ``since_s`` ago, and ``row`` is now.

    Who is not heard is somewhere in a region that grows; of others it is as it was told.
    """
    if row.status != "lost" or row.heard_age_s is None:
        return view
    grown_m2 = _silent_m2(row.heard_age_s) - _silent_m2(row.heard_age_s - since_s)
    longer_m, shorter_m = (
        math.sqrt(axis_m**2 + CHI_SQUARE_95 * grown_m2) for axis_m in view.axes95_m
    )
    return msgspec.structs.replace(
        view, axes95_m=(longer_m, shorter_m), status="lost", reason=row.reason
    )


def with_outside(shown: dict[str, OutsideWord], word: OutsideWord) -> dict[str, OutsideWord] | None:
    """Return what others have put on the map (by their uids) after ``word``; ``None``: no change.

    What they take back is there no more.
    """
    others = {uid: one for uid, one in shown.items() if uid != word.uid}
    if word.position is not None and word.kind in ("marker", "mayday"):
        return dict([*others.items(), (word.uid, word)][-MOST_OUTSIDE:])
    return others if word.kind == "cancel" else None


def _silent_m2(silent_s: float) -> float:
    """Return the variance each way of where somebody is who has not been heard for so long."""
    return (SILENT_SPEED_M_S * max(silent_s - SILENCE_S, 0.0)) ** 2


def track_view(track: TrackEstimate) -> TrackView:
    """Return an estimate as it is drawn."""
    longer_m, shorter_m, bearing_rad = axes95(track.covariance_m2)
    floor = track.floors[0] if track.floors else None
    return TrackView(
        responder_id=track.responder_id,
        time_ns=track.event_time_ns,
        north_m=track.north_m,
        east_m=track.east_m,
        down_m=track.down_m,
        axes95_m=(longer_m, shorter_m),
        bearing_rad=bearing_rad,
        regions_m=track.regions_m,
        heading_rad=track.heading_rad,
        heading_sd_rad=track.heading_sd_rad,
        status=track.status,
        reason=track.reason,
        floor_down_m=track.down_m if floor is None else floor.down_m,
        floor_probability=1.0 if floor is None else floor.probability,
    )
