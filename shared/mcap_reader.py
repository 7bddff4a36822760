"""What a recording is, and how to read it: whole, broken off, or damaged.

A recording is an MCAP file of wire bytes as they were received, a channel for each key. A program
that was killed leaves it without an end, a failing card with holes. So it is read record by
record from the front, without trust in an index: every chunk whose checksum holds is used, what
cannot be read is passed over, and a report says what was lost.

Format: the MCAP specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import mmap
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import msgspec
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    DataEnd,
    Header,
    McapRecord,
    Message,
    Metadata,
    Schema,
)
from mcap.stream_reader import breakup_chunk

ABOUT = "clew"
"""Name of the metadata that says what was recorded, where, with which software and settings."""

CHANNEL = "clew.channel"
"""Name of the metadata that tells a channel once more, outside the chunk that declares it."""

DROPPED = "clew.dropped"
"""Name of the metadata that says how many messages the recorder has had to drop so far."""

END = "clew.end"
"""Name of the metadata that says when the incident was finished, on the post's clock."""

_MAGIC = b"\x89MCAP0\r\n"
_FRAME = struct.Struct("<BQ")
_FOOTER_START = _FRAME.pack(Opcode.FOOTER, 20)
_ENDING_BYTES = len(_FOOTER_START) + 20 + len(_MAGIC)
_MESSAGE_INDEX_START = struct.Struct("<HI")
_CHUNK_START = re.compile(rb"\x06.{36}(?:\x04\0\0\0zstd|\x03\0\0\0lz4)", re.DOTALL)
_CRC_BLOCK_BYTES = 1 << 20
_UNREADABLE = (
    McapError, ValueError, struct.error, zstandard.ZstdError,
    RuntimeError, OverflowError, MemoryError,
)  # fmt: skip
"""All that damaged bytes can make the MCAP reader and its decompressors raise."""


class RecordingError(ValueError):
    """A file cannot be read as a recording. The text names the file and says why."""


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


class Damage(NamedTuple):
    """A stretch of the file that could not be read, and why; of no length if nothing is lost."""

    offset_bytes: int
    length_bytes: int
    reason: str


@dataclass
class ReadReport:
    """What reading has found so far; complete once the last message has been taken.

    ``finished``: the recorder closed the file. ``dropped_count``: messages it had no room for.
    ``unplaced_count``: messages whose channel is not known because of damage. ``excerpt_count``:
    messages of which only the beginning was kept.
    """

    finished: bool = False
    message_count: int = 0
    chunk_count: int = 0
    unplaced_count: int = 0
    excerpt_count: int = 0
    dropped_count: int = 0
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
            (self.dropped_count, "messages dropped by the recorder"),
            (self.unplaced_count, "messages without a known channel"),
            (self.excerpt_count, "messages kept in part"),
        ):
            lines.extend([f"{count} {what}"] if count else [])
        lines.extend(
            f"{length} bytes lost at {offset}: {reason}" if length else reason
            for offset, length, reason in self.damages
        )
        return "\n".join(lines)


