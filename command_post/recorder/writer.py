"""Writes the records of an MCAP file, messages in compressed chunks, each with its index.

The MCAP library's writer makes the same bytes with a dozen small writes a message, which is a good
part of all that the post does with one. Here a message is one record, packed at once.

Format: the MCAP specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from dataclasses import replace
from typing import BinaryIO

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, McapRecord, Metadata, Schema

from command_post.recorder.layout import Block, Declared, Layout, ending
from shared.mcap_records import MAGIC, Placed

CHUNK_BYTES = 1 << 18
"""A chunk is closed when it holds this much, so that rare topics are quick to read."""

_MESSAGE = struct.Struct("<BQHIQQ")
_RECORD = struct.Struct("<BQ")
_INDEX = struct.Struct("<BQHI")


class RecordWriter:
    """Writes records to ``stream`` behind what is there. Whatever writes raises its ``OSError``.

    Schemas and channels are numbered from 1 on, in the order in which they are registered; they
    stand in the chunk of the first message behind them.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._chunk = bytearray()
        self._times_ns: list[int] = []
        self._index: dict[int, list[int]] = {}
        """Of each channel, the time of each message in the chunk and where it stands there."""

        self._schemas = self._channels = 0
        self._layout = Layout([], [], [])
        self._written_bytes = self._checksum = 0

    def start(self, library: str) -> None:
        """Begin the file: say what it is, and what writes it."""
        self._write(MAGIC + _bytes_of(Header("", library)))

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Declare a schema; return its number."""
        self._schemas += 1
        self._chunk += _bytes_of(Schema(self._schemas, data, encoding, name))
        self._close_if_full()
        return self._schemas

    def register_channel(
        self, topic: str, encoding: str, schema_id: int, metadata: Mapping[str, str]
    ) -> int:
        """Declare a channel of messages of a schema, 0 for none; return its number."""
        self._channels += 1
        channel = Channel(self._channels, topic, encoding, dict(metadata), schema_id)
        self._chunk += _bytes_of(channel)
        self._close_if_full()
        return self._channels

    def add_message(
        self, channel_id: int, log_time: int, data: bytes, publish_time: int, sequence: int = 0
    ) -> None:
        """Add a message; times are in ns.

        Raises ``struct.error`` for numbers that the format cannot hold; the message is not added.
        """
        head = _MESSAGE.pack(
            Opcode.MESSAGE, _MESSAGE.size - _RECORD.size + len(data), channel_id, sequence,
            log_time, publish_time,
        )  # fmt: skip
        index = self._index.get(channel_id)
        if index is None:
            index = self._index[channel_id] = []
        index += (log_time, len(self._chunk))
        self._times_ns.append(log_time)
        self._chunk += head
        self._chunk += data
        self._close_if_full()

    def add_metadata(self, name: str, metadata: Mapping[str, str]) -> None:
        """Write metadata, before the chunk that is open."""
        record, begin_bytes = Metadata(name, dict(metadata)), self._written_bytes
        self._write(_bytes_of(record))
        self._layout.metadata.append((record, Placed(record, begin_bytes, self._written_bytes)))

    def flush(self) -> None:
        """Close the chunk, if any message is in it, and pass all on to the system."""
        self._close()
        self._stream.flush()

    def ending(self, declared: Declared) -> bytes:
        """Return what is to follow all that was written, the file having been begun here."""
        return ending(self._layout, self._written_bytes, self._checksum, declared)

    def _write(self, data: bytes) -> None:
        self._stream.write(data)
        self._written_bytes += len(data)
        self._checksum = zlib.crc32(data, self._checksum)

    def _close_if_full(self) -> None:
        if len(self._chunk) > CHUNK_BYTES:
            self._close()

    def _close(self) -> None:
        """Write the chunk, and behind it the index of each channel's messages."""
        if not self._times_ns:
            return
        content = bytes(self._chunk)
        chunk = Chunk(
            compression="zstd",
            data=zstandard.compress(content),
            message_end_time=max(self._times_ns),
            message_start_time=min(self._times_ns),
            uncompressed_crc=zlib.crc32(content),
            uncompressed_size=len(content),
        )
        begin_bytes, size = self._written_bytes, len(chunk.data)
        self._write(_bytes_of(chunk))
        chunk_end_bytes = at_bytes = self._written_bytes
        messages: dict[int, int] = {}
        index_bytes: dict[int, int] = {}
        records = []
        for channel_id, index in self._index.items():
            messages[channel_id], index_bytes[channel_id] = len(index) // 2, at_bytes
            records.append(_index_record(channel_id, index))
            at_bytes += len(records[-1])
        self._write(b"".join(records))
        header = replace(chunk, data=b"")
        self._layout.blocks.append(
            Block(header, size, begin_bytes, chunk_end_bytes, at_bytes, messages, index_bytes)
        )
        self._chunk.clear()
        self._times_ns.clear()
        self._index.clear()


def _bytes_of(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())


def _index_record(channel_id: int, index: list[int]) -> bytes:
    """Return the index of a channel: times and places by turns."""
    size = 8 * len(index)
    head = _INDEX.pack(Opcode.MESSAGE_INDEX, _INDEX.size - _RECORD.size + size, channel_id, size)
    return head + struct.pack(f"<{len(index)}Q", *index)
