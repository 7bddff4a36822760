"""What comes over a link to TAK (pure): bytes in any pieces, events cut from them, words of those.

Whoever is at the other end may send anything. What is no event that matters here leaves no trace.
Of maydays so many stand at the most: the post keeps each until it is taken back.
"""

from __future__ import annotations

from collections.abc import Iterator

from command_post.gateways.cot import LONGEST_EVENT_BYTES, Heard, read_event
from shared.geodesy import Origin
from shared.messages import LocalPosition, OutsideWord

PLACE_SD_M = 10.0
"""How well a place from TAK is known, where nothing says it."""

MOST_MAYDAYS = 200
FURTHEST_M = 1e6

_END = b"</event>"


class EventStream:
    """Cuts a stream of bytes into events, and gives those that say something."""

    def __init__(self) -> None:
        self._held = bytearray()
        self._too_long = False

    def feed(self, data: bytes) -> Iterator[Heard]:
        """Take in what has come; yield what was said. It matters not in which pieces it comes."""
        looked_at = max(0, len(self._held) - len(_END) + 1)
        self._held += data
        while (end := self._held.find(_END, looked_at)) >= 0:
            event, too_long = bytes(self._held[:end]), self._too_long or end > LONGEST_EVENT_BYTES
            del self._held[: end + len(_END)]
            looked_at, self._too_long = 0, False
            heard = None if too_long else read_event(event.lstrip() + _END)
            if heard is not None:
                yield heard
        if len(self._held) > LONGEST_EVENT_BYTES:
            # It is no event, whatever comes yet; only its end is looked for.
            del self._held[: -len(_END)]
            self._too_long = True


class OutsideWords:
    """Makes words for the post of what is heard."""

    def __init__(self, origin: Origin | None) -> None:
        self.origin = origin
        """Where the incident is; while nobody knows, what is heard is nowhere."""

        self._sequence = 0
        self._maydays: set[str] = set()

    def word(self, heard: Heard, now_ns: int) -> OutsideWord | None:
        """Return what the post is told; ``None`` for one mayday too many."""
        if heard.kind == "cancel":
            self._maydays.discard(heard.uid)
        if heard.kind == "mayday":
            if len(self._maydays | {heard.uid}) > MOST_MAYDAYS:
                return None
            self._maydays.add(heard.uid)
        self._sequence += 1
        return OutsideWord(
            event_time_ns=now_ns, sequence=self._sequence, kind=heard.kind, uid=heard.uid,
            callsign=heard.callsign or heard.uid, words=heard.words,
            position=self._position(heard),
        )  # fmt: skip

    def _position(self, heard: Heard) -> LocalPosition | None:
        if heard.place is None or self.origin is None:
            return None
        north_m, east_m, down_m = self.origin.local(heard.place)
        if not max(abs(north_m), abs(east_m), abs(down_m)) < FURTHEST_M:
            return None
        variance_m2 = PLACE_SD_M**2
        return LocalPosition(
            north_m=north_m, east_m=east_m, down_m=down_m,
            covariance_m2=(variance_m2, 0.0, variance_m2),
        )  # fmt: skip
