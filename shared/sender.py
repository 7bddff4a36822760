"""How a node speaks: its messages, numbered under each of its keys."""

from __future__ import annotations

from collections import Counter

import msgspec

from shared.bus.interface import Bus
from shared.codec import encode
from shared.messages import Message, NodeId
from shared.topics import TOPICS, Key, Role

_TOPIC_OF = {topic.message: topic for topic in TOPICS.values()}


class Sender:
    """Publishes the messages of one node, each under the key of its topic.

    Messages are built without thought of their number: ``send`` puts the next number of their key
    in, from 0 at the start of the process, and returns the bytes as they went out.
    """

    def __init__(self, bus: Bus, incident: NodeId, role: Role, node_id: NodeId) -> None:
        self._bus = bus
        self._incident = incident
        self._role: Role = role
        self._node_id = node_id
        self._sent: Counter[str] = Counter()

    def key(self, topic: str) -> str:
        """Return the key that this node writes ``topic`` under."""
        return str(Key(self._incident, self._role, self._node_id, topic))

    def send(self, message: Message) -> bytes:
        """Number ``message``, publish it under the key of its topic, return its bytes."""
        topic = _TOPIC_OF[type(message)]
        numbered = msgspec.structs.replace(message, sequence=self._sent[topic.name])
        self._sent[topic.name] += 1
        payload = encode(numbered)
        self._bus.publish(self.key(topic.name), payload, topic.priority)
        return payload
