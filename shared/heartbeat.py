"""A node tells twice a second what its journal holds, answers for it, and heeds receipts.

And as soon as it has a link again: it is heard at once, and what it said meanwhile is asked for.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Self

from shared.bus.inbox import Inbox
from shared.bus.interface import Bus, Received
from shared.codec import message_of
from shared.gate import Gate, Verifier
from shared.messages import Beat, ClockStatement, NodeId, Receipt, Supplies, TimeNs
from shared.outbox import JournalledOutbox
from shared.refill import reply_to
from shared.sender import Sender
from shared.topics import Key, Role, journal_key

PERIOD_S = 0.5
"""Between two beats a way round is found: with one a second, a responder was silent for three."""
MOST_RECEIPTS = 64
"""Receipts that wait to be read: each tells all that those before it told."""


class Heartbeat:
    """The beat of one node, on a thread of its own within a ``with`` block."""

    def __init__(
        self,
        bus: Bus,
        incident: NodeId,
        role: Role,
        node_id: NodeId,
        outbox: JournalledOutbox,
        *,
        verifier: Verifier | None = None,
        now_ns: Callable[[], TimeNs] = time.time_ns,
        clock_statement: Callable[[bytes], ClockStatement | None] = lambda _: None,
        supplies: Callable[[], Supplies | None] = lambda: None,
        followed_until_ns: Callable[[], TimeNs | None] = lambda: None,
    ) -> None:
        """Answer for the journal from now on.

        ``now_ns``: the clock that the node dates by; ``clock_statement``: what it knows of that
        clock, for the journal of a run. ``supplies``: what it has left. Until ``followed_until_ns``
        its wearer was followed. ``verifier`` tells whose receipts are heeded: without one,
        everybody's.
        """
        self._now_ns = now_ns
        self._bus = bus
        self._outbox = outbox
        self._clock_statement = clock_statement
        self._supplies = supplies
        self._followed_until_ns = followed_until_ns
        self._leaves = self._is_meant = False
        self._sender = Sender(bus, incident, role, node_id, outbox)
        self._role: Role = role
        self._node_id = node_id
        self._gate = Gate(verifier)
        self._receipts: Inbox[Received] = Inbox(MOST_RECEIPTS)
        self._stop = threading.Event()
        self._wake = threading.Event()
        # No daemon: it is inside Zenoh when it publishes.
        self._thread = threading.Thread(target=self._run, name="heartbeat", daemon=False)
        bus.subscribe(str(Key(incident, "post", "*", "receipt")), self._receipts.put)
        bus.answer(
            journal_key(incident, role, node_id), lambda request: reply_to(request, outbox.rows)
        )

        bus.on_link(self._wake.set)

    def beat(self) -> None:
        """Heed the receipts that have come, and tell what is held."""
        for received in self._receipts.get_all():
            self._heed(received)
        self._outbox.tend()
        # Asked first: what is followed meanwhile may not be in the journal yet.
        followed_until_ns = self._followed_until_ns()
        for holding in self._outbox.holdings():
            self._sender.send(
                Beat(
                    event_time_ns=self._now_ns(),
                    sequence=self._sender.next_sequence(Beat),
                    run=holding.run.hex(),
                    last_number=holding.last_number,
                    kept_from=holding.kept_from,
                    acknowledged=holding.acknowledged,
                    lost=holding.lost,
                    clock=self._clock_statement(holding.run),
                    supplies=self._supplies(),
                    leaves=self._leaves,
                    followed_until_ns=followed_until_ns,
                )
            )

    def __enter__(self) -> Self:
        """Begin to beat."""
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Beat a last time, and no more: saying so, if this is as it was meant."""
        self._is_meant = kind is None
        self._stop.set()
        self._wake.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stop.is_set():
            self.beat()
            self._wake.wait(PERIOD_S)
            self._wake.clear()
        self._leaves = self._is_meant
        self.beat()

    def _heed(self, received: Received) -> None:
        if self._gate.admit(received.key, received.payload) is not None:
            return
        receipt = message_of(received.key, received.payload)
        if not isinstance(receipt, Receipt):
            return
        for safe in receipt.safe:
            if (safe.role, safe.node_id) == (self._role, self._node_id):
                self._outbox.acknowledge(bytes.fromhex(safe.run), safe.number)
