"""The nodes that are there: who comes, who goes, and what those who come said before."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event

import structlog

from shared.bus.inbox import Inbox
from shared.bus.interface import Bus, Received
from shared.messages import NodeId
from shared.security.certificates import Identity
from shared.topics import Key, Role, all_alive_of

ASK_PERIOD_S = 0.25
ASK_TIMEOUT_S = 0.5
MOST_COMING = 1000

_ASKED: dict[Role, str] = {"responder": "start", "dap": "installation"}
"""What is said rarely, by whom: whoever comes late asks for it."""

_log = structlog.stdlib.get_logger(__name__)


class Company:
    """Knows which responders and DAPs are alive, and asks each that comes.

    ``meet`` asks a node who it is; what it said before it was heard is given to ``hear``.
    """

    def __init__(
        self,
        bus: Bus,
        incident: NodeId,
        post_id: NodeId,
        meet: Callable[[Identity], object],
        hear: Callable[[Received], None],
    ) -> None:
        self._bus = bus
        self._incident = incident
        self._post_id = post_id
        self._meet = meet
        self._hear = hear
        self._alive: set[tuple[Role, str]] = set()
        self._joined: Inbox[Key] = Inbox(MOST_COMING)
        self._seen: Inbox[tuple[str, str, bool]] = Inbox(MOST_COMING)

    @property
    def alive(self) -> tuple[tuple[Role, str], ...]:
        """The responders and DAPs that are alive."""
        return tuple(self._alive)

    @property
    def responders(self) -> set[str]:
        """The responders among them."""
        return {node_id for role, node_id in self.alive if role == "responder"}

    def watch(self) -> None:
        """Have the bus tell who comes and goes."""
        self._bus.watch_alive(all_alive_of(self._incident), self._note)

    def greet(self, stop: Event) -> None:
        """Ask each node that comes for what it said before it was heard, until ``stop`` is set.

        The answers go the way of everything heard; what was heard before is dropped as repeated.
        """
        while not stop.is_set():
            key = self._joined.get(ASK_PERIOD_S)
            if key is None:
                continue
            self._meet(Identity(key.role, key.node_id))
            for received in self._bus.query(str(key), ASK_TIMEOUT_S):
                self._hear(received)

    def tell(self) -> bool:
        """Say in the log who has come and gone since this was last called, and whether any came."""
        seen = self._seen.get_all()
        for role, node_id, is_alive in seen:
            _log.info("a node comes" if is_alive else "a node goes", role=role, node_id=node_id)
        return any(is_alive for _, _, is_alive in seen)

    def _note(self, key: str, is_alive: bool) -> None:
        incident, role, node_id = key.split("/")[2:5]
        if (role, node_id) != ("post", self._post_id):
            self._seen.put((role, node_id, is_alive))
        for node_role, topic in _ASKED.items():
            if role != node_role:
                continue
            if is_alive:
                self._alive.add((node_role, node_id))
                self._joined.put(Key(incident, node_role, node_id, topic))
            else:
                self._alive.discard((node_role, node_id))
