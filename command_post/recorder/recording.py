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
from typing import Self

import structlog

from command_post.recorder.backlog import End, Entry, Item, RecorderStatus, Resumed, WhenSafe
from command_post.recorder.mirror import Mirror
from command_post.recorder.parts import RecordingSet, Rotation
from command_post.recorder.recorded import Incident, Outgoing, Record
from shared.mcap_reader import BegunFrom
from shared.recording_parts import where_part_is
from shared.units import NS_PER_S

QUEUE_MESSAGES = 100_000
QUEUE_BYTES = 1 << 26
SYNC_PERIOD_NS = 1_000_000_000
"""The most that a kill or a power cut may take."""

RETRY_S = 2.0

_log = structlog.get_logger(__name__)


class RecordedIncident:
    """An incident whose every message is recorded so that a replay makes the same of it.

    For that, what is received is recorded in the order in which it is handled and with the very
    ``now_ns`` it is handled with, before anyone looks into it; what comes of it follows at once.
    So one thread calls this, with one reading of the clock for each message, and publishes what
    is returned. Anything else that the program itself says (the start of an exercise) reaches
    the incident, if at all, through ``handle``.
    """

    def __init__(
        self,
        incident: Incident,
        record: Record,
        lost: Callable[[str, bytes], None] = lambda _key, _payload: None,
    ) -> None:
        """``lost`` is told what was received and finds no room in the record."""
        self._incident = incident
        self._record = record
        self._lost = lost

    def handle(self, key: str, payload: bytes, now_ns: int) -> Sequence[Outgoing]:
        """Record a message received at ``now_ns`` and handle it; record and return the outcome."""
        if not self._record.put(key, payload, now_ns):
            self._lost(key, payload)
        return self._recorded(self._incident.handle(key, payload, now_ns), now_ns)

    def pass_time(self, now_ns: int) -> Sequence[Outgoing]:
        """Record and return what has become due by ``now_ns``, no earlier than of the last call.

        That it was asked for is not recorded: the next message handled would have brought it.
        """
        return self._recorded(self._incident.pass_time(now_ns), now_ns)

    def finish(self, now_ns: int) -> Sequence[Outgoing]:
        """Record that the incident ends, finish it, and record and return what it still says."""
        self._record.mark_end(now_ns)
        return self._recorded(self._incident.finish(now_ns), now_ns)

    def _recorded(self, made: Sequence[Outgoing], now_ns: int) -> Sequence[Outgoing]:
        for outgoing in made:
            self._record.put(outgoing.key, outgoing.payload, now_ns, outgoing=True)
        return made


