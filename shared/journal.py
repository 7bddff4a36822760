"""A node's journal: what it has said, on its disk until it is safe elsewhere.

An SQLite file holds one run of numbers over all journalled messages of a node, each as the bytes
that were published, written and synchronized before they were. The run is random and made with the
file: a unit whose disk was wiped begins another, and takes nobody's numbers.
"""

from __future__ import annotations

import sqlite3
import threading
import time
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TypeAlias

import structlog

from shared.files import file_held_alone
from shared.journal_file import (
    ForeignFileError,
    NotWholeError,
    Place,
    about_of,
    connected,
    is_damage,
    is_full,
    moved_aside,
    prepare,
    write_anew,
)
from shared.kept import Holding, Row, SealAs, within_bytes
from shared.messages import MOST_LOST
from shared.units import NS_PER_S

__all__ = [
    "KEPT_NS", "ForeignFileError", "Journal", "JournalDamagedError", "JournalError",
]  # fmt: skip

KEPT_NS = 24 * 3600 * NS_PER_S
"""What is safe elsewhere is kept so long all the same, for others who may want it."""

DROPPED_AT_ONCE = 100
"""Acknowledged messages that make room at a time, on a full disk."""

RESERVE_BYTES = 1 << 18
"""Room that is given back on a full disk: without any, nothing can be removed either."""

_Written: TypeAlias = tuple[int, int, str, bytes, int]

_log = structlog.stdlib.get_logger(__name__)


class JournalError(RuntimeError):
    """A journal cannot be written or read at present. The text says which, and why."""


class JournalDamagedError(JournalError):
    """A journal turns out to be damaged: opened again, it is moved aside."""


