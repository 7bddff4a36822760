"""What posts say under one topic, attended to on a thread of its own."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator

from shared.bus.inbox import Inbox
from shared.bus.interface import Bus, Received
from shared.codec import Refusal, decode, parse_key
from shared.gate import Gate
from shared.messages import Message, NodeId
from shared.own_thread import OwnThread
from shared.topics import Key

POLL_S = 0.1
MOST_WAITING = 1024
"""Messages that wait to be read; a post says again what was lost."""


class Desk(OwnThread):
    """Hears ``topic`` of an incident's posts from the start; attends while it is entered."""

    def __init__(self, bus: Bus, incident: NodeId, topic: str, gate: Gate) -> None:
        super().__init__(f"{topic} desk")
        self._gate = gate
        self._inbox: Inbox[Received] = Inbox(MOST_WAITING)
        bus.subscribe(str(Key(incident, "post", "*", topic)), self._inbox.put)

    @abstractmethod
    def attend(self, wait_s: float = 0.0) -> None:
        """Heed what has come, within ``wait_s`` at most, and do what is due."""

    def _heard(self, wait_s: float) -> Iterator[tuple[Key, Message]]:
        """Yield what came, within ``wait_s`` at most, and is to be believed."""
        for received in self._inbox.get_all(wait_s):
            key = parse_key(received.key)
            # Said twice it may be: what is said tells itself when that was.
            if isinstance(key, Refusal) or self._gate.doubt(*received) is not None:
                continue
            message = decode(key, received.payload)
            if not isinstance(message, Refusal):
                yield key, message

    def _run(self) -> None:
        while not self._stop.is_set():
            self.attend(POLL_S)
