"""What a recording is, and how to read it: whole, broken off, or damaged.

A recording is an MCAP file of wire bytes as they were received, a channel for each key. A program
that was killed leaves it without an end, a failing card with holes. So it is read record by
record from the front, without trust in an index: every chunk whose checksum holds is used, what
cannot be read is passed over, and a report says what was lost.

Format: the MCAP specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

import msgspec
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata

from shared.mcap_records import (
    Damage,
    Indexed,
    RecordingError,
    RecordScan,
    is_finished,
    mapped,
    words,
)
from shared.recording_parts import CONTINUED, Part, parts_of

__all__ = [
    "ABOUT",
    "CHANNEL",
    "DROPPED",
    "END",
    "RESUMED",
    "BegunFrom",
    "Damage",
    "Excerpt",
    "ReadReport",
    "RecordedMessage",
    "Recording",
    "RecordingError",
    "read_recording",
]

ABOUT = "clew"
"""Name of the metadata that says what was recorded, where, with which software and settings."""

CHANNEL = "clew.channel"
"""Name of the metadata that tells a channel once more, outside the chunk that declares it."""

DROPPED = "clew.dropped"
"""Name of the metadata that says how many messages the recorder has had to drop so far."""

END = "clew.end"
"""Name of the metadata that says when the incident was finished, on the post's clock."""

RESUMED = "clew.resumed"
"""Name of the metadata that says when a recording that had been broken off was gone on with."""

BegunFrom: TypeAlias = Literal["all", "last_told", "nothing"]
"""What a post that was killed went on from: all that is recorded, what was told last, nothing."""


class RecordedMessage(NamedTuple):
    """Bytes under a key, as they were recorded.

    ``log_time_ns`` is when they were received (``outgoing``: made) on the post's clock;
    ``publish_time_ns`` is the event time in the message on its sender's clock, or the log time
    where the bytes are not a message. ``outgoing`` messages are what the incident made of those
    received.
    """

    log_time_ns: int
    publish_time_ns: int
    key: str
    payload: bytes
    outgoing: bool


class Excerpt(msgspec.Struct, frozen=True):
    """What is kept of a message that cannot have its place on a channel of its key.

    ``payload`` is its beginning, ``size_bytes`` and ``sha256`` (hexadecimal) are of the whole.
    """

    key: str
    payload: bytes
    size_bytes: int
    sha256: str


@dataclass
class ReadReport:
    """What reading has found so far; complete once the last message has been taken.

    ``finished``: the recorder closed the file. ``dropped_count``: messages it had no room for.
    ``unplaced_count``: messages whose channel is not known because of damage. ``excerpt_count``:
    messages of which only the beginning was kept. ``resumed_count``: how often the recorder had
    been killed before it went on, ``begun_anew_count`` how often from less than all that is there.
    ``derived_count``: what is only to be looked at, and no message.
    ``continued``: another part was to follow.
    """

    finished: bool = False
    message_count: int = 0
    chunk_count: int = 0
    unplaced_count: int = 0
    excerpt_count: int = 0
    dropped_count: int = 0
    resumed_count: int = 0
    begun_anew_count: int = 0
    derived_count: int = 0
    continued: bool = False
    end_ns: int | None = None
    damages: list[Damage] = field(default_factory=list)

    @property
    def complete(self) -> bool:
        """Whether all that was put into the recording has been read."""
        lost = self.damages or self.unplaced_count or self.excerpt_count or self.dropped_count
        return self.finished and not lost

    def __str__(self) -> str:
        lines = [f"{self.message_count} messages in {self.chunk_count} chunks"]
        if not self.finished:
            lines.append("unfinished: the recorder was killed, or still writes")
        for count, what in (
            (self.resumed_count, "times broken off and gone on with"),
            (
                self.begun_anew_count,
                "times of these from what was told last at most, by no replay",
            ),
            (self.dropped_count, "messages dropped by the recorder"),
            (self.unplaced_count, "messages without a known channel"),
            (self.excerpt_count, "messages kept in part"),
            (self.derived_count, "more for Foxglove, made of them"),
        ):
            lines.extend([f"{count} {what}"] if count else [])
        lines.extend(
            f"{length} bytes lost at {offset}: {reason}" if length else reason
            for offset, length, reason in self.damages
        )
        return "\n".join(lines)


