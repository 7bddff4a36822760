"""What is kept of a run of messages, wherever it is kept (pure)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple, Protocol, TypeAlias

SealAs: TypeAlias = Callable[[bytes, int], bytes]
"""Makes of a run and a number the sealed bytes to be kept."""


class Row(NamedTuple):
    """A message as it was published, and its number in the journal's run."""

    number: int
    key: str
    payload: bytes


class Holding(NamedTuple):
    """What is held of a run: see ``shared.messages.Beat``."""

    run: bytes
    last_number: int
    kept_from: int
    acknowledged: int
    lost: tuple[int, ...] = ()


class Keeps(Protocol):
    """Keeps what is said, under a run and numbers of its own."""

    run: bytes
    """Names the run."""

    def append(self, key: str, seal_as: SealAs) -> bytes:
        """Keep the next message, and return it sealed. Raises ``JournalError``."""

    def rows(self, first: int, last: int, most_rows: int, most_bytes: int) -> list[Row]:
        """Return messages from number ``first`` to ``last``, in order, as many as may be.

        The first one is returned however long it is. Raises ``JournalError``.
        """

    def acknowledge(self, number: int) -> None:
        """Note that all up to ``number`` are safe elsewhere. Raises ``JournalError``."""

    def holding(self) -> Holding:
        """Say what is held."""


def within_bytes(rows: Iterable[Row], most_bytes: int) -> Iterator[Row]:
    """Yield the first of ``rows``, and more as long as keys and payloads fit ``most_bytes``."""
    room = most_bytes
    for index, row in enumerate(rows):
        room -= len(row.key) + len(row.payload)
        if room < 0 and index > 0:
            return
        yield row
