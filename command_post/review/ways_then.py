"""Ways out and to who is down, as the page would have found them at a moment of the past.

They go along what had been walked by then, found by what finds them live. Going on takes what was
told since; going back begins anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

from command_post.review.past import Past
from command_post.ways import Way
from command_post.web.pathfinder import Pathfinder
from shared.mcap_reader import RecordedMessage
from shared.messages import NodeId


class WaysThen:
    """Finds ways of the past; any thread may ask, one at a time is answered."""

    def __init__(self, past: Past) -> None:
        self._past = past
        self._lock = Lock()
        self._begin()

    def way_out(self, responder_id: NodeId, at_ns: int) -> Way | None:
        """Return the quickest way out that somebody had, if one had been walked."""
        with self._at(at_ns) as paths:
            return paths.way_out(responder_id)

    def rescue(self, responder_id: NodeId, at_ns: int) -> tuple[NodeId, Way] | None:
        """Return who of the others was soonest there, and by what way, if there was any."""
        with self._at(at_ns) as paths:
            return paths.rescue(responder_id)

    def _begin(self) -> None:
        self._paths = Pathfinder()
        self._coming = self._past.told()
        self._next = next(self._coming, None)
        self._at_ns = 0

    @contextmanager
    def _at(self, at_ns: int) -> Iterator[Pathfinder]:
        roster = self._past.roster(at_ns)
        with self._lock:
            if at_ns < self._at_ns:
                self._begin()
            self._at_ns = at_ns
            for each in self._told_by(at_ns):
                self._paths.publish(each.key, each.payload)
            self._paths.show(roster)
            yield self._paths

    def _told_by(self, at_ns: int) -> Iterator[RecordedMessage]:
        while self._next is not None and self._next.log_time_ns <= at_ns:
            yield self._next
            self._next = next(self._coming, None)
