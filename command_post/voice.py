"""What the post says: sealed, published, and known again when the bus hands it back."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence

from command_post.recording import Outgoing
from shared.bus.interface import Bus, Received
from shared.messages import Order
from shared.sender import Outbox
from shared.topics import TOPICS, Topic

MOST_ON_THE_WAY = 20_000


class Voice:
    """Publishes what has been made of an incident. Without ``outbox`` nothing is sealed."""

    def __init__(self, bus: Bus, outbox: Outbox | None) -> None:
        self._bus = bus
        self._outbox = outbox
        self._said: OrderedDict[Received, None] = OrderedDict()
        """What was published last: the bus hands a node's own messages back to it."""

        self._sealed_orders: dict[bytes, bytes] = {}
        """Orders as they were said first, by what was sealed."""

    def is_own(self, received: Received) -> bool:
        """Whether this is what was said of late, in these very bytes."""
        return received in self._said

    def say(self, outgoing: Sequence[Outgoing]) -> list[Received]:
        """Publish all of it, and return it as it went out."""
        return [self._sealed_and_said(message.key, message.payload) for message in outgoing]

    def say_again(self, order: Outgoing) -> None:
        """Publish an order in the bytes it went out in; after a restart it is sealed anew."""
        sealed = self._sealed_orders.get(order.payload)
        if sealed is None:
            self._sealed_and_said(order.key, order.payload)
        else:
            self._publish(Received(order.key, sealed), TOPICS["order"])

    def _sealed_and_said(self, key: str, payload: bytes) -> Received:
        topic = TOPICS[key.rpartition("/")[2]]
        sealed = payload if self._outbox is None else self._outbox.seal(topic, key, payload)
        if topic.message is Order:
            self._sealed_orders[payload] = sealed
        said = Received(key, sealed)
        self._publish(said, topic)
        return said

    def _publish(self, said: Received, topic: Topic) -> None:
        self._said[said] = None
        self._said.move_to_end(said)
        if len(self._said) > MOST_ON_THE_WAY:
            self._said.popitem(last=False)
        self._bus.publish(said.key, said.payload, topic.priority)
