"""What the times and numbers of their messages tell of the nodes that send them (pure).

A node dates what it says by its own clock, and numbers it under each key. Whose clock is wrong is
seen by when its messages arrive; that two nodes go by one id, by numbers that begin anew again and
again. Nothing here runs on its own: time is what the caller says it is.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple, TypeAlias

from command_post.fusion.time_line import within_time
from shared.messages import Message
from shared.topics import Key, Role
from shared.units import NS_PER_S

Node: TypeAlias = tuple[Role, str]

LIVE_TOPICS = frozenset({"increment", "health", "imu", "rssi", "proximity"})
"""What is said as it happens: on arrival it is as old as the way was long, if the clock is right.

The rest may be told of long after, or to whoever asks.
"""

WRONG_NS = 10 * NS_PER_S
WINDOW_NS = 30 * NS_PER_S
LONGEST_PAUSE_NS = 2 * NS_PER_S
"""A longer one between two messages is not time in which the node was heard."""

LONGEST_WAY_NS = 3600 * NS_PER_S
"""No message takes longer: a clock that says so has been set back."""

GRAIN_NS = NS_PER_S // 10
"""Ages are kept this far apart, so that a flood of messages does not fill the memory."""

MOST_BEGINNINGS = 3
BEGINNINGS_WITHIN_NS = 60 * NS_PER_S

_UNITS_S = ((86_400.0, "d"), (3600.0, "h"), (60.0, "min"), (1.0, "s"))


class Finding(NamedTuple):
    """What is wrong with a node: the kind, to count by, and the words."""

    kind: str
    node: Node
    words: str


class Senders:
    """All nodes that were heard.

    A clock is *wrong* when it is off by more than ``WRONG_NS``, or four holds if that is more: in
    an exercise in a hurry all messages are late by as much, and no clock is to blame.
    """

    def __init__(self, hold_ns: int) -> None:
        self._wrong_ns = max(WRONG_NS, 4 * hold_ns)
        self._window_ns = max(WINDOW_NS, 20 * hold_ns)
        self._clocks: dict[Node, _NodeClock] = {}
        self._numberings: dict[Key, _Numbering] = {}
        self._doubled_ns: dict[Node, int] = {}
        self._told: set[tuple[str, Node]] = set()
        self.begun_anew = 0
        """How often the numbers under a key have begun anew."""

    def hear(self, key: Key, message: Message, now_ns: int) -> list[Finding]:
        """Take in a message received at ``now_ns``; return what it shows for the first time."""
        node = (key.role, key.node_id)
        clock = self._clock(node)
        clock.hear(now_ns - message.event_time_ns, now_ns, live=key.topic in LIVE_TOPICS)
        numbering = self._numberings.setdefault(key, _Numbering())
        if numbering.begins_anew(message, now_ns):
            self.begun_anew += 1
            if numbering.too_often(now_ns):
                self._doubled_ns[node] = now_ns
        return [found for found in self._findings(node, now_ns) if self._is_news(found)]

    def faults(self, role: Role, node_id: str, now_ns: int) -> list[str]:
        """Return what is wrong with a node at ``now_ns``, in words."""
        return [found.words for found in self._findings((role, node_id), now_ns)]

    def knows_clock(self, role: Role, node_id: str) -> bool:
        """Say whether anything tells how a node's clock stands to the post's."""
        clock = self._clocks.get((role, node_id))
        return clock is not None and clock.known

    def seems_old(self, message: Message, now_ns: int) -> bool:
        """Say whether a message's age would need either a long way or a wrong clock."""
        return now_ns - message.event_time_ns > self._wrong_ns

    def time_ns(self, role: Role, node_id: str, said_ns: int) -> int:
        """Return when, on the post's clock, it was ``said_ns`` on a node's."""
        clock = self._clocks.get((role, node_id))
        offset_ns = 0 if clock is None else clock.wrong_by_ns
        return within_time(said_ns + offset_ns)

    def _clock(self, node: Node) -> _NodeClock:
        if node not in self._clocks:
            self._clocks[node] = _NodeClock(self._wrong_ns, self._window_ns)
        return self._clocks[node]

    def _findings(self, node: Node, now_ns: int) -> list[Finding]:
        found = []
        doubled_ns = self._doubled_ns.get(node)
        if doubled_ns is not None and now_ns - doubled_ns < BEGINNINGS_WITHIN_NS:
            words = "two units go by this id, or one begins anew over and over"
            found.append(Finding("doubled_id", node, words))
        clock = self._clocks.get(node)
        if clock is not None and clock.wrong_by_ns:
            which = "behind" if clock.wrong_by_ns > 0 else "ahead"
            words = f"clock {which} by {_in_words(abs(clock.wrong_by_ns))}"
            found.append(Finding("wrong_clock", node, words))
        return found

    def _is_news(self, found: Finding) -> bool:
        what = (found.kind, found.node)
        if what in self._told:
            return False
        self._told.add(what)
        return True


