"""How far the post's clock is ahead of a node's, and how surely that is known (pure).

The node notes when it asked and when the answer was back, the post when it heard the question and
when it answered (as in NTP, RFC 5905, section 8). Whatever share of the round trip went which way,
the offset is within half of it: so what is stated is an interval that holds it, and no guess. An
older exchange counts for less, by how far two clocks may drift apart; how far these two do is
found by exchanges far apart.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from shared.units import NS_PER_S

MOST_DRIFT = 200e-6
"""Two quartz clocks, each off by 100 ppm: no node is believed to drift faster."""

WANDER = 5e-6
"""A drift changes by so much with the temperature."""

RECENT_NS = 60 * NS_PER_S
REMEMBERED_NS = 3600 * NS_PER_S


class Exchange(NamedTuple):
    """One question for the time, by the clocks of who says so.

    The node asked at ``asked_ns`` and had the answer at ``back_ns``; the post heard the question at
    ``heard_ns`` and answered at ``answered_ns``.
    """

    asked_ns: int
    heard_ns: int
    answered_ns: int
    back_ns: int

    @property
    def round_trip_ns(self) -> int:
        """How long question and answer were on their way."""
        return (self.back_ns - self.asked_ns) - (self.answered_ns - self.heard_ns)

    @property
    def offset_ns(self) -> int:
        """The post's clock minus the node's, if both ways took the same time."""
        return ((self.heard_ns - self.asked_ns) + (self.answered_ns - self.back_ns)) // 2

    @property
    def middle_ns(self) -> int:
        """When the offset was so, by the node's clock."""
        return (self.asked_ns + self.back_ns) // 2

    @property
    def doubt_ns(self) -> float:
        """By how much the offset may be another: half the round trip, and the drift meanwhile."""
        return (self.round_trip_ns + MOST_DRIFT * (self.back_ns - self.asked_ns)) / 2 + 1.0


class ClockOffset(NamedTuple):
    """The post's clock is ahead of the node's by ``offset_ns``, give or take ``uncertainty_ns``.

    ``drift`` is by how much the offset grows, in seconds a second.
    """

    offset_ns: int
    uncertainty_ns: int
    drift: float


class OffsetEstimator:
    """Takes exchanges in; tells the offset at any time. ``steps`` counts clocks that were set.

    An exchange that cannot be squared with those before it says that one of the clocks was set
    (the post was started anew): it alone counts then.
    """

    def __init__(self) -> None:
        self._recent: deque[Exchange] = deque()
        self._anchors: deque[Exchange] = deque()
        """Of each minute the exchange with the shortest round trip."""

        self._drift = (0.0, MOST_DRIFT)
        self.steps = 0

    def take(self, exchange: Exchange) -> bool:
        """Take an exchange in; say whether it can have been one."""
        if exchange.back_ns < exchange.asked_ns or exchange.answered_ns < exchange.heard_ns:
            return False
        if exchange.round_trip_ns < 0:
            return False
        known = self.at(exchange.middle_ns)
        if known is not None and not _agree(known, exchange):
            self.steps += 1
            self._recent.clear()
            self._anchors.clear()
        self._recent.append(exchange)
        while exchange.back_ns - self._recent[0].back_ns > RECENT_NS:
            self._recent.popleft()
        self._anchor(exchange)
        self._drift = self._find_drift()
        return True

    def at(self, now_ns: int) -> ClockOffset | None:
        """Return the offset when the node's clock reads ``now_ns``; ``None`` if nothing is known.

        It is that of the exchange that says most, carried on by the drift.
        """
        if not self._recent:
            return None
        drift, doubt = self._drift
        best = min(self._recent, key=lambda each: _uncertainty(each, now_ns, doubt))
        carried_ns = round(drift * (now_ns - best.middle_ns))
        uncertainty_ns = math.ceil(_uncertainty(best, now_ns, doubt))
        return ClockOffset(best.offset_ns + carried_ns, uncertainty_ns, drift)

    def _anchor(self, exchange: Exchange) -> None:
        anchors = self._anchors
        if not anchors or _minute(exchange) != _minute(anchors[-1]):
            anchors.append(exchange)
        elif exchange.round_trip_ns <= anchors[-1].round_trip_ns:
            anchors[-1] = exchange
        while exchange.back_ns - anchors[0].back_ns > REMEMBERED_NS:
            anchors.popleft()

    def _find_drift(self) -> tuple[float, float]:
        """Return the drift, and by how much it may be another."""
        best = min(self._recent, key=lambda each: each.doubt_ns)
        least, most = -MOST_DRIFT, MOST_DRIFT
        for anchor in self._anchors:
            apart_ns = best.middle_ns - anchor.middle_ns
            if apart_ns > 0:
                slope = (best.offset_ns - anchor.offset_ns) / apart_ns
                doubt = (best.doubt_ns + anchor.doubt_ns) / apart_ns + WANDER
                least, most = max(least, slope - doubt), min(most, slope + doubt)
        if least > most:
            return 0.0, MOST_DRIFT
        return (least + most) / 2, max((most - least) / 2, WANDER)


def _minute(exchange: Exchange) -> int:
    return exchange.back_ns // RECENT_NS


def _uncertainty(exchange: Exchange, now_ns: int, drift_doubt: float) -> float:
    return exchange.doubt_ns + drift_doubt * abs(now_ns - exchange.middle_ns)


def _agree(known: ClockOffset, exchange: Exchange) -> bool:
    apart_ns = abs(known.offset_ns - exchange.offset_ns)
    return apart_ns <= known.uncertainty_ns + exchange.doubt_ns