class Recorder:
    """Records on a thread of its own, so that whoever hears messages never waits for the disk.

    Between the two stands a bounded queue; what finds no room is dropped, counted and logged, and
    the recording says so as well. While the disk fails, what comes waits in the queue, and the
    disk is tried again every ``retry_s``: nothing is missing if it recovers in time.
    """

    def __init__(
        self,
        path: Path,
        metadata: Mapping[str, str],
        *,
        resume: bool = False,
        mirror: Mirror | None = None,
        rotation: Rotation | None = None,
        queue_messages: int = QUEUE_MESSAGES,
        queue_bytes: int = QUEUE_BYTES,
        retry_s: float = RETRY_S,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """Begin the recording, or go on with it. Raises ``RecorderError`` as ``RecordingFile``."""
        self._file = RecordingSet(path, metadata, resume=resume, mirror=mirror, rotation=rotation)
        self.unfinished = where_part_is(path, 1) if self._file.is_resumed else None
        """Where the recording is that it goes on with, if so: to be read before anything is put."""

        self._queue_messages = queue_messages
        self._queue_bytes = queue_bytes
        self._retry_s = retry_s
        self._monotonic_ns = monotonic_ns
        self._changed = threading.Condition()
        self._queue: deque[Entry] = deque()
        self._unsynced: list[Entry] = []
        """What is in the file, but may not be on the disk."""

        self._queued_bytes = 0
        self._taken = 0
        self._safe = 0
        self.begun_anew = 0
        """How often all that was safe was gone: somebody had cut the file, another was begun."""

        self.follow: Callable[[Sequence[Item], int], None] = lambda _items, _position: None
        """Told, on the recorder's thread, what is safe since, and how far the file is written."""

        self._written = 0
        self._dropped = self._dropped_told = self._file.dropped_before
        self._fault: str | None = None
        self._synced_ns = monotonic_ns()
        self._closing = False
        self._finishes = True
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    @property
    def taken(self) -> int:
        """How many messages it has taken so far."""
        return self._taken

    @property
    def safe(self) -> int:
        """How many of them, the first ones, would survive a power cut."""
        return self._safe

    @property
    def has_room(self) -> bool:
        """Whether the disk works and the queue is half empty at least."""
        with self._changed:
            few = len(self._queue) <= self._queue_messages // 2
            return few and self._queued_bytes <= self._queue_bytes // 2 and self._fault is None

    def put(self, key: str, payload: bytes, log_time_ns: int, *, outgoing: bool = False) -> bool:
        """Have a message recorded, received at ``log_time_ns`` or made then (``outgoing``).

        Never waits for the disk; ``False`` if it is dropped. Any thread may call it; the order of
        calls is kept.
        """
        with self._changed:
            full = len(self._queue) >= self._queue_messages
            too_much = self._queued_bytes + len(payload) > self._queue_bytes
            if full or too_much or self._closing:
                self._dropped += 1
                return False
            self._taken += 1
            self._enqueue(Item(key, payload, log_time_ns, outgoing))
            return True

    def mark_end(self, now_ns: int) -> None:
        """Say that the incident was finished at ``now_ns``: no more is received."""
        with self._changed:
            self._enqueue(End(now_ns))

    def mark_resumed(
        self, now_ns: int, begun_from: BegunFrom = "all", put_aside: Sequence[str] = ()
    ) -> None:
        """Say that the recording is gone on with since ``now_ns``, and what that began from."""
        with self._changed:
            self._enqueue(Resumed(now_ns, begun_from, put_aside))

    def when_safe(self, then: Callable[[int], None]) -> bool:
        """Call ``then`` once all that has been put would survive a power cut; ``False`` if not.

        It is called on the recorder's thread, with how far the file is written by then.
        """
        with self._changed:
            self._enqueue(WhenSafe(then))
            return not self._closing

    @property
    def part(self) -> Path:
        """Where what is written is until it is finished: the recording, or its last part."""
        return self._file.part

    @property
    def part_number(self) -> int:
        """Which part of the recording that is."""
        return self._file.number

    def status(self) -> RecorderStatus:
        """Return how it fares now."""
        with self._changed:
            return RecorderStatus(len(self._queue), self._written, self._dropped, self._fault)

    def close(self) -> RecorderStatus:
        """Write what is queued, finish the file, and return how it went. Twice is harmless.

        If the disk fails even now, the file so far is kept, unfinished, and the rest is dropped.
        """
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join()
        return self.status()

    def __enter__(self) -> Self:
        """Return the recorder, at work."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Close; after an error leave the recording unfinished, to be gone on with."""
        self._finishes = kind is None
        self.close()

    def _enqueue(self, entry: Entry) -> None:
        if not self._closing:
            self._queue.append(entry)
            self._queued_bytes += entry.size_bytes
            self._changed.notify()

    def _run(self) -> None:
        try:
            while not self._has_recorded_all():
                self._await_retry()
        except Exception as error:
            # Whatever ends this thread must be known outside, and must not end the program.
            self._give_up(str(error))

    def _has_recorded_all(self) -> bool:
        """Record until the end; ``False`` if the disk fails and is to be tried again."""
        # Who closes does not wait for the disk more than once.
        last_try = self._closing
        try:
            if self._fault is not None:
                self._mend()
            while self._step():
                self._sync_if_due()
            self._tell_dropped()
            if self._finishes:
                self._file.finish()
            else:
                self._file.sync()
                self._file.abandon()
        except OSError as error:
            self._take_back(error)
            if last_try:
                self._give_up(str(error))
            return last_try
        self._safe = self._taken
        return True

    def _step(self) -> bool:
        """Wait for a message until the next sync is due, and write it; ``False`` at the end."""
        with self._changed:
            if not self._queue and not self._closing:
                self._changed.wait(self._seconds_until_sync() if self._unsynced else None)
            entry = self._queue.popleft() if self._queue else None
            self._queued_bytes -= entry.size_bytes if entry is not None else 0
            going_on = entry is not None or not self._closing
        if isinstance(entry, WhenSafe):
            self._unsynced.append(entry)
            self._sync()
            entry.then(self._file.synced_bytes)
        elif entry is not None:
            self._write(entry)
        return going_on

    def _write(self, entry: Item | End | Resumed) -> None:
        try:
            entry.write_to(self._file)
            self._written += isinstance(entry, Item)
        except OSError:
            with self._changed:
                self._queue.appendleft(entry)
                self._queued_bytes += entry.size_bytes
            raise
        except (struct.error, OverflowError) as error:
            # A time beyond what the format can hold: that message is lost, not the recording.
            with self._changed:
                self._dropped += 1
            _log.error("a message cannot be recorded", why=str(error))
        self._unsynced.append(entry)

    def _seconds_until_sync(self) -> float:
        return max(0, self._synced_ns + SYNC_PERIOD_NS - self._monotonic_ns()) / NS_PER_S

    def _sync_if_due(self) -> None:
        if self._unsynced and self._seconds_until_sync() == 0.0:
            self._sync()
            self._file.rotate_if_due()

    def _sync(self) -> None:
        self._tell_dropped()
        self._file.sync()
        items = [each for each in self._unsynced if isinstance(each, Item)]
        self._safe += len(items)
        self._unsynced.clear()
        self.follow(items, self._file.synced_bytes)
        self._synced_ns = self._monotonic_ns()

    def _tell_dropped(self) -> None:
        dropped = self.status().dropped
        if dropped > self._dropped_told:
            _log.warning("the recorder is behind and has dropped messages", dropped=dropped)
            self._file.mark_dropped(dropped)
            self._dropped_told = dropped

    def _take_back(self, error: OSError) -> None:
        """Put back into the queue what may not be on the disk, and say what is wrong."""
        self._file.abandon()
        fault = f"{self._file.path}: recording has stopped: {error}"
        with self._changed:
            is_news = self._fault is None
            self._fault = fault
            self._written -= sum(isinstance(each, Item) for each in self._unsynced)
            self._queue.extendleft(reversed(self._unsynced))
            self._queued_bytes += sum(each.size_bytes for each in self._unsynced)
        self._unsynced.clear()
        if is_news:
            _log.error(fault, kept_until_then=self._written)

    def _await_retry(self) -> None:
        with self._changed:
            self._changed.wait_for(lambda: self._closing, self._retry_s)

    def _mend(self) -> None:
        """Go on with the file behind what is safe, with all that has waited since."""
        gone = self._file.mend()
        self._dropped_told = self._file.dropped_before
        with self._changed:
            self._dropped += gone
            self.begun_anew += gone > 0
        while self.status().queued:
            self._step()
            self._sync_if_due()
        self._sync()
        with self._changed:
            self._fault = None
        _log.warning("recording goes on", dropped=self.status().dropped)

    def _give_up(self, why: str) -> None:
        self._file.abandon()
        with self._changed:
            self._closing = True
            self._fault = f"{self._file.path}: recording has stopped: {why}"
            self._dropped += sum(isinstance(each, Item) for each in self._queue)
            self._queue.clear()
            self._queued_bytes = 0
        _log.error(self._fault, kept_until_then=self._written, dropped=self._dropped)