class Recording:
    """A recording to be iterated over: its messages in the order they were put into the file.

    That is the order in which they were handled, even where the post's clock was set back
    meanwhile. ``metadata`` says what was recorded; it is empty in files of other programs.
    ``report`` is of the iteration begun last.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.metadata: dict[str, str] = {}
        self.report = ReadReport()
        with _mapped(path) as data:
            for record in _Scan(data).records():
                if isinstance(record, Metadata) and record.name == ABOUT:
                    self.metadata = record.metadata
                if isinstance(record, Metadata | Chunk):
                    break

    def __iter__(self) -> Iterator[RecordedMessage]:
        """Yield all that can be read. Raises ``RecordingError`` if the file has gone."""
        with _mapped(self.path) as data:
            scan = _Scan(data)
            self.report = scan.report
            yield from scan.messages()


def read_recording(path: Path) -> Recording:
    """Open the recording at ``path``. Raises ``RecordingError`` if it is no MCAP file."""
    return Recording(path)


@contextmanager
def _mapped(path: Path) -> Iterator[mmap.mmap]:
    try:
        with path.open("rb") as file:
            beginning = file.read(len(_MAGIC))
            if not beginning:
                raise RecordingError(f"{path}: is empty; nothing was recorded")
            if beginning != _MAGIC:
                raise RecordingError(f"{path}: is not an MCAP file (it begins with {beginning!r})")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                yield data
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from error


class _Place(NamedTuple):
    key: str
    outgoing: bool
    excerpt: bool


class _Scan:
    """One pass over the bytes of a recording."""

    def __init__(self, data: mmap.mmap) -> None:
        self._data = data
        self._places: dict[int, _Place] = {}
        footer = data[-_ENDING_BYTES:]
        self.report = ReadReport(
            finished=footer.startswith(_FOOTER_START) and footer.endswith(_MAGIC)
        )

    def messages(self) -> Iterator[RecordedMessage]:
        """Yield the messages of all chunks that are whole, and of none that is not."""
        for record in self.records():
            try:
                message = self._take(record)
            except (KeyError, ValueError, msgspec.MsgspecError) as error:
                kind = type(record).__name__.lower()
                reason = f"a {kind} that was not written by Clew ({_words(error)})"
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
        position = len(_MAGIC)
        while position < len(self._data):
            try:
                record, end = self._record_at(position)
            except _UNREADABLE as error:
                position = self._resume(position, error)
                continue
            if record is not None:
                yield record
            if isinstance(record, Chunk):
                yield from self._content(record, position, end)
            if isinstance(record, DataEnd):
                self._check_sum(record, position)
                return
            position = end

    def _record_at(self, position: int) -> tuple[McapRecord | None, int]:
        """Return the record at ``position`` (``None``: of no interest here) and where it ends."""
        start = position + _FRAME.size
        if start > len(self._data):
            raise ValueError("broken off")
        opcode, length = _FRAME.unpack_from(self._data, position)
        if start + length > len(self._data):
            raise ValueError("broken off")
        return _parse(opcode, self._data[start : start + length]), start + length

    def _resume(self, position: int, error: Exception) -> int:
        """Note the loss at ``position``; return where the next chunk begins, or the file ends."""
        resume = len(self._data)
        match = _CHUNK_START.search(self._data, position + 1)
        while match:
            if self._is_chunk(match.start()):
                resume = match.start()
                break
            match = _CHUNK_START.search(self._data, match.start() + 1)
        self.report.damages.append(Damage(position, resume - position, _words(error)))
        return resume

    def _is_chunk(self, position: int) -> bool:
        try:
            record, _ = self._record_at(position)
        except _UNREADABLE:
            return False
        return isinstance(record, Chunk)

    def _content(self, chunk: Chunk, position: int, end: int) -> list[McapRecord]:
        """Return what is in ``chunk``, nothing if its checksum does not hold."""
        try:
            records = breakup_chunk(chunk, validate_crc=True)
        except _UNREADABLE as error:
            self.report.damages.append(Damage(position, end - position, _words(error)))
            return []
        self.report.chunk_count += 1
        return records

    def _check_sum(self, data_end: DataEnd, position: int) -> None:
        """Note it if bytes outside the chunks' data were altered (0: the writer took no sum)."""
        if data_end.data_section_crc == 0 or self.report.damages:
            return
        crc = 0
        for start in range(0, position, _CRC_BLOCK_BYTES):
            crc = zlib.crc32(self._data[start : min(start + _CRC_BLOCK_BYTES, position)], crc)
        if crc != data_end.data_section_crc:
            reason = f"altered outside its messages, of which none is lost (of {position} bytes the"
            self.report.damages.append(Damage(0, 0, f"{reason} checksum differs)"))

    def _note(self, metadata: Metadata) -> None:
        values = metadata.metadata
        if metadata.name == CHANNEL:
            self._places.setdefault(int(values["id"]), _place(values["topic"], values))
        elif metadata.name == DROPPED:
            self.report.dropped_count = int(values["count"])
        elif metadata.name == END:
            self.report.end_ns = int(values["time_ns"])

    def _message(self, record: Message) -> RecordedMessage | None:
        place = self._places.get(record.channel_id)
        if place is None:
            self.report.unplaced_count += 1
            return None
        key, payload = place.key, record.data
        if place.excerpt:
            excerpt = msgspec.msgpack.decode(record.data, type=Excerpt)
            key, payload = excerpt.key, excerpt.payload
            self.report.excerpt_count += len(payload) < excerpt.size_bytes
        self.report.message_count += 1
        return RecordedMessage(record.log_time, record.publish_time, key, payload, place.outgoing)


def _place(topic: str, metadata: dict[str, str]) -> _Place:
    return _Place(topic, metadata.get("outgoing") == "yes", metadata.get("excerpt") == "yes")


_PARSERS: dict[int, Callable[[ReadDataStream], McapRecord]] = {
    Opcode.HEADER: Header.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.CHUNK: Chunk.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.METADATA: Metadata.read,
    Opcode.DATA_END: DataEnd.read,
}
"""What may stand in the data section, besides message indexes; messages stand in chunks only."""


def _parse(opcode: int, body: bytes) -> McapRecord | None:
    """Return the record, ``None`` for a message index. Raises one of ``_UNREADABLE``."""
    stream = ReadDataStream(BytesIO(body))
    if opcode == Opcode.MESSAGE_INDEX:
        _, length = _MESSAGE_INDEX_START.unpack_from(body)
        if len(body) != _MESSAGE_INDEX_START.size + length:
            raise ValueError("a message index of the wrong length")
        return None
    if opcode not in _PARSERS:
        raise ValueError(f"no record of messages begins with {opcode:#04x}")
    record = _PARSERS[opcode](stream)
    if stream.count != len(body):
        raise ValueError(f"a {type(record).__name__.lower()} of the wrong length")
    return record


def _words(error: Exception) -> str:
    return str(error) or type(error).__name__
