"""Until when responders have told all that they moved: who beats and is waited for may walk (pure).

Of who stands nothing is heard but that their unit is at work. That says that they stand only if
nothing is on its way that says otherwise: no stride in its journal that has not come, and no sensor
that it has still to follow.
"""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from statistics import median
from typing import NamedTuple

from command_post.nodes.senders import Senders
from shared.messages import Beat, Message
from shared.received_numbers import ReceivedNumbers
from shared.seal import Seal
from shared.topics import TOPICS, Key
from shared.units import NS_PER_S

MOST_RUNS = 4
"""Journals of a node that are counted: older ones are of no unit that is at work."""

BEATS_REMEMBERED = 5


class AllTold(NamedTuple):
    """Until when, on the post's clock, and how long it is from beat to beat, if it beats."""

    time_ns: int
    beat_s: float | None


class ToldUntil:
    """All responders that were heard.

    Who never beat sends what they have to say as it happens, and has told all by whatever comes.
    """

    def __init__(self, senders: Senders) -> None:
        """Know by ``senders`` when it was, on the post's clock, what a unit says."""
        self._senders = senders
        self._units: dict[str, _Unit] = {}

    def hear(self, key: Key, message: Message, seal: Seal | None) -> AllTold | None:
        """Return until when a responder has now told all; ``None`` if that is not certain."""
        unit = self._units.get(key.node_id)
        if unit is None:
            unit = self._units[key.node_id] = _Unit()
        until_ns: int | None = None
        if isinstance(message, Beat):
            until_ns = unit.beat(message)
        elif seal is not None and TOPICS[key.topic].journalled:
            until_ns = unit.count(seal)
        if not unit.beats:
            until_ns = message.event_time_ns
        if until_ns is None:
            return None
        return AllTold(self._senders.time_ns(key.role, key.node_id, until_ns, seal), unit.beat_s)


class _Unit:
    """What has come of one responder's journals, and when their beats were."""

    def __init__(self) -> None:
        self._runs: dict[bytes, ReceivedNumbers] = {}
        self._beats_ns: deque[int] = deque(maxlen=BEATS_REMEMBERED)
        self._waits: tuple[ReceivedNumbers, int] | None = None
        """For what the newest beat waits, and what it says once that has come."""

    @property
    def beats(self) -> bool:
        """Whether it has ever beaten."""
        return bool(self._beats_ns)

    @property
    def beat_s(self) -> float | None:
        """The usual time from beat to beat; ``None`` after one."""
        times_ns = list(self._beats_ns)
        gaps_ns = [abs(after - before) for before, after in pairwise(times_ns)]
        return median(gaps_ns) / NS_PER_S if gaps_ns else None

    def count(self, seal: Seal) -> int | None:
        """Take in the number of a message of a journal; return what it makes certain."""
        self._numbers(seal.run).take(seal.number)
        return self._all_told_ns()

    def beat(self, beat: Beat) -> int | None:
        """Return until when all was told, by a beat that says what there is."""
        self._beats_ns.append(beat.event_time_ns)
        numbers = self._numbers(bytes.fromhex(beat.run))
        # What is acknowledged a post has, though perhaps from before it was started again.
        kept_from = max(beat.kept_from, beat.acknowledged + 1)
        numbers.heed(kept_from, beat.last_number, beat.lost)
        until_ns = beat.event_time_ns
        if beat.followed_until_ns is not None:
            until_ns = min(beat.followed_until_ns, until_ns)
        self._waits = numbers, until_ns
        return self._all_told_ns()

    def _all_told_ns(self) -> int | None:
        if self._waits is None or self._waits[0].missing:
            return None
        until_ns, self._waits = self._waits[1], None
        return until_ns

    def _numbers(self, run: bytes) -> ReceivedNumbers:
        numbers = self._runs.get(run)
        if numbers is None:
            numbers = self._runs[run] = ReceivedNumbers()
            if len(self._runs) > MOST_RUNS:
                del self._runs[next(iter(self._runs))]
        return numbers
