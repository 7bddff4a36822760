"""Where everything of a recording's file is: as its index at the end says, or as is found.

Nothing is unpacked for that. Format: the MCAP specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import mmap
import struct
import zlib
from io import BytesIO
from typing import NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Metadata
from numpy.typing import NDArray

from shared.mcap_reader import CHANNEL
from shared.mcap_records import MAGIC, Damage, Indexed, RecordScan, is_finished

FRAME = struct.Struct("<BQ")
"""What every record begins with: its opcode, and how many bytes follow."""

OFFSETS = np.dtype([("channel", "<u2"), ("offset", "<u8")])

_FOOTER_BYTES = 20 + len(MAGIC)
_FOOTER = struct.Struct("<QQI")
_CHUNK_INDEX = struct.Struct("<QQQQI")


class ChunkAt(NamedTuple):
    """A chunk of one of several files.

    ``offsets``: where in its file the message index of each channel stands.
    """

    file: int
    begin_bytes: int
    start_ns: int
    end_ns: int
    offsets: NDArray[np.void]


class Contents(NamedTuple):
    """All of a file, but for the messages: they are in the chunks, under the channels' numbers."""

    chunks: list[ChunkAt]
    channels: dict[int, Channel]
    metadata: list[Metadata]
    damages: list[Damage]


def contents_of(data: mmap.mmap, number: int) -> Contents:
    """Return where everything is of a file whose bytes are ``data``; ``number`` is told of it."""
    found = _indexed(data, number) if is_finished(data) else None
    return _scanned(data, number) if found is None else found


def _indexed(data: mmap.mmap, number: int) -> Contents | None:
    """Return what a file's own index says; ``None`` if there is none that can be trusted."""
    end = len(data) - _FOOTER_BYTES
    start, _, crc = _FOOTER.unpack_from(data, end)
    if not 0 < start < end or zlib.crc32(data[start : end + 16]) != crc:
        return None
    found = Contents([], {}, [], [])
    position = start
    while position < end - FRAME.size:
        opcode, length = FRAME.unpack_from(data, position)
        begin, position = position + FRAME.size, position + FRAME.size + length
        if opcode == Opcode.CHUNK_INDEX:
            found.chunks.append(_chunk_of(data, begin, number))
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(data[begin:position])))
            found.channels[channel.id] = channel
        elif opcode == Opcode.METADATA_INDEX:
            (at,) = struct.unpack_from("<Q", data, begin)
            _, size = FRAME.unpack_from(data, at)
            body = data[at + FRAME.size : at + FRAME.size + size]
            found.metadata.append(Metadata.read(ReadDataStream(BytesIO(body))))
    found.chunks.sort(key=lambda each: each.begin_bytes)
    return found


def _chunk_of(data: mmap.mmap, begin: int, number: int) -> ChunkAt:
    start_ns, end_ns, at, _, size = _CHUNK_INDEX.unpack_from(data, begin)
    first = begin + _CHUNK_INDEX.size
    return ChunkAt(number, at, start_ns, end_ns, np.frombuffer(data[first : first + size], OFFSETS))


def _told_channel(told: dict[str, str]) -> Channel:
    return Channel(int(told["id"]), told["topic"], "", told, 0)


def _scanned(data: mmap.mmap, number: int) -> Contents:
    """Go through a file that has no index, or one that cannot be used."""
    scan = RecordScan(data)
    found = Contents([], {}, [], [])
    offsets: list[tuple[int, int]] = []
    for record, begin_bytes, _ in scan.placed():
        if isinstance(record, Chunk):
            offsets = []
            times = (record.message_start_time, record.message_end_time)
            found.chunks.append(ChunkAt(number, begin_bytes, *times, np.empty(0, OFFSETS)))
        elif isinstance(record, Indexed) and found.chunks:
            offsets.append((record.channel_id, begin_bytes))
            found.chunks[-1] = found.chunks[-1]._replace(offsets=np.array(offsets, OFFSETS))
        elif isinstance(record, Metadata):
            found.metadata.append(record)
            if record.name == CHANNEL:
                channel = _told_channel(record.metadata)
                found.channels.setdefault(channel.id, channel)
    return found._replace(damages=scan.damages)
