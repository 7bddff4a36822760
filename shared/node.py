"""A node among others, live: what its parts need of it, and of one another."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import NamedTuple

from shared.bus.zenoh_bus import ZenohBus, open_zenoh
from shared.clock import PacedClock, SystemClock
from shared.gate import Verifier
from shared.heartbeat import Heartbeat
from shared.introductions import Introductions
from shared.messages import NodeId, Supplies, TimeNs
from shared.node_time import NodeTime
from shared.outbox import JournalledOutbox
from shared.security.bundle import Bundle
from shared.security.certificates import Identity
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

    @contextmanager
    def beating(
        self,
        journal: Path,
        supplies: Callable[[], Supplies | None] = lambda: None,
        followed_until_ns: Callable[[], TimeNs | None] = lambda: None,
    ) -> Iterator[NodeTime]:
        """Give its time at the post; meanwhile its heartbeat tells that, and what it has left.

        The heartbeat answers for the ``journal`` as well, beside which the time is noted.
        """
        with (
            NodeTime(
                self.bus, self.incident, self.clock, self.outbox, journal, self.verifier
            ) as node_time,
            Heartbeat(
                self.bus, self.incident, self.role, self.node_id, self.outbox,
                verifier=self.verifier, now_ns=self.clock.now_ns,
                clock_statement=node_time.statement, supplies=supplies,
                followed_until_ns=followed_until_ns,
            ),
        ):  # fmt: skip
            yield node_time


@contextmanager
def linked(
    identity: Identity, incident: NodeId, bundle: Bundle | None, journal: Path, stop: Event,
    *, connect: Sequence[str], listen: Sequence[str] = (),
) -> Iterator[Node]:  # fmt: skip
    """Give a node its journal and its links: a router where it listens, else a client.

    Raises ``FileHeldError`` for a journal that another process has, and as ``open_zenoh``.
    """
    with (
        JournalledOutbox(journal, None if bundle is None else bundle.sign) as outbox,
        open_zenoh("router" if listen else "client", connect, listen, bundle) as bus,
        Introductions(bus, incident, bundle) as introductions,
    ):
        yield Node(
            bus, incident, *identity, outbox, introductions.signers,
            PacedClock(SystemClock()), SystemClock().now_ns(), stop,
        )  # fmt: skip
