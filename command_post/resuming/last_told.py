"""What a recording has told last, and what it takes to go on from that (pure).

All of a long incident cannot be handled again in the seconds that a post has. What it had told last
of everybody is as good to go on from: of what is rare all is handled again, without being fused, of
the rest the last minute; and journals' numbers are noted, so that nothing is missed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple, Protocol

from command_post.fusion.track import Estimate
from command_post.handing_over import FUSED
from shared.codec import decode, parse_key
from shared.messages import Alert, DapEstimate, Message, TrackEstimate
from shared.topics import TOPICS, Key
from shared.units import NS_PER_S

TAIL_NS = 60 * NS_PER_S
"""So much of what is said all the time tells how it is now."""

RARE = frozenset(
    name for name, topic in TOPICS.items() if not topic.rate_hz and name not in FUSED
) | {"start", "installation"}


class Recorded(Protocol):
    """A message as it was recorded; ``outgoing`` ones were made of those received."""

    @property
    def log_time_ns(self) -> int:
        """When it was received, or made."""

    @property
    def key(self) -> str:
        """The key it came or went under."""

    @property
    def payload(self) -> bytes:
        """Its bytes."""

    @property
    def outgoing(self) -> bool:
        """Whether it was made."""


class LastTold(NamedTuple):
    """What was told last: of each responder, of each DAP (as it was said), of each alert.

    ``to_handle`` is what was received and matters still, in its order; ``moves`` counts all moves
    received. ``next_sequences`` number what is said next, by topic; ``last_ns`` is when the last
    message was recorded.
    """

    estimates: Mapping[str, Estimate]
    dap_places: Mapping[str, tuple[str, bytes, DapEstimate]]
    alerts: list[Alert]
    next_sequences: Mapping[str, int]
    to_handle: list[Recorded]
    moves: int
    last_ns: int


def read_last_told(recorded: Iterable[Recorded], note: Callable[[str, bytes], object]) -> LastTold:
    """Return what was told last of all that is ``recorded``; ``note`` is told what was received."""
    found = _Found()
    for each in recorded:
        if each.outgoing:
            found.told(each)
        else:
            note(each.key, each.payload)
            found.heard(each)
    return found.result()


class _Found:
    """Takes in a recording's messages in their order, and decodes few of them."""

    def __init__(self) -> None:
        self._keys: dict[str, Key | None] = {}
        self._kept: list[tuple[int, Recorded]] = []
        self._tail: deque[tuple[int, Recorded]] = deque()
        self._last_moves: dict[str, tuple[int, Recorded]] = {}
        """By key: who stands still is headed as they were."""

        self._tracks: dict[str, TrackEstimate] = {}
        self._daps: dict[str, tuple[str, bytes, DapEstimate]] = {}
        self._alerts: dict[int, Alert] = {}
        self._last: dict[str, Recorded] = {}
        self._moves = self._last_ns = self._number = 0

    def heard(self, each: Recorded) -> None:
        """Keep what is rare, and the rest for a while."""
        self._number += 1
        self._last_ns = each.log_time_ns
        is_first = each.key not in self._keys
        key = self._key(each.key)
        if key is None:
            return
        if key.topic == "increment":
            self._moves += 1
            self._last_moves[each.key] = (self._number, each)
        if is_first or key.topic in RARE:
            self._kept.append((self._number, each))
        else:
            self._tail.append((self._number, each))
        while self._tail and self._tail[0][1].log_time_ns < self._last_ns - TAIL_NS:
            self._tail.popleft()

    def told(self, each: Recorded) -> None:
        """Note what was said."""
        self._last_ns = each.log_time_ns
        key = self._key(each.key)
        if key is None:
            return
        self._last[key.topic] = each
        if key.topic in {"track", "dap_place", "alert"}:
            match decode(key, each.payload):
                case TrackEstimate() as track:
                    self._tracks[track.responder_id] = track
                case DapEstimate() as place:
                    self._daps[place.dap_id] = (each.key, each.payload, place)
                case Alert() as alert:
                    self._alerts[alert.number] = alert

    def result(self) -> LastTold:
        """Return what was found."""
        numbers: dict[str, int] = {}
        for topic, each in self._last.items():
            key = self._key(each.key)
            message = None if key is None else decode(key, each.payload)
            if isinstance(message, Message):
                numbers[topic] = message.sequence + 1
        return LastTold(
            {name: _estimate(track) for name, track in self._tracks.items()}, self._daps,
            [self._alerts[number] for number in sorted(self._alerts)], numbers,
            list(dict(sorted([*self._kept, *self._tail, *self._last_moves.values()])).values()),
            self._moves, self._last_ns,
        )  # fmt: skip

    def _key(self, key_text: str) -> Key | None:
        if key_text not in self._keys:
            key = parse_key(key_text)
            self._keys[key_text] = key if isinstance(key, Key) else None
        return self._keys[key_text]


def _estimate(track: TrackEstimate) -> Estimate:
    return Estimate(
        track.event_time_ns, track.north_m, track.east_m, track.down_m, track.covariance_m2,
        track.heading_rad, track.heading_sd_rad, track.last_proximity_time_ns, track.down_sd_m,
        track.regions_m, track.floors, track.status, track.reason,
    )  # fmt: skip
