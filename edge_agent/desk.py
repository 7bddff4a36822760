"""What posts say under one topic, attended to on a thread of its own."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Self

from shared.bus.inbox import Inbox
from shared.bus.interface import Bus, Received
from shared.codec import Refusal, decode, parse_key
from shared.gate import Gate
from shared.messages import Message, NodeId
from shared.topics import Key

POLL_S = 0.1
MOST_WAITING = 1024
"""Messages that wait to be read; a post says again what was lost."""


class Desk(ABC):
    """Hears ``topic`` of an incident's posts from the start; attends while it is entered."""

    def __init__(self, bus: Bus, incident: NodeId, topic: str, gate: Gate) -> None:
        self._gate = gate
        self._inbox: Inbox[Received] = Inbox(MOST_WAITING)
        self._stop = threading.Event()
        # No daemon: it is inside Zenoh when it says something.
        self._thread = threading.Thread(target=self._run, name=f"{topic} desk", daemon=False)
        bus.subscribe(str(Key(incident, "post", "*", topic)), self._inbox.put)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

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
