"""The record: everything received and everything made of it, as it was on the wire.

What was put into it more than a second ago survives a kill and a power cut. ``command_post.replay``
handles it again.
"""

from __future__ import annotations

import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Protocol, Self

import structlog

from command_post.recording_file import RecordingFile
from shared.units import NS_PER_S

QUEUE_MESSAGES = 100_000
QUEUE_BYTES = 1 << 26
SYNC_PERIOD_NS = 1_000_000_000
"""The most that a kill or a power cut may take."""

_log = structlog.get_logger(__name__)


class Outgoing(Protocol):
    """What an incident has to say."""

    @property
    def key(self) -> str:
        """The key it goes out under."""

    @property
    def payload(self) -> bytes:
        """Its bytes."""


class Incident(Protocol):
    """What handles messages and makes others of them, by nothing but the calls it gets."""

    def handle(self, key: str, payload: bytes, now_ns: int) -> Sequence[Outgoing]:
        """Take one message in; return what has become due."""

    def finish(self, now_ns: int) -> Sequence[Outgoing]:
        """Return what is still held back."""


class Record(Protocol):
    """What messages are put into: a ``Recorder``, or a ``RecordingFile`` itself."""

    def put(self, key: str, payload: bytes, log_time_ns: int, *, outgoing: bool = False) -> None:
        """Add a message that was received at ``log_time_ns``, or made then (``outgoing``)."""

    def mark_end(self, now_ns: int) -> None:
        """Say that the incident was finished at ``now_ns``: no more is received."""


class RecordedIncident:
    """An incident whose every message is recorded so that a replay makes the same of it.

    For that, what is received is recorded in the order in which it is handled and with the very
    ``now_ns`` it is handled with, before anyone looks into it; what comes of it follows at once.
    So one thread calls this, with one reading of the clock for each message, and publishes what
    is returned. Anything else that the program itself says (the start of an exercise) reaches
    the incident, if at all, through ``handle``.
    """

    def __init__(self, incident: Incident, record: Record) -> None:
        self._incident = incident
        self._record = record

    def handle(self, key: str, payload: bytes, now_ns: int) -> Sequence[Outgoing]:
        """Record a message received at ``now_ns`` and handle it; record and return the outcome."""
        self._record.put(key, payload, now_ns)
        return self._recorded(self._incident.handle(key, payload, now_ns), now_ns)

    def finish(self, now_ns: int) -> Sequence[Outgoing]:
        """Record that the incident ends, finish it, and record and return what it still says."""
        self._record.mark_end(now_ns)
        return self._recorded(self._incident.finish(now_ns), now_ns)

    def _recorded(self, made: Sequence[Outgoing], now_ns: int) -> Sequence[Outgoing]:
        for outgoing in made:
            self._record.put(outgoing.key, outgoing.payload, now_ns, outgoing=True)
        return made


class RecorderStatus(NamedTuple):
    """How the recorder fares. ``fault``: why nothing is recorded any more, if so."""

    queued: int
    written: int
    dropped: int
    fault: str | None


