"""How much of a journal to ask for at a time, so that what is live does not wait (pure).

Between the two stands a link of unknown delay and width, with buffers that defeat priorities: a
long reply is in the way of all that comes behind it. How long it is in the way shows in how much
longer a reply takes than the quickest ones: the delay-based congestion control of LEDBAT (RFC 6817,
sections 2.4.2 and 2.5), with one request at a time in the place of a window.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

FIRST_ROWS = 20
MOST_ROWS = 500

MOST_DELAY_S = 0.15
"""A reply that takes so much longer than the quickest is halved."""

LITTLE_DELAY_S = 0.05
"""One that takes no longer than this more may grow."""

PROBE_EVERY = 16
"""One request in so many is for a single row, which is in nobody's way."""

REMEMBERED_S = 60.0
"""How long the quickest reply counts: a unit that walks changes its way."""

SHORTEST_PAUSE_S = 0.01
LONGEST_PAUSE_S = 0.2


class _Took(NamedTuple):
    at_s: float
    duration_s: float


class Pace:
    """``rows`` to ask a node for next, and ``pause_s`` to leave the link to others before that.

    Every now and then that is a single row, and the first time: else the quickest reply would soon
    be one that was in the way itself.
    """

    def __init__(self) -> None:
        self.pause_s = SHORTEST_PAUSE_S
        self._rows = FIRST_ROWS
        self._replies = 0
        self._quickest: deque[_Took] = deque()
        """Of those remembered, the ones that none after them undercuts."""

    @property
    def rows(self) -> int:
        """How many rows to ask for next."""
        return 1 if self._replies % PROBE_EVERY == 0 else self._rows

    def replied(self, at_s: float, duration_s: float, rows: int) -> None:
        """Take in that a reply of ``rows`` came at ``at_s``, ``duration_s`` after the request."""
        self._replies += 1
        while self._quickest and self._quickest[-1].duration_s >= duration_s:
            self._quickest.pop()
        self._quickest.append(_Took(at_s, duration_s))
        while self._quickest[0].at_s < at_s - REMEMBERED_S:
            self._quickest.popleft()
        delay_s = duration_s - self._quickest[0].duration_s
        if delay_s > MOST_DELAY_S:
            self._rows = max(1, self._rows // 2)
        elif delay_s <= LITTLE_DELAY_S and rows >= self._rows:
            self._rows = min(MOST_ROWS, self._rows + max(1, self._rows // 4))
        self.pause_s = min(max(duration_s, SHORTEST_PAUSE_S), LONGEST_PAUSE_S)

    def unanswered(self) -> None:
        """Take in that no reply came in time."""
        self._rows = max(1, self._rows // 2)
        self.pause_s = LONGEST_PAUSE_S
