"""Where what a node says goes before it is published: into its journal, if it is to be kept."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, Self, TypeVar

import structlog

from shared.files import FileHeldError
from shared.journal import ForeignFileError, Journal, JournalDamagedError, JournalError
from shared.kept import Holding, Keeps, Row, SealAs
from shared.memory_journal import MemoryJournal
from shared.seal import sealed, signed
from shared.sender import Sign, Unkept
from shared.topics import Topic

PATIENCE_S = 2.0
"""How long a message waits to be written before it is said all the same."""

TRY_AGAIN_S = 5.0
"""How long a disk that failed is left alone."""

TRIM_PERIOD_S = 60.0

R = TypeVar("R")

_log = structlog.stdlib.get_logger(__name__)


class JournalledOutbox:
    """An ``Outbox`` that has on disk what is journalled before anybody hears of it.

    While the disk takes nothing, what is journalled is kept in memory instead, under a run of its
    own: it is said, and can be asked for as long as the process lives. ``unwritten`` counts it,
    ``fault`` says why. Any thread may call it.
    """

    def __init__(
        self,
        path: Path,
        sign: Sign | None = None,
        *,
        now_ns: Callable[[], int] = time.time_ns,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        """Open the journal at ``path``, or begin it; go on without where the disk fails.

        Raises ``shared.files.FileHeldError`` if another process has it, and
        ``shared.journal.ForeignFileError`` for another program's database.
        """
        self._path = path
        self._sign = sign
        self._now_ns = now_ns
        self._monotonic = monotonic
        self._lock = threading.Lock()
        self._unkept = Unkept(sign)
        self._in_memory = MemoryJournal()
        self._journal: Journal | None = None
        self._try_again_s = monotonic()
        self._trim_s = monotonic()
        self.unwritten = 0
        self.fault: str | None = None
        # A thread of its own: an alarm must not wait for a disk that has stopped answering.
        self._writer = ThreadPoolExecutor(1, thread_name_prefix="journal")
        self._written: Future[Any] | None = None
        try:
            self._journal = Journal(path, now_ns)
        except JournalError as error:
            self._do_without(str(error))
        self.broken_off = self._journal is not None and self._journal.broken_off
        """Whether the last process that had the journal was killed, or lost power."""

    def seal(self, topic: Topic, key: str, payload: bytes) -> bytes:
        """Return ``payload`` sealed; what is journalled is on disk by then, if that is possible."""
        with self._lock:
            if not topic.journalled:
                return self._unkept.seal(topic, key, payload)
            whole = self._write(lambda journal: journal.append(key, self._sealing(key, payload)))
            if whole is None:
                self.unwritten += 1
                whole = self._in_memory.append(key, self._sealing(key, payload))
            return whole

    def newest(self, key: str) -> bytes | None:
        """Return what was said last under ``key`` and is on disk, by this process or another."""
        journal = self._journal
        try:
            return None if journal is None else journal.newest(key)
        except JournalError as error:
            _log.error("the journal cannot be read", why=str(error))
            return None

    def rows(self, run: bytes, first: int, last: int, most_rows: int, most_bytes: int) -> list[Row]:
        """Return what is held of ``run``, as ``shared.kept.Keeps.rows``; none on a fault."""
        try:
            for each in self._kept():
                if each.run == run:
                    return each.rows(first, last, most_rows, most_bytes)
        except JournalError as error:
            _log.error("the journal cannot be read", why=str(error))
        return []

    def holdings(self) -> list[Holding]:
        """Say what is held on disk, and in memory as long as that may be missed."""
        on_disk = [] if self._journal is None else [self._journal.holding()]
        in_memory = self._in_memory.holding()
        may_be_missed = in_memory.acknowledged < in_memory.last_number
        return [*on_disk, in_memory] if may_be_missed else on_disk

    def acknowledge(self, run: bytes, number: int) -> None:
        """Note that all of ``run`` up to ``number`` are safe elsewhere."""
        with self._lock:
            if run == self._in_memory.run:
                self._in_memory.acknowledge(number)
            elif self._journal is not None and self._journal.run == run:
                self._write(lambda journal: journal.acknowledge(number))

    def tend(self) -> None:
        """Do what is due now and then: try a disk that failed, remove what is needed no more."""
        with self._lock:
            if self._monotonic() >= self._trim_s:
                self._trim_s = self._monotonic() + TRIM_PERIOD_S
                self._write(Journal.trim)

    def close(self) -> None:
        """Close the journal. Closing twice is harmless."""
        with self._lock:
            self._writer.shutdown()
            if self._journal is not None:
                self._journal.close()
        if self._in_memory.lost or self.fault is not None:
            _log.error(
                "not all is in the journal", unwritten=self.unwritten,
                lost=self._in_memory.lost, why=self.fault,
            )  # fmt: skip

    def __enter__(self) -> Self:
        """Return the outbox."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def _write(self, act: Callable[[Journal], R]) -> R | None:
        """Return what ``act`` makes of the journal, opened anew if need be; ``None`` on a fault."""
        stuck = self._written is not None and not self._written.done()
        if stuck or self._monotonic() < self._try_again_s:
            return None
        self._written = written = self._writer.submit(self._act, act)
        try:
            done = written.result(PATIENCE_S)
        except TimeoutError:
            self._do_without(f"{self._path}: the disk does not answer")
        except (JournalError, FileHeldError, ForeignFileError) as error:
            self._do_without(str(error))
        else:
            if self.fault is not None:
                self.fault = None
                _log.warning("the journal is written again", unwritten=self.unwritten)
            return done
        return None

    def _act(self, act: Callable[[Journal], R]) -> R:
        if self._journal is None:
            self._journal = Journal(self._path, self._now_ns)
        try:
            return act(self._journal)
        except JournalDamagedError:
            damaged, self._journal = self._journal, None
            damaged.close()
            raise

    def _do_without(self, why: str) -> None:
        self._try_again_s = self._monotonic() + TRY_AGAIN_S
        if self.fault is None:
            _log.error("nothing goes into the journal: what is said is in memory only", why=why)
        self.fault = why

    def _kept(self) -> list[Keeps]:
        journal = self._journal
        return [self._in_memory] if journal is None else [journal, self._in_memory]

    def _sealing(self, key: str, payload: bytes) -> SealAs:
        def seal_as(run: bytes, number: int) -> bytes:
            whole = sealed(payload, run, number)
            return whole if self._sign is None else signed(whole, key, self._sign)

        return seal_as
