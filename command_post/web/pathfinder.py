"""Who gets where, by which way that was walked (pure): it is asked seldom, and searches long."""

from __future__ import annotations

import math

from command_post.confidence import HEADING_KNOWN_RAD
from command_post.roster import Roster
from command_post.ways import Point, WalkedGround, Way
from shared.codec import Refusal, decode, parse_key
from shared.messages import NodeId, TrackEstimate
from shared.units import NS_PER_S

STEP_M = 0.3
"""Who has moved by less has gone no way."""


class Pathfinder:
    """Takes in where everybody is held to be; finds ways out and to each other."""

    def __init__(self) -> None:
        self._ground = WalkedGround()
        self._tracks: dict[NodeId, TrackEstimate] = {}
        self._walked_m: dict[NodeId, Point] = {}
        self._lost: frozenset[NodeId] = frozenset()

    def publish(self, key_text: str, payload: bytes) -> None:
        """Take in a message that the post has published; whatever is no track is passed over."""
        key = parse_key(key_text)
        if isinstance(key, Refusal) or key.topic != "track":
            return
        track = decode(key, payload)
        if not isinstance(track, TrackEstimate):
            return
        name, place_m = track.responder_id, _place(track)
        self._tracks[name] = track
        if name not in self._walked_m or math.dist(self._walked_m[name], place_m) >= STEP_M:
            self._walked_m[name] = place_m
            self._ground.walk(name, track.event_time_ns / NS_PER_S, place_m)

    def show(self, roster: Roster) -> None:
        """Take in the newest roster: who is lost is sent to nobody."""
        lost = (row.responder_id for row in roster.responders if row.status == "lost")
        self._lost = frozenset(lost)

    def way_out(self, responder_id: NodeId) -> Way | None:
        """Return the quickest way that somebody has out, if one was walked."""
        track = self._tracks.get(responder_id)
        return None if track is None else self._ground.way_out(_place(track), _heading(track))

    def rescue(self, responder_id: NodeId) -> tuple[NodeId, Way] | None:
        """Return who of the others is soonest there, and by what way, if there is any."""
        track = self._tracks.get(responder_id)
        if track is None:
            return None
        others = (
            (name, _place(other), _heading(other))
            for name, other in sorted(self._tracks.items())
            if name != responder_id and name not in self._lost and other.status != "lost"
        )
        return self._ground.quickest(_place(track), others)


def _place(track: TrackEstimate) -> Point:
    return (track.north_m, track.east_m, track.down_m)


def _heading(track: TrackEstimate) -> float | None:
    return track.heading_rad if track.heading_sd_rad < HEADING_KNOWN_RAD else None