class Recording:
    """A recording to be iterated over: its messages in the order they were put into its files.

    That is the order in which they were handled, even where the post's clock was set back
    meanwhile. ``metadata`` says what was recorded; it is empty in files of other programs.
    ``report`` is of the iteration begun last. ``path`` is its first file, or their folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.metadata: dict[str, str] = {}
        self._reports: list[tuple[Part, ReadReport]] = []
        self.parts = parts_of(path)
        with mapped(self.parts[0].path) as data:
            for record in _Scan(data).records():
                if isinstance(record, Metadata) and record.name == ABOUT:
                    self.metadata = record.metadata
                if isinstance(record, Metadata | Chunk):
                    break

    @property
    def report(self) -> ReadReport:
        """What reading has found so far."""
        return _all_told(self._reports)

    def put_aside(self) -> frozenset[str]:
        """Return what was not handled in the end, having ended the post more than once, by name."""
        found: set[str] = set()
        for each in self.parts:
            with mapped(each.path) as data:
                for record, _, _ in RecordScan(data).placed():
                    if isinstance(record, Metadata) and record.name == RESUMED:
                        found.update(record.metadata.get("put_aside", "").splitlines())
        return frozenset(found)

    def __iter__(self) -> Iterator[RecordedMessage]:
        """Yield all that can be read. Raises ``RecordingError`` if a file has gone."""
        return self.since(0)

    def since(self, position_bytes: int, part: int = 1) -> Iterator[RecordedMessage]:
        """Yield what can be read from ``position_bytes`` of a part on, where something ends."""
        self._reports = []
        self.parts = parts_of(self.path)
        for each in self.parts:
            if each.number < part:
                continue
            with mapped(each.path) as data:
                scan = _Scan(data, position_bytes if each.number == part else 0)
                self._reports.append((each, scan.report))
                yield from scan.messages()


def _all_told(reports: Sequence[tuple[Part, ReadReport]]) -> ReadReport:
    """Return what reading several parts has found."""
    if not reports:
        return ReadReport()
    told = replace(reports[0][1], damages=list(reports[0][1].damages))
    for (before, of_before), (part, report) in pairwise(reports):
        told.damages += [Damage(0, 0, words) for words in _misfits(before, of_before, part)]
        told.damages += [
            each._replace(reason=f"{part.path.name}: {each.reason}") for each in report.damages
        ]
        told.message_count += report.message_count
        told.chunk_count += report.chunk_count
        told.unplaced_count += report.unplaced_count
        told.excerpt_count += report.excerpt_count
        told.resumed_count += report.resumed_count
        told.begun_anew_count += report.begun_anew_count
        told.derived_count += report.derived_count
        told.dropped_count = max(told.dropped_count, report.dropped_count)
        told.end_ns = report.end_ns
    first, last = reports[0][0], reports[-1][1]
    if first.number > 1:
        told.damages.insert(0, Damage(0, 0, f"{first.path.name}: what is before it was not read"))
    told.finished = last.finished and not last.continued
    return told


def _misfits(before: Part, of_before: ReadReport, part: Part) -> Iterator[str]:
    """Say what is wrong between a part and the one that is read before it."""
    for number in range(before.number + 1, part.number):
        yield f"part {number} is missing"
    if part.number == before.number + 1 and not of_before.finished:
        yield f"{before.path.name}: has no end, and is not the last part"
    elif part.number == before.number + 1 and part.link is not None:
        size = before.path.stat().st_size
        if size != part.link.previous_bytes:
            yield f"{before.path.name}: has {size} bytes, and had {part.link.previous_bytes}"


def read_recording(path: Path) -> Recording:
    """Open the recording at ``path``. Raises ``RecordingError`` if it is no MCAP file."""
    return Recording(path)


class _Place(NamedTuple):
    key: str
    outgoing: bool
    excerpt: bool
    derived: bool


class _Scan:
    """One pass over the bytes of a recording."""

    def __init__(self, data: mmap.mmap, since_bytes: int = 0) -> None:
        self._since_bytes = since_bytes
        self._scan = RecordScan(data)
        self._places: dict[int, _Place] = {}
        self.report = ReadReport(finished=is_finished(data), damages=self._scan.damages)

    def messages(self) -> Iterator[RecordedMessage]:
        """Yield the messages of all chunks that are whole, and of none that is not."""
        for record in self.records():
            try:
                message = self._take(record)
            except (KeyError, ValueError, msgspec.MsgspecError) as error:
                kind = type(record).__name__.lower()
                reason = f"a {kind} that was not written by Clew ({words(error)})"
                self.report.damages.append(Damage(0, 0, reason))
                continue
            if message is not None:
                yield message

    def _take(self, record: McapRecord) -> RecordedMessage | None:
        """Return the message if ``record`` holds one, else keep in mind what it says."""
        if isinstance(record, Message):
            return self._message(record)
        if isinstance(record, Channel):
            self._places[record.id] = _place(record.topic, record.metadata)
        elif isinstance(record, Metadata):
            self._note(record)
        return None

    def records(self) -> Iterator[McapRecord]:
        """Yield the records of the data section that matter; of a chunk, also what is in it."""
        for record, begin_bytes, end_bytes in self._scan.placed():
            if isinstance(record, Indexed):
                continue
            yield record
            if isinstance(record, Chunk) and begin_bytes >= self._since_bytes:
                content = self._scan.content(record, begin_bytes, end_bytes)
                self.report.chunk_count += content is not None
                yield from content or ()

    def _note(self, metadata: Metadata) -> None:
        values = metadata.metadata
        if metadata.name == CHANNEL:
            self._places.setdefault(int(values["id"]), _place(values["topic"], values))
        elif metadata.name == DROPPED:
            self.report.dropped_count = int(values["count"])
        elif metadata.name == RESUMED:
            self.report.resumed_count += 1
            self.report.begun_anew_count += values.get("begun_from", "all") != "all"
        elif metadata.name == CONTINUED:
            self.report.continued = True
        elif metadata.name == END:
            self.report.end_ns = int(values["time_ns"])

    def _message(self, record: Message) -> RecordedMessage | None:
        place = self._places.get(record.channel_id)
        if place is None:
            self.report.unplaced_count += 1
            return None
        if place.derived:
            self.report.derived_count += 1
            return None
        key, payload = place.key, record.data
        if place.excerpt:
            excerpt = msgspec.msgpack.decode(record.data, type=Excerpt)
            key, payload = excerpt.key, excerpt.payload
            self.report.excerpt_count += len(payload) < excerpt.size_bytes
        self.report.message_count += 1
        return RecordedMessage(record.log_time, record.publish_time, key, payload, place.outgoing)


def _place(topic: str, metadata: dict[str, str]) -> _Place:
    marks = (metadata.get(name) == "yes" for name in ("outgoing", "excerpt", "derived"))
    return _Place(topic, *marks)
