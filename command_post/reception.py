"""Who is let in to the incident, and what is held against those who send what is of no use."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from threading import Lock
from typing import Any

import structlog

from command_post.nodes.patience import Patience
from shared.bus.fair_inbox import FairInbox, sender_of
from shared.bus.interface import Received
from shared.codec import Refusal, decode, parse_key
from shared.gate import Gate, JournalRun, Missing, Turned
from shared.topics import TOPICS

MOST_TOLD = 4096
"""What is told once of each sender, of how many."""

ITS_OWN_FAULT: frozenset[Turned] = frozenset({"too_many_runs"})
"""Of what is turned away, what the node must have said itself, and now."""

OTHER = "?"

_log = structlog.stdlib.get_logger(__name__)


class Reception:
    """Asks the gate, and slows down in the inbox whoever sends too much that is of no use.

    ``heard`` counts what was let in, by topic.
    """

    def __init__(self, gate: Gate, inbox: FairInbox[Any]) -> None:
        self._gate = gate
        self.at_gate = Lock()
        """To be held by whoever else asks the gate anything, or tells it."""

        self._inbox = inbox
        self._patience = Patience(time.monotonic())
        self._told: set[tuple[str, str]] = set()
        self.heard: Counter[str] = Counter()

    def lets_in(self, received: Received) -> bool:
        """Say whether a message is to be recorded and handled; where not, it is counted."""
        key, payload = received
        sender = sender_of(key)
        with self.at_gate:
            why = self._gate.admit(key, payload)
        if why is not None:
            if why != "repeated":
                self._tell_once(f"turned away: {why}", sender)
                if why in ITS_OWN_FAULT:
                    self.blame(received)
            return False
        if not self._patience.bears(sender, len(payload), time.monotonic()):
            parsed = parse_key(key)
            if isinstance(parsed, Refusal) or isinstance(decode(parsed, payload), Refusal):
                self._patience.count(sender)
                self._slow_down(sender)
                return False
        topic = key.rpartition("/")[2]
        self.heard[topic if topic in TOPICS else OTHER] += 1
        return True

    def blame(self, received: Received) -> None:
        """Hold it against its sender that a message was of no use."""
        sender = sender_of(received.key)
        if not self._patience.charge(sender, len(received.payload), time.monotonic()):
            self._slow_down(sender)

    def missing(self, behind: Mapping[JournalRun, int]) -> list[Missing]:
        """Say what is missing, to the collector's thread."""
        with self.at_gate:
            return self._gate.missing(behind)

    def useless(self) -> Counter[str]:
        """Return how much of no use each sender has sent."""
        useless = self._patience.useless.copy()
        for (_, sender), count in self._inbox.lost().items():
            useless[sender] += count
        return useless

    def tell_losses(self, unhandled: int = 0) -> None:
        """Log what was not let in, and what was not even looked at: ``unhandled``, and more."""
        for sender, count in sorted(self.only_counted.items()):
            _log.warning("of no use, and not recorded", sender=sender, count=count)
        for (why, sender), count in sorted(self._inbox.lost().items()):
            _log.error("the post did not hear all", why=why, sender=sender, count=count)
        if late := unhandled + len(self._inbox):
            _log.warning("heard too late to be handled", count=late)

    @property
    def only_counted(self) -> Counter[str]:
        """How much of it was too much to be recorded, by sender."""
        return self._patience.only_counted

    def _slow_down(self, sender: str) -> None:
        self._inbox.slow_down(sender)
        self._tell_once("floods the post with what is of no use: most is only counted", sender)

    def _tell_once(self, what: str, sender: str) -> None:
        if (what, sender) not in self._told and len(self._told) < MOST_TOLD:
            self._told.add((what, sender))
            _log.warning(what, sender=sender)
