"""An incident as the post told it, at any moment of its recording.

What was told is shown as it was: estimates, alerts, where DAPs stand. The roster is no message, nor
is where a further DAP would have helped; they are made again by the post's own functions of what
had been heard and told by then. Not recorded, and so not in it, are which nodes held a token and
what was turned away at the gate.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from threading import Lock
from typing import NamedTuple

import msgspec

from command_post.coverage import Coverage
from command_post.desks.orders import Orders
from command_post.floors import floors_of
from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.track import Estimate
from command_post.incident_settings import IncidentSettings
from command_post.nodes.told import LastMovement, RaisedAlarm
from command_post.review.standing import MADE, RARE, Course, Happened, Standing
from command_post.review.tracks import Told, TrackBook
from command_post.roster import ResponderRow, Roster, RosterSettings, make_roster
from command_post.roster_json import roster_json
from command_post.web.board import Changes, TrackView, grown, track_view
from shared.codec import Refusal, decode, parse_key
from shared.geodesy import Origin
from shared.mcap_index import IndexedRecording, Series
from shared.mcap_reader import RecordedMessage, RecordingError
from shared.messages import (
    AlarmKind,
    Beat,
    Message,
    NodeHealth,
    NodeId,
    OdometryIncrement,
    OriginSet,
    Supplies,
    TrackEstimate,
)
from shared.topics import Key, Role
from shared.units import NS_PER_S

MOST_LOST_S = 1e5

_NOT_THEIRS = frozenset({"truth"})
"""What a node's simulator says, and not the node."""


class _Placed(msgspec.Struct, gc=False):
    """As much of an estimate as finding it again takes."""

    responder_id: str
    north_m: float
    east_m: float
    down_m: float
    covariance_m2: tuple[float, float, float]


_placed = msgspec.msgpack.Decoder(_Placed)


