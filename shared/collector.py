"""The collector: asks the nodes' journals for what has not come, as fast as the links bear it.

What it gets goes the way of everything heard: whoever hears it has the gate judge it.
"""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Literal, TypeAlias

import structlog

from shared.bus.inbox import Inbox
from shared.bus.interface import Bus, Received
from shared.codec import Refusal, parse_key
from shared.gate import JournalRun, Missing
from shared.messages import NodeId
from shared.refill import refilled, request_of
from shared.refill_plan import Ask, RefillPlan
from shared.topics import Role, journal_key

TIMEOUT_S = 1.5
IDLE_S = 0.1
SILENCE_S = 3.0
"""Who has not beaten for so long was away."""

MOST_REPLIES = 8
MOST_BEATS = 10_000
MOST_NODES = 4096

WhatIsMissing: TypeAlias = Callable[[Mapping[JournalRun, int]], list[Missing]]
"""``Gate.missing``, made fit to be called from the collector's thread."""

Count: TypeAlias = Literal["asked", "unanswered", "refilled", "unasked"]

_log = structlog.stdlib.get_logger(__name__)


class Collector:
    """Refills what is missing, on a thread that ``run`` is given.

    ``counts``: requests ``asked`` and ``unanswered``; messages ``refilled`` (handed on), and what
    replies had that was not asked for (``unasked``).
    """

    def __init__(
        self,
        bus: Bus,
        incident: NodeId,
        missing: WhatIsMissing,
        put: Callable[[Received], None],
        *,
        has_room: Callable[[], bool] = lambda: True,
        is_seen: Callable[[JournalRun], bool] = lambda _: True,
        of: Role | Literal["*"] = "*",
    ) -> None:
        """``put`` takes what has come, as long as it ``has_room``; ``of``: whose journals.

        ``is_seen`` says whether all that was put of a journal has been let in, or turned away.
        """
        self.counts: Counter[Count] = Counter()
        self._bus = bus
        self._incident = incident
        self._missing = missing
        self._put = put
        self._has_room = has_room
        self._is_seen = is_seen
        self._plan = RefillPlan()
        self._beats: Inbox[Received] = Inbox(MOST_BEATS)
        self._heard_s: dict[tuple[Role, str], float] = {}
        bus.subscribe(f"clew/v1/{incident}/{of}/*/beat", self._beats.put)

    def run(self, stop: threading.Event) -> None:
        """Collect until ``stop`` is set. The thread must be no daemon: it is inside Zenoh."""
        while not stop.wait(self.collect()):
            pass

    def collect(self) -> float:
        """Make one request, if one is due; return how many seconds to wait until the next."""
        now_s = time.monotonic()
        self._heed_beats(now_s)
        if not self._has_room():
            return IDLE_S
        ask = self._plan.next(self._missing(self._plan.behind), now_s, self._is_seen)
        return IDLE_S if ask is None else self._make(ask)

    def _make(self, ask: Ask) -> float:
        journal = ask.missing.journal
        key = journal_key(self._incident, journal.role, journal.node_id)
        self.counts["asked"] += 1
        asked_s = time.monotonic()
        replies = self._bus.query(key, TIMEOUT_S, request_of(ask.missing, ask.rows))
        duration_s = time.monotonic() - asked_s
        if not replies:
            self.counts["unanswered"] += 1
            return self._plan.unanswered(ask)
        found: set[int] = set()
        # Whoever else answers under the key must not keep the node's own reply out.
        for reply in replies[:MOST_REPLIES]:
            taken = refilled(reply.payload, journal, self._incident, ask.hole)
            self.counts["unasked"] += taken.unasked
            self.counts["refilled"] += len(taken.messages)
            for number in sorted(taken.messages):
                self._put(Received(*taken.messages[number]))
            found |= taken.messages.keys()
        return self._plan.replied(ask, max(found, default=None), len(found), duration_s)

    def _heed_beats(self, now_s: float) -> None:
        """Note who is back after a silence."""
        for beat in self._beats.get_all():
            key = parse_key(beat.key)
            if isinstance(key, Refusal):
                continue
            node = (key.role, key.node_id)
            if now_s - self._heard_s.pop(node, 0.0) > SILENCE_S:
                self._plan.came_back(*node)
            self._heard_s[node] = now_s
            if len(self._heard_s) > MOST_NODES:
                del self._heard_s[next(iter(self._heard_s))]
