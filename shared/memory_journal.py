"""A journal in memory, for as long as the disk takes none: the newest of what was said."""

from __future__ import annotations

import secrets
import threading
from collections import deque
from itertools import islice

from shared.kept import Holding, Row, SealAs, within_bytes
from shared.seal import RUN_BYTES

MOST_MESSAGES = 10_000
MOST_BYTES = 1 << 23


class MemoryJournal:
    """Keeps messages as ``shared.kept.Keeps`` says, as long as the process lives.

    When it is full, the oldest go, acknowledged or not: ``lost`` counts those that were not.
    """

    def __init__(self, most_messages: int = MOST_MESSAGES, most_bytes: int = MOST_BYTES) -> None:
        self.run = secrets.token_bytes(RUN_BYTES)
        """Names the run."""

        self.lost = 0
        self._most_messages = most_messages
        self._most_bytes = most_bytes
        self._lock = threading.Lock()
        self._rows: deque[Row] = deque()
        self._bytes = 0
        self._last_number = 0
        self._acknowledged = 0

    def append(self, key: str, seal_as: SealAs) -> bytes:
        """Keep the next message, and return it sealed."""
        with self._lock:
            payload = seal_as(self.run, self._last_number + 1)
            self._last_number += 1
            self._rows.append(Row(self._last_number, key, payload))
            self._bytes += len(payload)
            while len(self._rows) > self._most_messages or self._bytes > self._most_bytes:
                self._drop_first()
            return payload

    def rows(self, first: int, last: int, most_rows: int, most_bytes: int) -> list[Row]:
        """Return messages from number ``first`` to ``last``, in order, as many as may be."""
        with self._lock:
            asked = (row for row in self._rows if first <= row.number <= last)
            return list(within_bytes(islice(asked, most_rows), most_bytes))

    def acknowledge(self, number: int) -> None:
        """Note that all up to ``number`` are safe elsewhere: they need no memory any more."""
        with self._lock:
            if number <= self._last_number:
                self._acknowledged = max(self._acknowledged, number)
            while self._rows and self._rows[0].number <= self._acknowledged:
                self._drop_first()

    def holding(self) -> Holding:
        """Say what is held."""
        with self._lock:
            first = self._rows[0].number if self._rows else self._last_number + 1
            return Holding(self.run, self._last_number, first, self._acknowledged)

    def _drop_first(self) -> None:
        row = self._rows.popleft()
        self._bytes -= len(row.payload)
        self.lost += row.number > self._acknowledged
