"""A node among others, live: what its parts need of it, and of one another."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event
from typing import NamedTuple

from shared.bus.zenoh_bus import ZenohBus
from shared.clock import PacedClock
from shared.gate import Verifier
from shared.heartbeat import Heartbeat
from shared.messages import ClockStatement, NodeId, Supplies, TimeNs
from shared.outbox import JournalledOutbox
from shared.sender import Sender
from shared.topics import Role


class Node(NamedTuple):
    """A responder's unit or a DAP at work, until ``stop`` is set."""

    bus: ZenohBus
    incident: NodeId
    role: Role
    node_id: NodeId
    outbox: JournalledOutbox
    verifier: Verifier | None
    clock: PacedClock
    came_ns: TimeNs
    """Since when it is there, by its own clock."""

    stop: Event

    def sender(self) -> Sender:
        """Return what says its messages, to be used by one thread."""
        return Sender(self.bus, self.incident, self.role, self.node_id, self.outbox)

    def heartbeat(
        self,
        clock_statement: Callable[[bytes], ClockStatement | None],
        supplies: Callable[[], Supplies | None] = lambda: None,
    ) -> Heartbeat:
        """Return its heartbeat, which answers for its journal and tells what it has left."""
        return Heartbeat(
            self.bus, self.incident, self.role, self.node_id, self.outbox,
            verifier=self.verifier, now_ns=self.clock.now_ns, clock_statement=clock_statement,
            supplies=supplies,
        )  # fmt: skip