class Past:
    """The incident of a recording. Estimates are read by ``read``, which others need not await.

    ``read_until_ns`` is how far they are; moments up to then can be shown, by any thread.
    """

    def __init__(self, recording: IndexedRecording) -> None:
        """Read what is rare. Raises ``RecordingError`` if it does not say what it is of."""
        self.recording = recording
        try:
            self.settings = IncidentSettings.from_metadata(recording.metadata)
        except ValueError as error:
            raise RecordingError(f"{recording.paths[0]}: {error}") from error
        self.begin_ns, self.end_ns = recording.start_ns, recording.end_ns
        self.read_until_ns = self.begin_ns
        self.failed: str | None = None
        """Why no more is read, if so."""

        self._keys = {each: parse_key(each.key) for each in recording.series}
        self._of_topic: dict[tuple[str, bool], list[tuple[Series, Key]]] = defaultdict(list)
        self._of_node: dict[tuple[Role, str], list[Series]] = defaultdict(list)
        for series, key in self._keys.items():
            if isinstance(key, Key):
                self._note(series, key)
        beats = bool(self._of_topic["beat", False])
        # Where nobody says regularly to be there, silence says nothing.
        self._roster_settings = RosterSettings() if beats else RosterSettings(lost_s=MOST_LOST_S)
        self.course = Course([*self._first_heard(), *self._rare()])
        self._book = TrackBook()
        self._coverage = Coverage()
        self._lock = Lock()

    def read(self) -> Iterator[int]:
        """Read the estimates; yield now and then up to when they are read."""
        series = [each for each, _ in self._of_topic["track", True]]
        for message, spot in self.recording.located(series):
            try:
                told = _placed.decode(message.payload)
            except (msgspec.MsgspecError, UnicodeDecodeError):
                continue
            place_m = (told.north_m, told.east_m, told.down_m)
            self._book.add(told.responder_id, message.log_time_ns, place_m, spot)
            self._coverage.take(told, message.log_time_ns)
            if message.log_time_ns > self.read_until_ns:
                # Others of the same time may follow.
                self.read_until_ns = message.log_time_ns - 1
                yield self.read_until_ns
        self.read_until_ns = self.end_ns
        yield self.end_ns

    def told(self) -> Iterator[RecordedMessage]:
        """Yield all that was told of where anybody is, in the order in which it was told."""
        series = [each for each, _ in self._of_topic["track", True]]
        return (message for message, _ in self.recording.located(series))

    def estimates(self) -> Iterator[TrackEstimate]:
        """Yield the estimates that were told, in their order."""
        keys = dict(self._of_topic["track", True])
        for message in self.told():
            track = decode(keys[Series(message.key, outgoing=True)], message.payload)
            if isinstance(track, TrackEstimate):
                yield track

    def roster(self, at_ns: int) -> Roster:
        """Return who was where at ``at_ns``."""
        with self._lock:
            tracks = self._estimates(self._book.newest(at_ns))
            return self._roster(tracks, self.course.at(at_ns), at_ns)

    def moment(self, at_ns: int) -> Changes:
        """Return all that was shown at ``at_ns``."""
        with self._lock:
            standing = self.course.at(at_ns)
            newest = self._book.newest(at_ns)
            views, told = self._told(newest, standing, at_ns)
            return msgspec.structs.replace(
                told,
                tracks=list(views.values()),
                alerts=list(standing.alerts.values()),
                trails=self._book.trails(at_ns),
            )

    def changes(self, after_ns: int, at_ns: int, *, with_roster: bool) -> Changes:
        """Return what had changed at ``at_ns`` of what was shown at ``after_ns``."""
        with self._lock:
            before, newest = self._book.newest(after_ns), self._book.newest(at_ns)
            changed = {name for name, each in newest.items() if before.get(name) != each}
            alerts = self.course.alerted(after_ns, at_ns)
            if not with_roster:
                told = self._estimates({name: newest[name] for name in sorted(changed)})
                return Changes(at_ns, tracks=[*map(track_view, told.values())], alerts=alerts)
            views, shown = self._told(newest, self.course.at(at_ns), at_ns)
            tracks = [
                view for name, view in views.items() if name in changed or view.status == "lost"
            ]
            return msgspec.structs.replace(shown, tracks=tracks, alerts=alerts)

    def _told(
        self, newest: Mapping[NodeId, Told], standing: Standing, at_ns: int
    ) -> tuple[dict[NodeId, TrackView], Changes]:
        """Return everybody's view, and a change that has the roster and the floors."""
        tracks = self._estimates(newest)
        roster = self._roster(tracks, standing, at_ns)
        rows = {row.responder_id: row for row in roster.responders}
        views = {
            name: _as_shown(track_view(track), rows.get(name), at_ns - newest[name].at_ns)
            for name, track in tracks.items()
        }
        daps = [dap.position for dap in roster.daps if dap.position is not None]
        downs_m = [view.floor_down_m for view in views.values()]
        return views, Changes(
            at_ns,
            roster=msgspec.Raw(roster_json(roster)),
            floors=floors_of([*downs_m, *(dap.down_m for dap in daps)]),
            sites=self._coverage.sites(daps, at_ns),
            outside=list(standing.outside.values()),
        )

    def _roster(
        self, tracks: Mapping[NodeId, TrackEstimate], standing: Standing, at_ns: int
    ) -> Roster:
        """Return what the post's own function makes of what was known then."""
        known = _Known(
            estimates={name: _estimate_of(track) for name, track in tracks.items()},
            daps=standing.daps,
            heard_ns=self._heard_ns(at_ns),
            alarms=standing.told.alarms,
            health=self._newest_health(at_ns),
            movements=self._movements(at_ns),
            supplies=self._supplies(at_ns),
            orders=standing.orders,
            standing=standing,
        )
        return make_roster(known, at_ns, self._roster_settings)

    def _estimates(self, newest: Mapping[NodeId, Told]) -> dict[NodeId, TrackEstimate]:
        key = Key(self.settings.incident, "post", self.settings.post_id, "track")
        decoded = {
            name: decode(key, self.recording.payload(told.spot)) for name, told in newest.items()
        }
        return {name: each for name, each in decoded.items() if isinstance(each, TrackEstimate)}

    def _heard_ns(self, at_ns: int) -> dict[tuple[Role, str], int]:
        found = {}
        for node, series in self._of_node.items():
            times = [self.recording.newest_ns(each, at_ns) for each in series]
            heard = max((each for each in times if each is not None), default=None)
            if heard is not None:
                found[node] = heard
        return found

    def _supplies(self, at_ns: int) -> dict[tuple[Role, str], Supplies]:
        found = {}
        for series, key in self._of_topic["beat", False]:
            newest = self.recording.newest(series, at_ns)
            beat = None if newest is None else decode(key, newest[0].payload)
            if isinstance(beat, Beat) and beat.supplies is not None:
                found[key.role, key.node_id] = beat.supplies
        return found

    def _movements(self, at_ns: int) -> dict[str, LastMovement]:
        return {
            node_id: LastMovement(message, heard_ns)
            for node_id, heard_ns, message in self._newest_of("increment", at_ns)
            if isinstance(message, OdometryIncrement)
        }

    def origin(self) -> Origin | None:
        """Return where on the Earth the incident is, as the post said last; ``None`` if never."""
        for series, key in self._of_topic["origin", True]:
            newest = self.recording.newest(series, self.end_ns)
            said = None if newest is None else decode(key, newest[0].payload)
            if isinstance(said, OriginSet):
                return Origin.said(said)
        return None

    def _newest_health(self, at_ns: int) -> dict[str, NodeHealth]:
        return {
            node_id: message
            for node_id, _, message in self._newest_of("health", at_ns)
            if isinstance(message, NodeHealth)
        }

    def _newest_of(self, topic: str, at_ns: int) -> Iterator[tuple[str, int, Message | Refusal]]:
        for series, key in self._of_topic[topic, False]:
            found = self.recording.newest(series, at_ns)
            if found is not None:
                message, _ = found
                yield key.node_id, message.log_time_ns, decode(key, message.payload)

    def _note(self, series: Series, key: Key) -> None:
        if key.incident != self.settings.incident:
            return
        self._of_topic[key.topic, series.outgoing].append((series, key))
        if not series.outgoing and key.role != "post" and key.topic not in _NOT_THEIRS:
            self._of_node[key.role, key.node_id].append(series)

    def _first_heard(self) -> Iterator[Happened]:
        for (role, node_id), series in self._of_node.items():
            if role == "responder":
                at_ns = min(self.recording.first_ns(each) for each in series)
                yield Happened(at_ns, Key(self.settings.incident, role, node_id, "start"), None)

    def _rare(self) -> Iterator[Happened]:
        keys = {
            series: key
            for (topic, outgoing), found in self._of_topic.items()
            if topic in RARE and outgoing == (topic in MADE)
            for series, key in found
        }
        for recorded, _ in self.recording.located(keys):
            key = keys[Series(recorded.key, recorded.outgoing)]
            message = decode(key, recorded.payload)
            if not isinstance(message, Refusal):
                yield Happened(recorded.log_time_ns, key, message)


