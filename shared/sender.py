"""How a node speaks: its messages, numbered under each of its keys."""

from __future__ import annotations

from collections import Counter

from shared.bus.interface import Bus
from shared.codec import encode
from shared.messages import Message, NodeId
from shared.topics import TOPICS, Key, Role

_TOPIC_OF = {topic.message: topic for topic in TOPICS.values()}


class Sender:
    """Publishes the messages of one node, each under the key of its topic."""

    def __init__(self, bus: Bus, incident: NodeId, role: Role, node_id: NodeId) -> None:
        self._bus = bus
        self._incident = incident
        self._role: Role = role
        self.node_id = node_id
        """Whose messages they are."""

        self._next: Counter[type[Message]] = Counter()

    def key(self, message: type[Message]) -> str:
        """Return the key that this node writes messages of that type under."""
        return str(Key(self._incident, self._role, self.node_id, _TOPIC_OF[message].name))

    def next_sequence(self, message: type[Message]) -> int:
        """Return the number for the next message of that type: 0, 1, 2 … in this process."""
        number = self._next[message]
        self._next[message] += 1
        return number

    def send(self, message: Message) -> bytes:
        """Publish ``message`` and return the bytes that went out."""
        payload = encode(message)
        kind = type(message)
        self._bus.publish(self.key(kind), payload, _TOPIC_OF[kind].priority)
        return payload
