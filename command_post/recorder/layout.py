"""How a recording is laid out in its file: what an interrupted one has that is whole, and its end.

A file is written from its beginning to its end. One that was broken off is gone on with behind its
last whole chunk. Every one is given the ending that the MCAP library would have given it.

Format: the MCAP specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    Message,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from shared.mcap_reader import ABOUT, CHANNEL, DROPPED, END
from shared.mcap_records import MAGIC, Indexed, Placed, RecordScan, mapped, sum_of
from shared.recording_parts import PART

LOST = "clew/lost"
"""What is put for the name of a schema or a channel that damage has made unknown."""

_FOOTER_START = struct.Struct("<BQQQ")
_FOOTER_BYTES = 20


@dataclass
class Declared:
    """The schemas and channels of a file, by the numbers that it gives them."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)

    def without_gaps(self) -> Declared:
        """Return it with something for each number that is not known because of damage."""
        schemas = {
            number: self.schemas.get(number, Schema(number, b"", "", LOST))
            for number in range(1, max(self.schemas, default=0) + 1)
        }
        channels = {
            number: self.channels.get(number, Channel(number, LOST, "", {}, 0))
            for number in range(1, max(self.channels, default=0) + 1)
        }
        return Declared(schemas, channels)


class WholePart(NamedTuple):
    """What is whole of a recording that was broken off.

    It ends at ``end_bytes``, with what ``declared`` says. The messages of ``unindexed`` stood
    behind that, whole as well, but not what is to follow them in the file. ``about`` is ``None`` if
    the recording had not even begun, ``ended`` if the incident had been finished. ``follows`` says
    which part it is, if it is a later one.
    """

    end_bytes: int
    declared: Declared
    unindexed: list[Message]
    about: dict[str, str] | None
    ended: bool
    dropped_count: int
    follows: dict[str, str] | None


class Block(NamedTuple):
    """A chunk, without its data, and the message indexes behind it.

    ``messages`` is how many of each channel, ``index_bytes`` where the index of each stands.
    """

    chunk: Chunk
    compressed_bytes: int
    begin_bytes: int
    chunk_end_bytes: int
    end_bytes: int
    messages: dict[int, int]
    index_bytes: dict[int, int]


class Layout(NamedTuple):
    """What stands in a file: its blocks, and its metadata with where that stands.

    ``tells_channels`` are the blocks that declare channels no block before them does.
    """

    blocks: list[Block]
    metadata: list[tuple[Metadata, Placed]]
    tells_channels: list[Block]


def whole_part(path: Path) -> WholePart:
    """Return what is whole of the file at ``path``; only what must be is unpacked for that.

    Raises ``RecordingError`` if it is no MCAP file.
    """
    with mapped(path) as data:
        scan = RecordScan(data)
        layout = _layout(scan.placed())
        blocks = layout.blocks
        last = _content(scan, blocks[-1]) if blocks else None
        while blocks and last is None:
            blocks.pop()
            last = _content(scan, blocks[-1]) if blocks else None
        declared = Declared()
        for block in layout.tells_channels:
            if blocks and block.begin_bytes < blocks[-1].begin_bytes:
                _declare(declared, _content(scan, block))
        _declare(declared, last)
    end_bytes = _end_bytes(layout)
    messages = [each for each in last or () if isinstance(each, Message)]
    if blocks and Counter(each.channel_id for each in messages) != blocks[-1].messages:
        end_bytes = blocks[-1].begin_bytes
    else:
        messages = []
    said = {each.name: each.metadata for each, _ in layout.metadata}
    dropped_count = int(said.get(DROPPED, {}).get("count", "0"))
    return WholePart(
        end_bytes, declared, messages, said.get(ABOUT), END in said, dropped_count, said.get(PART)
    )


def _layout(records: Iterable[Placed]) -> Layout:
    layout = Layout([], [], [])
    blocks = layout.blocks
    has_news = False
    for placed in records:
        record, begin_bytes, end_bytes = placed
        if isinstance(record, Chunk):
            header = replace(record, data=b"")
            size = len(record.data)
            blocks.append(Block(header, size, begin_bytes, end_bytes, end_bytes, {}, {}))
            layout.tells_channels.extend(blocks[-1:] if has_news else ())
            has_news = False
        elif isinstance(record, Metadata):
            has_news |= record.name == CHANNEL
            layout.metadata.append((record, placed))
        elif isinstance(record, Indexed) and blocks and blocks[-1].end_bytes == begin_bytes:
            blocks[-1].messages[record.channel_id] = record.message_count
            blocks[-1].index_bytes[record.channel_id] = begin_bytes
            blocks[-1] = blocks[-1]._replace(end_bytes=end_bytes)
    return layout