def _as_shown(view: TrackView, row: ResponderRow | None, since_ns: int) -> TrackView:
    """Return where somebody is who was told of so long ago: who is lost may have gone on."""
    return view if row is None else grown(view, row, since_ns / NS_PER_S)


def _estimate_of(track: TrackEstimate) -> Estimate:
    return Estimate(
        time_ns=track.event_time_ns,
        north_m=track.north_m,
        east_m=track.east_m,
        down_m=track.down_m,
        covariance_m2=track.covariance_m2,
        heading_rad=track.heading_rad,
        heading_sd_rad=track.heading_sd_rad,
        last_proximity_time_ns=track.last_proximity_time_ns,
    )


class _Known(NamedTuple):
    """What a roster is made of, as ``command_post.roster.RosterSource`` has it."""

    estimates: Mapping[str, Estimate]
    daps: Mapping[str, InstalledDap]
    heard_ns: Mapping[tuple[Role, str], int]
    alarms: Mapping[str, Mapping[AlarmKind, RaisedAlarm]]
    health: Mapping[str, NodeHealth]
    movements: Mapping[str, LastMovement]
    supplies: Mapping[tuple[Role, str], Supplies]
    orders: Orders
    standing: Standing

    def faults(self, role: Role, node_id: str, now_ns: int) -> list[str]:
        """Return what was doubted of a node, whenever that was."""
        del now_ns
        return self.standing.faults(role, node_id)
