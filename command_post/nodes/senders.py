"""What the times and numbers of their messages tell of the nodes that send them (pure).

A node dates what it says by its own clock, and numbers it under each key. Whose clock is wrong is
seen by when its messages arrive; that two nodes go by one id, by numbers that begin anew again and
again. Nothing here runs on its own: time is what the caller says it is.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple, TypeAlias

from command_post.fusion.time_line import within_time
from command_post.nodes.node_clock import KnownClock, NodeClock
from command_post.nodes.notices import WRONG_CLOCK
from shared.messages import Beat, Message
from shared.seal import Seal
from shared.topics import TOPICS, Key, Role
from shared.units import NS_PER_S

Node: TypeAlias = tuple[Role, str]

LIVE_TOPICS = frozenset({"increment", "health", "imu", "rssi", "proximity", "beat"})
"""What is said as it happens: on arrival it is as old as the way was long, if the clock is right.

The rest may be told of long after, or to whoever asks; and so may what comes from a journal.
"""

WRONG_NS = 10 * NS_PER_S
WINDOW_NS = 30 * NS_PER_S
TOLD_NS = NS_PER_S
"""A clock whose offset is known is told of when it is off, or not known, by more than this."""

MOST_BEGINNINGS = 3
BEGINNINGS_WITHIN_NS = 60 * NS_PER_S

_UNITS_S = ((86_400.0, "d"), (3600.0, "h"), (60.0, "min"), (1.0, "s"), (1e-3, "ms"))


class Finding(NamedTuple):
    """What is wrong with a node: the kind, to count by, and the words."""

    kind: str
    node: Node
    words: str


class Senders:
    """All nodes that were heard.

    A clock of which its node states nothing is *wrong* when it seems off by more than ``WRONG_NS``,
    or 25 holds if that is more: in an exercise in a hurry a machine that is busy for some
    seconds makes all messages late by as much, and no clock is to blame. One by which messages
    come before they were sent is wrong by that alone.
    """

    def __init__(self, hold_ns: int, post_id: str = "post") -> None:
        self._post_id = post_id
        self._wrong_ns = max(WRONG_NS, 25 * hold_ns)
        self._window_ns = max(WINDOW_NS, 75 * hold_ns)
        self._clocks: dict[Node, NodeClock] = {}
        self._numberings: dict[Key, _Numbering] = {}
        self._doubled_ns: dict[Node, int] = {}
        self._told: set[tuple[str, Node]] = set()
        self.begun_anew = 0
        """How often the numbers under a key have begun anew."""

    def hear(
        self, key: Key, message: Message, now_ns: int, seal: Seal | None = None
    ) -> list[Finding]:
        """Take in a message received at ``now_ns``; return what it shows for the first time."""
        node = (key.role, key.node_id)
        clock = self._clock(node)
        if isinstance(message, Beat):
            clock.heed(message, seal)
        # From a journal it may be of any age, and of a process whose clock was another.
        if seal is None or not TOPICS[key.topic].journalled:
            age_ns, process = now_ns - message.event_time_ns, None if seal is None else seal.run
            clock.hear(age_ns, now_ns, live=key.topic in LIVE_TOPICS, process=process)
        numbering = self._numberings.get(key)
        if numbering is None:
            numbering = self._numberings[key] = _Numbering()
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

    def clock(self, role: Role, node_id: str) -> KnownClock | None:
        """Return what is known of a node's clock; ``None`` if nothing is."""
        clock = self._clocks.get((role, node_id))
        return None if clock is None or not clock.known else clock.now

    def states_clock(self, role: Role, node_id: str) -> bool:
        """Say whether a node has stated how its clock stands to the post's, and can be right."""
        clock = self._clocks.get((role, node_id))
        return clock is not None and clock.stated

    def seems_old(self, message: Message, now_ns: int) -> bool:
        """Say whether a message's age would need either a long way or a wrong clock."""
        return now_ns - message.event_time_ns > self._wrong_ns

    def time_ns(self, role: Role, node_id: str, said_ns: int, seal: Seal | None = None) -> int:
        """Return when, on the post's clock, it was what a node says in a message with ``seal``."""
        clock = self._clocks.get((role, node_id))
        return within_time(said_ns + (0 if clock is None else clock.offset_ns(said_ns, seal)))

    def _clock(self, node: Node) -> NodeClock:
        if node not in self._clocks:
            self._clocks[node] = NodeClock(self._post_id, self._wrong_ns, self._window_ns)
        return self._clocks[node]

    def _findings(self, node: Node, now_ns: int) -> list[Finding]:
        found = []
        doubled_ns = self._doubled_ns.get(node)
        if doubled_ns is not None and now_ns - doubled_ns < BEGINNINGS_WITHIN_NS:
            words = "two units go by this id, or one begins anew over and over"
            found.append(Finding("doubled_id", node, words))
        clock = self._clocks.get(node)
        return found if clock is None else found + _clock_findings(node, clock)

    def _is_news(self, found: Finding) -> bool:
        what = (found.kind, found.node)
        if what in self._told:
            return False
        self._told.add(what)
        return True


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


def _clock_findings(node: Node, clock: NodeClock) -> list[Finding]:
    found = []
    way_ns = clock.contradiction_ns
    if way_ns is not None:
        sooner = "before they were sent" if way_ns < 0 else "after they were sent"
        words = (
            f"what it says of its clock is wrong: messages would come {_in_words(way_ns)} {sooner}"
        )
        found.append(Finding("false_clock", node, words))
    offset_ns, uncertainty_ns = clock.now
    if uncertainty_ns is None:
        if offset_ns:
            found.append(Finding(WRONG_CLOCK, node, _off(offset_ns)))
    elif abs(offset_ns) > TOLD_NS:
        known = f"{_off(offset_ns)}, known to {_in_words(uncertainty_ns)}"
        found.append(Finding(WRONG_CLOCK, node, known))
    elif uncertainty_ns > TOLD_NS:
        found.append(
            Finding("unsure_clock", node, f"clock known to {_in_words(uncertainty_ns)} only")
        )
    return found


def _off(offset_ns: int) -> str:
    return f"clock {'behind' if offset_ns > 0 else 'ahead'} by {_in_words(offset_ns)}"


def _in_words(duration_ns: int) -> str:
    duration_s = abs(duration_ns) / NS_PER_S
    size_s, unit = next((each for each in _UNITS_S if duration_s >= each[0]), _UNITS_S[-1])
    value = duration_s / size_s
    return f"{round(value, 1):g} {unit}" if value < 9.95 else f"{value:.0f} {unit}"
