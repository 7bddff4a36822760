"""Where a handler leaves what it was given, for the program's own thread to take out."""

from __future__ import annotations

import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class Inbox(Generic[T]):
    """A bounded queue between threads, whose ``put`` is a fit handler: it never blocks.

    When it is full the oldest message makes room: whoever has fallen behind should see what is
    going on now, and a gap shows in the sequence numbers either way.
    """

    def __init__(self, max_messages: int) -> None:
        if max_messages < 1:
            raise ValueError(f"max_messages {max_messages}: must be at least 1")
        self._messages: deque[T] = deque(maxlen=max_messages)
        self._max_messages = max_messages
        self._filled = threading.Condition()
        self._dropped = 0

    def __len__(self) -> int:
        return len(self._messages)

    @property
    def dropped(self) -> int:
        """How many messages were lost because nobody took them out in time."""
        return self._dropped

    def put(self, message: T) -> None:
        """Add ``message``, dropping the oldest one if the inbox is full."""
        with self._filled:
            if len(self._messages) == self._max_messages:
                self._dropped += 1
            self._messages.append(message)
            self._filled.notify()

    def get(self, timeout_s: float) -> T | None:
        """Take out the oldest message; ``None`` if there is none within ``timeout_s``."""
        with self._filled:
            self._filled.wait_for(lambda: self._messages, timeout_s)
            return self._messages.popleft() if self._messages else None

    def get_all(self, timeout_s: float = 0.0) -> list[T]:
        """Take out all messages, oldest first, having waited ``timeout_s`` at most for one."""
        with self._filled:
            self._filled.wait_for(lambda: self._messages, timeout_s)
            messages = list(self._messages)
            self._messages.clear()
            return messages
