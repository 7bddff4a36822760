"""The gist of a recording: what it takes to go on from what was told last (pure).

All of a long incident cannot be handled again in the seconds that a post has, nor even be read.
What it had told last of everybody is as good to go on from: of what is rare all is handled again,
without being fused, of the rest the last minute, and the last under each key; and journals' numbers
are noted, so that nothing is missed. That is taken from a recording as it grows. It consists of
messages as they are on the wire, and of plain numbers, so that any version can read what another
has kept.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

import msgspec

from command_post.fusion.track import Estimate
from command_post.handing_over import FUSED
from command_post.known_keys import KnownKeys
from command_post.resuming.last_told import LastTold, Recorded
from shared.codec import decode
from shared.gate import Gate, Remembered
from shared.gate_notes import GateNotes, noted, recalled
from shared.messages import Alert, DapEstimate, Message, TrackEstimate
from shared.topics import TOPICS, Key
from shared.units import NS_PER_S

FORMAT = "gist 1"
"""What tells a gist that can be read from any other."""

TAIL_NS = 60 * NS_PER_S
"""So much of what is said all the time tells how it is now."""

MOST_IN_TAIL = 20_000
MOST_OF_A_KEY = 1000
"""Of what is rare, so many of the last under each key."""

MOST_KEYS = 16_384
MOST_OF_EACH = 1000
"""Of what was told, of so many responders, DAPs and alerts each."""

RARE = frozenset(
    name for name, topic in TOPICS.items() if not topic.rate_hz and name not in FUSED
) | {"start", "installation"}


class _Message(NamedTuple):
    """A message as it was recorded."""

    log_time_ns: int
    key: str
    payload: bytes
    outgoing: bool


class _Packed(msgspec.Struct, array_like=True, frozen=True):
    moves: int
    last_ns: int
    gate: GateNotes
    messages: list[_Message]


class Gist:
    """Takes in a recording's messages in their order, and decodes few of them. Bounded."""

    def __init__(self) -> None:
        self._keys = KnownKeys()
        self._gate = Gate()
        self._rare: dict[str, deque[tuple[int, Recorded]]] = {}
        self._tail: deque[tuple[int, Recorded]] = deque(maxlen=MOST_IN_TAIL)
        self._last_heard: dict[str, tuple[int, Recorded]] = {}
        """By key: who stands still is headed as they were, who is silent was heard then."""

        self._told: dict[str, dict[str, Recorded]] = {"track": {}, "dap_place": {}, "alert": {}}
        """What was told last, by topic and by whom or what it is about."""

        self._last_told: dict[str, Recorded] = {}
        self.moves = 0
        """How many moves it has taken in."""

        self._last_ns = self._number = 0

    def read(self, recorded: Iterable[Recorded]) -> None:
        """Take in all that is ``recorded``."""
        for each in recorded:
            self.take(each)

    def take(self, each: Recorded) -> None:
        """Take in what was recorded next."""
        self._last_ns = each.log_time_ns
        key = self._keys.parsed(each.key)
        if not isinstance(key, Key):
            return
        if each.outgoing:
            self._take_told(key, each)
        else:
            self._gate.recall(each.key, each.payload)
            self.moves += key.topic == "increment"
            self._take_heard(key, each)

    @property
    def told(self) -> list[Recorded]:
        """What was told last of where each responder and each DAP is."""
        return [*self._told["track"].values(), *self._told["dap_place"].values()]

    def remembered(self) -> Remembered:
        """Return what a gate has to know of all that was received."""
        return recalled(noted(self._gate.remembered()))

    def last_told(self) -> LastTold:
        """Return what was told last, and what it takes to go on from that."""
        said = {
            topic: [(each, self._decoded(each)) for each in of.values()]
            for topic, of in self._told.items()
        }
        numbers = {
            topic: message.sequence + 1
            for topic, each in self._last_told.items()
            if (message := self._decoded(each)) is not None
        }
        return LastTold(
            {
                track.responder_id: _estimate(track)
                for _, track in said["track"]
                if isinstance(track, TrackEstimate)
            },
            {
                place.dap_id: (each.key, each.payload, place)
                for each, place in said["dap_place"]
                if isinstance(place, DapEstimate)
            },
            sorted(
                (alert for _, alert in said["alert"] if isinstance(alert, Alert)),
                key=lambda alert: alert.number,
            ),
            numbers, self._to_handle(), self.moves, self._last_ns,
        )  # fmt: skip

    def packed(self) -> bytes:
        """Return it as it is kept."""
        told = [each for of in self._told.values() for each in of.values()]
        messages = [
            _Message(each.log_time_ns, each.key, each.payload, each.outgoing)
            for each in (*self._to_handle(), *told, *self._last_told.values())
        ]
        return msgspec.msgpack.encode(
            _Packed(self.moves, self._last_ns, noted(self._gate.remembered()), messages)
        )

    @classmethod
    def unpacked(cls, data: bytes) -> Gist:
        """Return what was ``packed``. Raises ``msgspec.DecodeError``."""
        packed = msgspec.msgpack.decode(data, type=_Packed)
        gist = cls()
        gist.read(packed.messages)
        gist._gate.remember(recalled(packed.gate))
        gist.moves, gist._last_ns = packed.moves, packed.last_ns
        return gist

    def _take_heard(self, key: Key, each: Recorded) -> None:
        """Keep what is rare, and the rest for a while."""
        self._number += 1
        numbered = (self._number, each)
        if each.key in self._last_heard or len(self._last_heard) < MOST_KEYS:
            self._last_heard[each.key] = numbered
            if key.topic in RARE:
                of_key = self._rare.setdefault(each.key, deque())
                of_key.append(numbered)
                if len(of_key) > MOST_OF_A_KEY:
                    of_key.popleft()
        if key.topic not in RARE:
            self._tail.append(numbered)
        while self._tail and self._tail[0][1].log_time_ns < self._last_ns - TAIL_NS:
            self._tail.popleft()

    def _take_told(self, key: Key, each: Recorded) -> None:
        self._last_told[key.topic] = each
        if key.topic not in self._told:
            return
        match decode(key, each.payload):
            case TrackEstimate(responder_id=about) | DapEstimate(dap_id=about):
                pass
            case Alert(number=number):
                about = str(number)
            case _:
                return
        of_topic = self._told[key.topic]
        of_topic[about] = each
        if len(of_topic) > MOST_OF_EACH:
            del of_topic[next(filter(self._is_over, of_topic), about)]

    def _is_over(self, number: str) -> bool:
        """Whether an alert stands no more."""
        alert = self._decoded(self._told["alert"][number])
        return isinstance(alert, Alert) and alert.stage == "resolved"

    def _to_handle(self) -> list[Recorded]:
        rare = [numbered for of_key in self._rare.values() for numbered in of_key]
        return list(dict(sorted([*rare, *self._tail, *self._last_heard.values()])).values())

    def _decoded(self, each: Recorded) -> Message | None:
        key = self._keys.parsed(each.key)
        message = decode(key, each.payload) if isinstance(key, Key) else None
        return message if isinstance(message, Message) else None


def _estimate(track: TrackEstimate) -> Estimate:
    return Estimate(
        track.event_time_ns, track.north_m, track.east_m, track.down_m, track.covariance_m2,
        track.heading_rad, track.heading_sd_rad, track.last_proximity_time_ns, track.down_sd_m,
        track.regions_m, track.floors, track.status, track.reason,
    )  # fmt: skip