class _NodeClock:
    """How far the post's clock is ahead of a node's: the least age of what was heard of late."""

    def __init__(self, wrong_ns: int, window_ns: int) -> None:
        self._wrong_ns = wrong_ns
        self._window_ns = window_ns
        self._heard_ns = 0
        self._heard_for_ns = 0
        self._ages: deque[_Age] = deque()
        """Of the window, those that none after them undercuts."""

        self.wrong_by_ns = 0
        """What is to be added to the node's times; 0 for a clock that is right, or not known."""

    @property
    def known(self) -> bool:
        """Whether anything was heard that tells it."""
        return bool(self._ages)

    def hear(self, age_ns: int, now_ns: int, *, live: bool) -> None:
        """Take in how old a message seemed on arrival; ``live`` if it was sent as it happened."""
        if age_ns > self._wrong_ns and not live:
            return
        if self._ages:
            evidently_right = live and abs(age_ns) <= self._wrong_ns
            if evidently_right or age_ns - self._ages[0].age_ns > LONGEST_WAY_NS:
                self._ages.clear()
        # What was stuck on its way comes in a bunch: silence must not make the window forget.
        self._heard_for_ns += min(max(now_ns - self._heard_ns, 0), LONGEST_PAUSE_NS)
        self._heard_ns = now_ns
        while self._ages and self._ages[-1].age_ns >= age_ns:
            self._ages.pop()
        if not self._ages or self._heard_for_ns - self._ages[-1].at_ns >= GRAIN_NS:
            self._ages.append(_Age(self._heard_for_ns, age_ns))
        while self._heard_for_ns - self._ages[0].at_ns > self._window_ns:
            self._ages.popleft()
        least_ns = self._ages[0].age_ns
        self.wrong_by_ns = least_ns if abs(least_ns) > self._wrong_ns else 0


class _Age(NamedTuple):
    """How old a message seemed that came when the node had been heard for ``at_ns`` in all."""

    at_ns: int
    age_ns: int


class _Numbering:
    """The numbers that come under one key: they rise, and begin anew with a new process."""

    def __init__(self) -> None:
        self._number = -1
        self._time_ns = 0
        self._begun_ns: deque[int] = deque(maxlen=MOST_BEGINNINGS)

    def begins_anew(self, message: Message, now_ns: int) -> bool:
        """Take in the next message; say whether it begins anew.

        One that is neither later nor higher than the last is a repeat, or has taken longer.
        """
        begins = message.sequence <= self._number
        if begins and message.event_time_ns <= self._time_ns:
            return False
        self._number, self._time_ns = message.sequence, message.event_time_ns
        if begins:
            self._begun_ns.append(now_ns)
        return begins

    def too_often(self, now_ns: int) -> bool:
        """Say whether they began anew more often of late than anybody starts a unit."""
        often = len(self._begun_ns) == MOST_BEGINNINGS
        return often and now_ns - self._begun_ns[0] < BEGINNINGS_WITHIN_NS


def _in_words(duration_ns: int) -> str:
    duration_s = duration_ns / NS_PER_S
    size_s, unit = next((each for each in _UNITS_S if duration_s >= each[0]), _UNITS_S[-1])
    value = duration_s / size_s
    return f"{round(value, 1):g} {unit}" if value < 9.95 else f"{value:.0f} {unit}"