class Recorder:
    """Records on a thread of its own, so that whoever hears messages never waits for the disk.

    Between the two stands a bounded queue; what finds no room is dropped, counted and logged, and
    the recording says so as well. When the disk fails, the file so far is kept, unfinished, the
    rest counts as dropped, and the program goes on.
    """

    def __init__(
        self,
        path: Path,
        metadata: Mapping[str, str],
        *,
        replace: bool = False,
        queue_messages: int = QUEUE_MESSAGES,
        queue_bytes: int = QUEUE_BYTES,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """Begin the recording. Raises ``RecorderError`` as ``RecordingFile`` does."""
        self._file = RecordingFile(path, metadata, replace=replace)
        self._queue_messages = queue_messages
        self._queue_bytes = queue_bytes
        self._monotonic_ns = monotonic_ns
        self._changed = threading.Condition()
        self._queue: deque[_Item | _End] = deque()
        self._queued_bytes = 0
        self._written = 0
        self._dropped = 0
        self._dropped_told = 0
        self._fault: str | None = None
        self._unsynced = False
        self._synced_ns = monotonic_ns()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def put(self, key: str, payload: bytes, log_time_ns: int, *, outgoing: bool = False) -> None:
        """Have a message recorded, received at ``log_time_ns`` or made then (``outgoing``).

        Never waits for the disk. Any thread may call it; the order of calls is kept.
        """
        with self._changed:
            full = len(self._queue) >= self._queue_messages
            too_much = self._queued_bytes + len(payload) > self._queue_bytes
            if full or too_much or self._fault or self._closing:
                self._dropped += 1
                return
            self._queue.append(_Item(key, payload, log_time_ns, outgoing))
            self._queued_bytes += len(payload)
            self._changed.notify()

    def mark_end(self, now_ns: int) -> None:
        """Say that the incident was finished at ``now_ns``: no more is received."""
        with self._changed:
            if not (self._fault or self._closing):
                self._queue.append(_End(now_ns))
                self._changed.notify()

    def status(self) -> RecorderStatus:
        """Return how it fares now."""
        with self._changed:
            return RecorderStatus(len(self._queue), self._written, self._dropped, self._fault)

    def close(self) -> RecorderStatus:
        """Write what is queued, finish the file, and return how it went. Twice is harmless."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join()
        return self.status()

    def __enter__(self) -> Self:
        """Return the recorder, at work."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close."""
        self.close()

    def _run(self) -> None:
        try:
            while self._step():
                self._sync_if_due()
            self._tell_dropped()
            self._file.finish()
        except Exception as error:
            # Whatever ends this thread must be known outside, and must not end the program.
            self._give_up(error)

    def _step(self) -> bool:
        """Wait for a message until the next sync is due, and write it; ``False`` at the end."""
        with self._changed:
            if not self._queue and not self._closing:
                self._changed.wait(self._seconds_until_sync() if self._unsynced else None)
            item = self._queue.popleft() if self._queue else None
            self._queued_bytes -= len(item.payload) if isinstance(item, _Item) else 0
            going_on = item is not None or not self._closing
        if item is not None:
            self._write(item)
        return going_on

    def _write(self, item: _Item | _End) -> None:
        try:
            item.write_to(self._file)
        except (struct.error, OverflowError) as error:
            # A time beyond what the format can hold: that message is lost, not the recording.
            with self._changed:
                self._dropped += 1
            _log.error("a message cannot be recorded", why=str(error))
            return
        self._unsynced = True
        self._written += isinstance(item, _Item)

    def _seconds_until_sync(self) -> float:
        return max(0, self._synced_ns + SYNC_PERIOD_NS - self._monotonic_ns()) / NS_PER_S

    def _sync_if_due(self) -> None:
        if self._unsynced and self._seconds_until_sync() == 0.0:
            self._tell_dropped()
            self._file.sync()
            self._unsynced = False
            self._synced_ns = self._monotonic_ns()

    def _tell_dropped(self) -> None:
        dropped = self.status().dropped
        if dropped > self._dropped_told:
            _log.warning("the recorder is behind and has dropped messages", dropped=dropped)
            self._file.mark_dropped(dropped)
            self._dropped_told = dropped

    def _give_up(self, error: Exception) -> None:
        self._file.abandon()
        with self._changed:
            self._fault = f"{self._file.path}: recording has stopped: {error}"
            self._dropped += len(self._queue)
            self._queue.clear()
        _log.error(self._fault, kept_until_then=self._written)


class _Item(NamedTuple):
    key: str
    payload: bytes
    log_time_ns: int
    outgoing: bool

    def write_to(self, file: RecordingFile) -> None:
        file.put(self.key, self.payload, self.log_time_ns, outgoing=self.outgoing)


class _End(NamedTuple):
    now_ns: int

    def write_to(self, file: RecordingFile) -> None:
        file.mark_end(self.now_ns)
