"""How a node speaks: its messages, numbered under each of its keys, and sealed."""

from __future__ import annotations

import secrets
from collections import Counter
from collections.abc import Callable
from typing import Protocol

from shared.bus.interface import Bus
from shared.codec import encode
from shared.messages import Message, NodeId
from shared.seal import RUN_BYTES, sealed, signed
from shared.topics import TOPIC_OF, Key, Role, Topic

Sign = Callable[[bytes], bytes]
"""Makes the signature of a node under what it says."""


class Outbox(Protocol):
    """Where a message goes before it is published."""

    def seal(self, topic: Topic, key: str, payload: bytes) -> bytes:
        """Return ``payload`` sealed; what is journalled is on disk by then."""


class Unkept:
    """An ``Outbox`` that numbers and signs, and keeps nothing.

    ``run`` is to be random, and another in each process. Without ``sign`` nothing is signed.
    """

    def __init__(self, sign: Sign | None = None, run: bytes | None = None) -> None:
        self._sign = sign
        self._run = secrets.token_bytes(RUN_BYTES) if run is None else run
        self._number = 0

    def seal(self, topic: Topic, key: str, payload: bytes) -> bytes:  # noqa: ARG002
        """Return ``payload`` with the run's next number."""
        self._number += 1
        whole = sealed(payload, self._run, self._number)
        return whole if self._sign is None else signed(whole, key, self._sign)


class Sender:
    """Publishes the messages of one node, each under the key of its topic."""

    def __init__(
        self,
        bus: Bus,
        incident: NodeId,
        role: Role,
        node_id: NodeId,
        outbox: Outbox | None = None,
    ) -> None:
        """Without ``outbox``, as in a rehearsal, nothing is sealed."""
        self._bus = bus
        self._incident = incident
        self._role: Role = role
        self._outbox = outbox
        self.node_id = node_id
        """Whose messages they are."""

        self._next: Counter[type[Message]] = Counter()

    def key(
        self, message: type[Message], node_id: NodeId | None = None, role: Role | None = None
    ) -> str:
        """Return the key that this node writes such messages under, or another of its incident.

        It has the same role, if no other is given.
        """
        topic = TOPIC_OF[message].name
        return str(Key(self._incident, role or self._role, node_id or self.node_id, topic))

    def next_sequence(self, message: type[Message]) -> int:
        """Return the number for the next message of that type: 0, 1, 2 … in this process."""
        number = self._next[message]
        self._next[message] += 1
        return number

    def send(self, message: Message) -> bytes:
        """Publish ``message`` and return the bytes that went out."""
        topic = TOPIC_OF[type(message)]
        key = self.key(type(message))
        payload = encode(message)
        if self._outbox is not None:
            payload = self._outbox.seal(topic, key, payload)
        self._bus.publish(key, payload, topic.priority)
        return payload
