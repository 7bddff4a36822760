"""How far the post's clock is ahead of one node's: as the node states it, or as it seems (pure).

A node that reaches the post's time service finds its offset to some milliseconds and states it in
its beats. Of one that does not, the ages of its messages on arrival tell at least a clock that is
behind by more than messages take, or ahead, so that they come before they were sent. They also tell
a statement that cannot be true.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from shared.messages import Beat, ClockSpan, ClockStatement
from shared.seal import Seal
from shared.units import NS_PER_S

LONGEST_PAUSE_NS = 2 * NS_PER_S
"""A longer one between two messages is not time in which the node was heard."""

LONGEST_WAY_NS = 3600 * NS_PER_S
"""No message takes longer: a clock that says so has been set back."""

GRAIN_NS = NS_PER_S // 10
"""Ages are kept this far apart, so that a flood of messages does not fill the memory."""

SAME_NS = 50_000_000
"""An offset is changed for one that differs by more than this, or than what is known of it."""

EARLY_NS = NS_PER_S // 10
"""A message that seems to come so long before it was sent says nothing against its clock."""

AHEAD_NS = NS_PER_S // 2
"""No message comes before it was sent: one that seems to, by more than this, tells who is ahead."""

MOST_RUNS = 16


class KnownClock(NamedTuple):
    """The post's clock is ahead of a node's by ``offset_ns``.

    That is stated by the node, to ``uncertainty_ns``; ``None`` if it is only what seems.
    """

    offset_ns: int
    uncertainty_ns: int | None


class NodeClock:
    """What is known of one node's clock. ``post_id`` is whose clock a statement must be about."""

    def __init__(self, post_id: str, wrong_ns: int, window_ns: int) -> None:
        self._post_id = post_id
        self._wrong_ns = wrong_ns
        self._ages = _Ages(wrong_ns, window_ns)
        self._process: bytes | None = None
        self._stated: _Stated | None = None
        self._spans: dict[bytes, tuple[ClockSpan, ...]] = {}
        self._applied_ns = 0
        self.contradiction_ns: int | None = None
        """How long, by what is stated, the quickest message was on its way, if that cannot be."""

    @property
    def known(self) -> bool:
        """Whether anything was heard that tells it."""
        return self._ages.known or self._stated is not None

    @property
    def stated(self) -> bool:
        """Whether the node has said how far it is off, and can be right."""
        return self._stated is not None and self.contradiction_ns is None

    @property
    def now(self) -> KnownClock:
        """What is known for what is said now."""
        if self._stated is None or not self.stated:
            return KnownClock(self._ages.wrong_by_ns, None)
        return KnownClock(self._applied_ns, self._stated.words.uncertainty_ns)

    def hear(self, age_ns: int, now_ns: int, *, live: bool, process: bytes | None) -> None:
        """Take in how old a message seemed on arrival; ``live`` if it was sent as it happened.

        ``process`` is the run that it is numbered in, if it is: another process's clock is another.
        """
        if process == self._process or self._process is None:
            self._ages.hear(age_ns, now_ns, live=live)
            self._look_for_contradiction()

    def heed(self, beat: Beat, seal: Seal | None) -> None:
        """Take in what a node states of its clock, before the age of what it says so in."""
        self._take_statement(beat, seal)
        self._look_for_contradiction()

    def _look_for_contradiction(self) -> None:
        self.contradiction_ns = None
        if self._stated is not None and self._ages.known:
            way_ns = self._ages.least_ns - self._stated.words.offset_ns
            soonest_ns = -(self._stated.words.uncertainty_ns + EARLY_NS)
            if not soonest_ns <= way_ns <= self._wrong_ns:
                self.contradiction_ns = way_ns

    def _take_statement(self, beat: Beat, seal: Seal | None) -> None:
        process = None if seal is None else seal.run
        if process != self._process:
            # Another process has read its clock anew: what held for the last one is past.
            self._process, self._stated = process, None
            self._ages.clear()
        words = beat.clock
        if words is None or words.post_id != self._post_id:
            return
        if self._stated is not None and not self._stated.goes_on(words, beat.event_time_ns):
            self._ages.clear()
        self._stated = _Stated(words, beat.event_time_ns)
        if not _same(self._applied_ns, words.offset_ns, words.uncertainty_ns):
            self._applied_ns = words.offset_ns
        run = bytes.fromhex(beat.run)
        if words.spans and (run in self._spans or len(self._spans) < MOST_RUNS):
            self._spans[run] = words.spans

    def offset_ns(self, said_ns: int, seal: Seal | None) -> int:
        """Return what is to be added to a time in a message: ``said_ns``, sealed by ``seal``."""
        if self._stated is None or not self.stated:
            return self._ages.wrong_by_ns
        span = None if seal is None else self._earlier_span(seal)
        if span is not None:
            known = _same(self._applied_ns, span.offset_ns, span.uncertainty_ns)
            return self._applied_ns if known else span.offset_ns
        drifted_ns = self._stated.drifted_ns(said_ns)
        words = self._stated.words
        return self._applied_ns + (0 if _same(0, drifted_ns, words.uncertainty_ns) else drifted_ns)

    def _earlier_span(self, seal: Seal) -> ClockSpan | None:
        """Return the span that a message is of, unless it is the one that goes on."""
        spans = self._spans.get(seal.run, ())
        if not spans or seal.number >= spans[-1].first_number:
            return None
        before = [span for span in spans if span.first_number <= seal.number]
        return before[-1] if before else spans[0]


class _Stated(NamedTuple):
    """What a node stated when its clock read ``said_ns``."""

    words: ClockStatement
    said_ns: int

    def drifted_ns(self, at_ns: int) -> int:
        """Return by how much the offset was another when the node's clock read ``at_ns``."""
        return round(self.words.drift * (at_ns - self.said_ns))

    def goes_on(self, words: ClockStatement, said_ns: int) -> bool:
        """Say whether ``words``, stated later, can be about clocks that nobody has set since."""
        apart_ns = words.offset_ns - self.words.offset_ns - self.drifted_ns(said_ns)
        return abs(apart_ns) <= words.uncertainty_ns + self.words.uncertainty_ns + EARLY_NS


class _Ages:
    """The least age on arrival of what was heard of late."""

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

    @property
    def least_ns(self) -> int:
        """The least age."""
        return self._ages[0].age_ns

    def clear(self) -> None:
        """Begin anew, with a clock of which nothing is known."""
        self._ages.clear()
        self.wrong_by_ns = 0

    def hear(self, age_ns: int, now_ns: int, *, live: bool) -> None:
        """Take in how old a message seemed on arrival; ``live`` if it was sent as it happened."""
        if age_ns > self._wrong_ns and not live:
            return
        if self._ages:
            was_far_ahead = self._ages[0].age_ns < -self._wrong_ns
            evidently_right = live and abs(age_ns) <= self._wrong_ns
            if (was_far_ahead and evidently_right) or (
                age_ns - self._ages[0].age_ns > LONGEST_WAY_NS
            ):
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
        is_wrong = least_ns > self._wrong_ns or least_ns < -AHEAD_NS
        self.wrong_by_ns = least_ns if is_wrong else 0


class _Age(NamedTuple):
    """How old a message seemed that came when the node had been heard for ``at_ns`` in all."""

    at_ns: int
    age_ns: int


def _same(offset_ns: int, another_ns: int, uncertainty_ns: int) -> bool:
    return abs(offset_ns - another_ns) <= min(uncertainty_ns, SAME_NS)
