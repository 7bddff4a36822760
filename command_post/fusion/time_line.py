"""One order for what many nodes say: events are held back a little, then released by their time.

Nothing here runs on its own: time is what the caller says it is, so the same arrivals release the
same events in the same order.
"""

from __future__ import annotations

import heapq
from collections import Counter, deque
from typing import Annotated, NamedTuple

import msgspec
from msgspec import Meta, structs

from shared.messages import Message, OdometryIncrement
from shared.topics import Key

REMEMBERED_PER_KEY = 512
LATEST_TIME_NS = 2**63 - 1


class TimeLineSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How long an event waits for earlier ones, and how many may wait at once.

    ``hold_s`` is as long as the way of fusing needs where it is ``None``.
    """

    hold_s: Annotated[float, Meta(ge=0.0, le=60.0)] | None = None
    capacity: Annotated[int, Meta(ge=1, le=10_000_000)] = 100_000


def within_time(time_ns: int) -> int:
    """Return ``time_ns``, or the first or last time that there is."""
    return min(max(time_ns, 0), LATEST_TIME_NS)


class Event(NamedTuple):
    """A message with the key it came under, and when it happened on the post's clock."""

    key: Key
    message: Message
    time_ns: int

    @property
    def dated(self) -> Message:
        """The message, with its times on the post's clock."""
        message, ahead_ns = self.message, self.time_ns - self.message.event_time_ns
        if not ahead_ns:
            return message
        if isinstance(message, OdometryIncrement):
            start_ns = within_time(message.start_time_ns + ahead_ns)
            return structs.replace(message, event_time_ns=self.time_ns, start_time_ns=start_ns)
        return structs.replace(message, event_time_ns=self.time_ns)


class _Waiting(NamedTuple):
    """Orders events by when they are due, then canonically: event time, key, number.

    ``arrival`` decides between two of which neither is known to repeat the other.
    """

    due_ns: int
    time_ns: int
    key_text: str
    sequence: int
    arrival: int
    event: Event


class TimeLine:
    """Holds events back for a while after their time, and releases them in canonical order.

    An event is due ``hold_ns`` after its own time, whenever it came, so that all that come in time
    leave in one order: by event time, key and number. One that comes after it was due is *late*:
    it is released at once. The time of a node whose clock is far ahead is not waited for: such an
    event is due two holds after it came.

    ``counts``: ``late``, ``repeated`` (same key, number and event time among the last 512 of its
    key: dropped) and ``crowded_out`` (released early because ``capacity`` events were waiting).
    """

    def __init__(self, hold_ns: int, capacity: int) -> None:
        self._hold_ns = hold_ns
        self._capacity = capacity
        self._waiting: list[_Waiting] = []
        self._remembered: dict[Key, _Remembered] = {}
        self._arrived = 0
        self.counts: Counter[str] = Counter()

    def put(self, event: Event, now_ns: int) -> None:
        """Take ``event`` in, received at ``now_ns``; drop it if it was here before."""
        key, message, time_ns = event
        remembered = self._remembered.get(key)
        if remembered is None:
            remembered = self._remembered[key] = _Remembered(str(key))
        if not remembered.is_new(message):
            self.counts["repeated"] += 1
            return
        due_ns = min(time_ns, now_ns + self._hold_ns) + self._hold_ns
        self.counts["late"] += due_ns <= now_ns
        order = (due_ns, time_ns, remembered.key_text, message.sequence, self._arrived)
        self._arrived += 1
        heapq.heappush(self._waiting, _Waiting(*order, event))

    @property
    def due_ns(self) -> int | None:
        """When the first of what waits is due; ``None`` if nothing does."""
        return self._waiting[0].due_ns if self._waiting else None

    def release(self, now_ns: int) -> list[Event]:
        """Return what is due at ``now_ns``, in order."""
        released = []
        while self._waiting and (
            self._waiting[0].due_ns <= now_ns or len(self._waiting) > self._capacity
        ):
            first = heapq.heappop(self._waiting)
            self.counts["crowded_out"] += first.due_ns > now_ns
            released.append(first.event)
        return released

    def release_all(self) -> list[Event]:
        """Return everything that waits, in order."""
        return [heapq.heappop(self._waiting).event for _ in range(len(self._waiting))]

    def __len__(self) -> int:
        return len(self._waiting)


class _Remembered:
    """The last messages of one key, by number and time: a sender that restarts counts from 0."""

    def __init__(self, key_text: str) -> None:
        self.key_text = key_text
        self._order: deque[tuple[int, int]] = deque()
        self._known: set[tuple[int, int]] = set()

    def is_new(self, message: Message) -> bool:
        """Say whether ``message`` is not among them, and remember it."""
        mark = (message.sequence, message.event_time_ns)
        if mark in self._known:
            return False
        if len(self._order) == REMEMBERED_PER_KEY:
            self._known.discard(self._order.popleft())
        self._order.append(mark)
        self._known.add(mark)
        return True