class Journal:
    """The journal in the file at ``path``, held by this process alone until it is closed.

    Any thread may call it: one is served at a time to write, another one to read.
    """

    run: bytes
    """Names the run, in ``RUN_BYTES``."""

    broken_off: bool
    """Whether the last process that had the journal was killed, or lost power."""

    _holding: Holding

    def __init__(self, path: Path, now_ns: Callable[[], int] = time.time_ns) -> None:
        """Open the journal, or begin it.

        What is no journal any more is moved aside, kept and named in the log. Raises
        ``shared.files.FileHeldError`` if another process has it, ``ForeignFileError`` for another
        program's database, ``JournalError`` where nothing can be written.
        """
        self.path = path
        self._now_ns = now_ns
        self._lost: tuple[int, ...] = ()
        """Messages that are not as they were written, of those that somebody asked for."""

        self._writing = threading.Lock()
        self._reading = threading.Lock()
        self._open = ExitStack()
        try:
            with _as_journal_error(path):
                self._begin()
        except BaseException:
            self._open.close()
            raise

    def append(self, key: str, seal_as: SealAs) -> bytes:
        """Write the next message and return it sealed: it is on the disk.

        On a full disk the oldest acknowledged messages make room. A file that was removed meanwhile
        is written anew, with all that was in it: this process still has it. Raises ``JournalError``
        if that is not enough, and where the disk fails: the number is then given to the next
        message.
        """
        with self._writing, _as_journal_error(self.path):
            self._put_back_if_removed()
            number = self._holding.last_number + 1
            payload = seal_as(self.run, number)
            row = (number, self._now_ns(), key, payload, _checksum(key, payload))
            try:
                self._insert(row)
            except sqlite3.OperationalError as error:
                if not is_full(error):
                    raise
                self._insert_in_room_made(row)
            self._holding = self._holding._replace(last_number=number)
        return payload

    def rows(self, first: int, last: int, most_rows: int, most_bytes: int) -> list[Row]:
        """Return messages from number ``first`` to ``last``, in order, as many as may be.

        The first one is returned however long it is; none that the disk has altered: such are
        noted as lost. Raises ``JournalError``.
        """
        query = (
            "SELECT number, key, payload, checksum FROM message WHERE number BETWEEN ? AND ? "
            "ORDER BY number LIMIT ?"
        )
        with self._reading, _as_journal_error(self.path):
            written = min(last, self._holding.last_number)
            found = self._reader.execute(query, (first, last, most_rows)).fetchall()
            rows = list(_unaltered(found))
            read_to = found[-1][0] if len(found) == most_rows else written
            self._miss(range(first, read_to + 1), {row.number for row in rows})
        return list(within_bytes(rows, most_bytes))

    def _miss(self, seen: range, whole: Collection[int]) -> None:
        """Note what is not ``whole`` of the numbers ``seen``, as far as it is safe nowhere else."""
        holding = self._holding
        begin = max(seen.start, holding.kept_from, holding.acknowledged + 1)
        needed = range(begin, seen.stop)
        news = {number for number in needed if number not in whole}.difference(self._lost)
        if news:
            self._lost = (*self._lost, *sorted(news))
            _log.error(
                "messages of the journal are not on the disk as they were written: they are lost",
                journal=str(self.path), numbers=sorted(news)[:MOST_LOST],
            )  # fmt: skip

    def newest(self, key: str) -> bytes | None:
        """Return what was said last under ``key``, if it is still there. As ``rows``."""
        query = (
            "SELECT number, key, payload, checksum FROM message WHERE key = ? "
            "ORDER BY number DESC LIMIT 1"
        )
        with self._reading, _as_journal_error(self.path):
            row = next(_unaltered(self._reader.execute(query, (key,))), None)
        return None if row is None else row.payload

    def acknowledge(self, number: int) -> None:
        """Note that all up to ``number`` are safe elsewhere. Raises ``JournalError``."""
        with self._writing, _as_journal_error(self.path):
            if self._holding.acknowledged < number <= self._holding.last_number:
                self._writer.execute("UPDATE about SET acknowledged = ?", (number,))
                self._holding = self._holding._replace(acknowledged=number)

    def trim(self) -> None:
        """Remove what has been safe elsewhere for long. Raises ``JournalError``."""
        with self._writing, _as_journal_error(self.path):
            self._writer.execute(
                "DELETE FROM message WHERE number <= ? AND written_ns < ?",
                (self._disposable, self._now_ns() - KEPT_NS),
            )
            self._note_first()
            self._keep_reserve()

    def holding(self) -> Holding:
        """Say what is held, without waiting for what is being written."""
        holding = self._holding
        needed = sorted(number for number in self._lost if number > holding.acknowledged)
        return holding._replace(lost=tuple(needed[:MOST_LOST]))

    def close(self) -> None:
        """Close the file and let go of it. Closing twice is harmless."""
        with self._writing, self._reading:
            with suppress(sqlite3.Error):
                self._writer.execute("UPDATE about SET in_use = 0")
            self._open.close()

    @property
    def _disposable(self) -> int:
        """Up to which number messages may go: the last one stays, for it keeps the count."""
        return min(self._holding.acknowledged, self._holding.last_number - 1)

    @property
    def _reserve(self) -> Path:
        return self.path.with_name(f".{self.path.name}.reserve")

    def _begin(self) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._open.enter_context(file_held_alone(self.path))
        try:
            self._connect()
        except (sqlite3.DatabaseError, NotWholeError) as error:
            if not is_damage(error):
                raise
            kept = moved_aside(self.path)
            _log.error("the journal is damaged: another is begun", kept=str(kept), why=str(error))
            self._connect()
        if self.broken_off:
            _log.warning(
                "the journal was not closed: at most the message is missing that was being written",
                journal=str(self.path), last_number=self._holding.last_number,
            )  # fmt: skip
        with suppress(sqlite3.OperationalError, OSError):
            self._keep_reserve()

    def _connect(self) -> None:
        with ExitStack() as opened:
            self._writer = opened.enter_context(connected(self.path))
            self._reader = opened.enter_context(connected(self.path))
            prepare(self._writer, self.path)
            self.run, acknowledged, self.broken_off = about_of(self._writer)
            self._writer.execute("UPDATE about SET in_use = 1")
            newest = self._writer.execute("SELECT max(number) FROM message").fetchone()[0]
            self._holding = Holding(self.run, newest or 0, 1, acknowledged)
            self._note_first()
            # It opens its log with its first question, and must not when that has been removed.
            self._reader.execute("SELECT run FROM about").fetchone()
            self._place = Place(self.path)
            self._connections = self._open.enter_context(opened.pop_all())

    def _put_back_if_removed(self) -> None:
        if not self._place.is_left():
            return
        _log.error(
            "the journal was removed while in use: it is written anew", journal=str(self.path)
        )
        with self._reading:
            write_anew(self.path, self._writer)
            self._connections.close()
            broken_off = self.broken_off
            self._connect()
            self.broken_off = broken_off

    def _note_first(self) -> None:
        first = self._writer.execute("SELECT min(number) FROM message").fetchone()[0]
        self._holding = self._holding._replace(kept_from=first or self._holding.last_number + 1)

    def _insert(self, row: _Written) -> None:
        self._writer.execute("INSERT INTO message VALUES (?, ?, ?, ?, ?)", row)

    def _insert_in_room_made(self, row: _Written) -> None:
        """Drop acknowledged messages until ``row`` finds room; else raise what SQLite raises."""
        self._reserve.unlink(missing_ok=True)
        self._checkpoint()
        while True:
            dropped = self._writer.execute(
                "DELETE FROM message WHERE number IN "
                "(SELECT number FROM message WHERE number <= ? ORDER BY number LIMIT ?)",
                (self._disposable, DROPPED_AT_ONCE),
            ).rowcount
            self._note_first()
            try:
                self._insert(row)
            except sqlite3.OperationalError as error:
                if not (is_full(error) and dropped):
                    raise
            else:
                break
        _log.warning(
            "the disk is full: old acknowledged messages have made room",
            journal=str(self.path), kept_from=self._holding.kept_from,
        )  # fmt: skip

    def _checkpoint(self) -> None:
        """Have the log of changes begin anew in the room it has."""
        with suppress(sqlite3.OperationalError):
            self._writer.execute("PRAGMA wal_checkpoint(RESTART)")

    def _keep_reserve(self) -> None:
        if not self._reserve.exists():
            try:
                self._reserve.write_bytes(bytes(RESERVE_BYTES))
            except OSError:
                # A full disk: what little there is must not go to the reserve.
                self._reserve.unlink(missing_ok=True)


def _checksum(key: str, payload: bytes) -> int:
    return zlib.crc32(payload, zlib.crc32(key.encode()))


def _unaltered(found: Iterable[tuple[int, str, bytes, int]]) -> Iterator[Row]:
    """Yield the rows whose checksum is right."""
    for number, key, payload, checksum in found:
        if _checksum(key, payload) == checksum:
            yield Row(number, key, payload)


@contextmanager
def _as_journal_error(path: Path) -> Iterator[None]:
    """Say of which journal it is what SQLite or the system complains of."""
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        kind = JournalDamagedError if is_damage(error) else JournalError
        raise kind(f"{path}: {error}") from error