def _content(scan: RecordScan, block: Block) -> list[McapRecord] | None:
    placed = next(scan.placed(block.begin_bytes))
    if not isinstance(placed.record, Chunk):
        raise TypeError(f"no chunk at {block.begin_bytes}, where one was")
    return scan.content(placed.record, placed.begin_bytes, placed.end_bytes)


def _end_bytes(layout: Layout) -> int:
    """Return where the last block ends, or else what says what the recording is about."""
    if layout.blocks:
        return layout.blocks[-1].end_bytes
    begins = (at.end_bytes for each, at in layout.metadata if each.name in (ABOUT, PART))
    return max(begins, default=0)


def _declare(declared: Declared, content: Iterable[McapRecord] | None) -> None:
    for record in content or ():
        if isinstance(record, Schema):
            declared.schemas.setdefault(record.id, record)
        elif isinstance(record, Channel):
            declared.channels.setdefault(record.id, record)


def ending_of(path: Path, declared: Declared) -> bytes:
    """Return what is to follow the data in the file at ``path``, as the library would write it.

    Raises ``RecordingError`` if the file cannot be read.
    """
    with mapped(path) as data:
        layout = _layout(RecordScan(data).placed())
        return ending(layout, len(data), sum_of(data, len(data)), declared)


def ending(layout: Layout, size: int, checksum: int, declared: Declared) -> bytes:
    """Return what is to follow data of that layout, size in bytes and checksum."""
    data_end = _bytes_of([DataEnd(checksum)])
    start = size + len(data_end)
    groups: list[tuple[Opcode, Sequence[McapRecord]]] = [
        (Opcode.SCHEMA, list(declared.schemas.values())),
        (Opcode.CHANNEL, list(declared.channels.values())),
        (Opcode.STATISTICS, [_statistics(layout, declared)]),
        (Opcode.CHUNK_INDEX, [_chunk_index(block) for block in layout.blocks]),
        (Opcode.ATTACHMENT_INDEX, []),
        (Opcode.METADATA_INDEX, [_metadata_index(*each) for each in layout.metadata]),
    ]
    summary, offsets = b"", list[McapRecord]()
    for opcode, records in groups:
        written = _bytes_of(records)
        offsets.append(SummaryOffset(opcode, start + len(summary), len(written)))
        summary += written
    offsets_start = start + len(summary)
    summary += _bytes_of(offsets)
    footer_start = _FOOTER_START.pack(Opcode.FOOTER, _FOOTER_BYTES, start, offsets_start)
    footer = Footer(start, offsets_start, zlib.crc32(footer_start, zlib.crc32(summary)))
    return data_end + summary + _bytes_of([footer]) + MAGIC


def _statistics(layout: Layout, declared: Declared) -> Statistics:
    counts: Counter[int] = Counter()
    for block in layout.blocks:
        counts.update(block.messages)
    return Statistics(
        attachment_count=0,
        channel_count=len(declared.channels),
        channel_message_counts=counts,
        chunk_count=len(layout.blocks),
        message_count=counts.total(),
        message_end_time=max((each.chunk.message_end_time for each in layout.blocks), default=0),
        message_start_time=min(
            (each.chunk.message_start_time for each in layout.blocks), default=0
        ),
        metadata_count=len(layout.metadata),
        schema_count=len(declared.schemas),
    )


def _chunk_index(block: Block) -> ChunkIndex:
    return ChunkIndex(
        chunk_length=block.chunk_end_bytes - block.begin_bytes,
        chunk_start_offset=block.begin_bytes,
        compression=block.chunk.compression,
        compressed_size=block.compressed_bytes,
        message_end_time=block.chunk.message_end_time,
        message_index_length=block.end_bytes - block.chunk_end_bytes,
        message_index_offsets=block.index_bytes,
        message_start_time=block.chunk.message_start_time,
        uncompressed_size=block.chunk.uncompressed_size,
    )


def _metadata_index(metadata: Metadata, placed: Placed) -> MetadataIndex:
    length = placed.end_bytes - placed.begin_bytes
    return MetadataIndex(offset=placed.begin_bytes, length=length, name=metadata.name)


def _bytes_of(records: Iterable[McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())
