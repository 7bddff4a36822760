"""The records of an MCAP file one by one, from the front: what is whole of it, and what is not.

A file may be broken off or damaged anywhere: what cannot be read is noted and passed over, and an
index is trusted nowhere.

Format: the MCAP specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import mmap
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import NamedTuple, TypeAlias

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Header, McapRecord, Metadata, Schema
from mcap.stream_reader import breakup_chunk

MAGIC = b"\x89MCAP0\r\n"
_FRAME = struct.Struct("<BQ")
_FOOTER_START = _FRAME.pack(Opcode.FOOTER, 20)
_ENDING_BYTES = len(_FOOTER_START) + 20 + len(MAGIC)
_MESSAGE_INDEX_START = struct.Struct("<HI")
_INDEXED_BYTES = 16
_CHUNK_START = re.compile(rb"\x06.{36}(?:\x04\0\0\0zstd|\x03\0\0\0lz4)", re.DOTALL)
_CRC_BLOCK_BYTES = 1 << 20
UNREADABLE = (
    McapError, ValueError, struct.error, zstandard.ZstdError,
    RuntimeError, OverflowError, MemoryError,
)  # fmt: skip
"""All that damaged bytes can make the MCAP reader and its decompressors raise."""


class RecordingError(ValueError):
    """A file cannot be read as a recording. The text names the file and says why."""


class Damage(NamedTuple):
    """A stretch of the file that could not be read, and why; of no length if nothing is lost."""

    offset_bytes: int
    length_bytes: int
    reason: str


class Indexed(NamedTuple):
    """How many messages of a channel a chunk holds: what a message index says for this reader."""

    channel_id: int
    message_count: int


Record: TypeAlias = McapRecord | Indexed


class Placed(NamedTuple):
    """A record of the data section, from where to where it stands in the file."""

    record: Record
    begin_bytes: int
    end_bytes: int


@contextmanager
def mapped(path: Path) -> Iterator[mmap.mmap]:
    """Give the bytes of an MCAP file. Raises ``RecordingError`` if it is none, or has gone."""
    try:
        if path.is_fifo():
            raise RecordingError(f"{path}: is a pipe; write what comes out of it to a file first")
        with path.open("rb") as file:
            beginning = file.read(len(MAGIC))
            if not beginning:
                raise RecordingError(f"{path}: is empty; nothing was recorded")
            if beginning != MAGIC:
                raise RecordingError(f"{path}: is not an MCAP file (it begins with {beginning!r})")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                yield data
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from error


def is_finished(data: mmap.mmap) -> bool:
    """Say whether a file has come to its proper end."""
    footer = data[-_ENDING_BYTES:]
    return footer.startswith(_FOOTER_START) and footer.endswith(MAGIC)


def sum_of(data: mmap.mmap, end_bytes: int) -> int:
    """Return the checksum of all that stands before ``end_bytes``."""
    crc = 0
    for start in range(0, end_bytes, _CRC_BLOCK_BYTES):
        crc = zlib.crc32(data[start : min(start + _CRC_BLOCK_BYTES, end_bytes)], crc)
    return crc


class RecordScan:
    """One pass over the data section of a file. ``damages`` are those met so far."""

    def __init__(self, data: mmap.mmap) -> None:
        self._data = data
        self.damages: list[Damage] = []

    def placed(self, since_bytes: int = len(MAGIC)) -> Iterator[Placed]:
        """Yield the records from ``since_bytes`` on, where one must begin, to the data's end."""
        position = since_bytes
        while position < len(self._data):
            try:
                placed = self._record_at(position)
            except UNREADABLE as error:
                position = self._resume(position, error)
                continue
            yield placed
            if isinstance(placed.record, DataEnd):
                self._check_sum(placed.record, position)
                return
            position = placed.end_bytes

    def content(self, chunk: Chunk, begin_bytes: int, end_bytes: int) -> list[McapRecord] | None:
        """Return what is in ``chunk``; note it and return ``None`` if its checksum fails."""
        try:
            return breakup_chunk(chunk, validate_crc=True)
        except UNREADABLE as error:
            self.damages.append(Damage(begin_bytes, end_bytes - begin_bytes, words(error)))
            return None

    def _record_at(self, position: int) -> Placed:
        start = position + _FRAME.size
        if start > len(self._data):
            raise ValueError("broken off")
        opcode, length = _FRAME.unpack_from(self._data, position)
        if start + length > len(self._data):
            raise ValueError("broken off")
        record = _parse(opcode, self._data[start : start + length])
        return Placed(record, position, start + length)

    def _resume(self, position: int, error: Exception) -> int:
        """Note the loss at ``position``; return where the next chunk begins, or the file ends."""
        resume = len(self._data)
        match = _CHUNK_START.search(self._data, position + 1)
        while match:
            if self._is_chunk(match.start()):
                resume = match.start()
                break
            match = _CHUNK_START.search(self._data, match.start() + 1)
        self.damages.append(Damage(position, resume - position, words(error)))
        return resume

    def _is_chunk(self, position: int) -> bool:
        try:
            placed = self._record_at(position)
        except UNREADABLE:
            return False
        return isinstance(placed.record, Chunk)

    def _check_sum(self, data_end: DataEnd, position: int) -> None:
        """Note it if bytes outside the chunks' data were altered (0: the writer took no sum)."""
        if data_end.data_section_crc == 0 or self.damages:
            return
        if sum_of(self._data, position) != data_end.data_section_crc:
            reason = f"altered outside its messages, of which none is lost (of {position} bytes the"
            self.damages.append(Damage(0, 0, f"{reason} checksum differs)"))


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


def _parse(opcode: int, body: bytes) -> Record:
    """Return the record. Raises one of ``UNREADABLE``."""
    if opcode == Opcode.MESSAGE_INDEX:
        channel_id, length = _MESSAGE_INDEX_START.unpack_from(body)
        if len(body) != _MESSAGE_INDEX_START.size + length:
            raise ValueError("a message index of the wrong length")
        return Indexed(channel_id, length // _INDEXED_BYTES)
    if opcode not in _PARSERS:
        raise ValueError(f"no record of messages begins with {opcode:#04x}")
    stream = ReadDataStream(BytesIO(body))
    record = _PARSERS[opcode](stream)
    if stream.count != len(body):
        raise ValueError(f"a {type(record).__name__.lower()} of the wrong length")
    return record


def words(error: Exception) -> str:
    """Return what an error says, or at least what it is."""
    return str(error) or type(error).__name__
