"""What the post says: sealed, published, and known again when the bus hands it back."""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable, Sequence
from functools import partial
from hashlib import blake2b

from command_post.recorder.recorded import Outgoing
from shared.bus.interface import Bus, Received
from shared.messages import OrderAnswer
from shared.sender import Outbox
from shared.topics import TOPICS, Topic

MOST_ON_THE_WAY = 20_000
DIGEST_BYTES = 16


class Voice:
    """Publishes what has been made of an incident. Without ``outbox`` nothing is sealed.

    What is promised is said once it is kept: the answer to who ordered something, when a power cut
    would not take the order. The order itself waits for nothing.
    """

    def __init__(
        self, bus: Bus, outbox: Outbox | None, when_safe: Callable[[Callable[[int], None]], bool]
    ) -> None:
        """``when_safe``: has something called once what was made until then is kept."""
        self._bus = bus
        self._outbox = outbox
        self._when_safe = when_safe
        self._kept: deque[Outgoing] = deque()
        """Promises that can be given now."""

        self._said: OrderedDict[bytes, None] = OrderedDict()
        """Digests of what was published last: the bus hands a node's own messages back to it."""

    def is_own(self, received: Received) -> bool:
        """Whether this is what was said of late, in these very bytes."""
        return _digest(received) in self._said

    def say(self, outgoing: Sequence[Outgoing]) -> list[Received]:
        """Publish all of it but what waits, and what has waited and is kept by now.

        Returns that as it went out. To be called now and then, with nothing to say as well.
        """
        promised = [self._kept.popleft() for _ in range(len(self._kept))]
        said = [self._sealed_and_said(_topic_of(message), message) for message in promised]
        for message in outgoing:
            topic = _topic_of(message)
            if topic.message is OrderAnswer:
                self._when_safe(partial(self._may_be_promised, message))
            else:
                said.append(self._sealed_and_said(topic, message))
        return said

    def _may_be_promised(self, message: Outgoing, _: int) -> None:
        """Note it, on another thread."""
        self._kept.append(message)

    def _sealed_and_said(self, topic: Topic, message: Outgoing) -> Received:
        key, payload = message.key, message.payload
        sealed = payload if self._outbox is None else self._outbox.seal(topic, key, payload)
        said = Received(key, sealed)
        digest = _digest(said)
        self._said[digest] = None
        self._said.move_to_end(digest)
        if len(self._said) > MOST_ON_THE_WAY:
            self._said.popitem(last=False)
        self._bus.publish(said.key, said.payload, topic.priority)
        return said


def _digest(said: Received) -> bytes:
    """Return what tells a message from any other: a tenth of it, to be remembered."""
    return blake2b(said.payload, key=said.key.encode()[-64:], digest_size=DIGEST_BYTES).digest()


def _topic_of(message: Outgoing) -> Topic:
    return TOPICS[message.key.rpartition("/")[2]]
