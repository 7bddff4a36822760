"""Reading a recording here and there: what is wanted of it, where it is, and nothing else.

Reading a recording through takes as long as it is large. Where each chunk stands, and which keys
it has messages of, is read from the index at its end; where that is missing or damaged, it is
found by going from record to record, unpacking none. A chunk's own checksum is checked whenever
it is unpacked: what fails is noted and passed over, as in ``shared.mcap_reader``.

Format: the MCAP specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import NamedTuple, Self, TypeAlias

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk, Metadata
from mcap.stream_reader import get_chunk_data_stream
from numpy.typing import NDArray

from shared.mcap_contents import FRAME, ChunkAt, contents_of
from shared.mcap_reader import ABOUT, DROPPED, END, RESUMED, RecordedMessage
from shared.mcap_records import (
    UNREADABLE,
    Damage,
    is_finished,
    mapped,
    words,
)
from shared.recording_parts import CONTINUED

__all__ = ["Gone", "IndexedRecording", "Series", "Spot"]

KEPT_CHUNKS = 96
"""Unpacked chunks that are kept: a few dozen MB, and as many neighbours as a moment needs."""

_MESSAGE = struct.Struct("<BQHIQQ")
_MESSAGE_INDEX = struct.Struct("<BQHI")
_ENTRIES = np.dtype([("time_ns", "<u8"), ("offset", "<u8")])

Numbers: TypeAlias = NDArray[np.int64]


class Series(NamedTuple):
    """Messages of one key, received or ``outgoing``."""

    key: str
    outgoing: bool


class Spot(NamedTuple):
    """Where a message is: in which chunk, and from which of its bytes on."""

    chunk: int
    offset: int


class Gone(NamedTuple):
    """What a recording says itself of what befell it.

    ``dropped_count`` messages found no room; at each of ``resumed_ns`` it was gone on with after it
    had been broken off. ``continued``: another part was to follow the last one.
    """

    dropped_count: int
    resumed_ns: tuple[int, ...]
    end_ns: int | None
    continued: bool


class IndexedRecording:
    """The messages of one or several files of an incident, in their order, by key and by time.

    ``start_ns`` and ``end_ns`` are when the first and the last message were put into it.
    ``damages`` are those met so far. Any thread may read. Raises ``RecordingError`` if a file is no
    MCAP file, or cannot be read.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self.paths = tuple(paths)
        self.metadata: dict[str, str] = {}
        self.damages: list[Damage] = []
        self.finished = True
        self._files: list[mmap.mmap] = []
        self._chunks: list[ChunkAt] = []
        self._channels: dict[tuple[int, int], Series] = {}
        notes: list[Metadata] = []
        with ExitStack() as files:
            for number, path in enumerate(paths):
                self._files.append(files.enter_context(mapped(path)))
                notes += self._take(number)
            self._close = files.pop_all().close
        self.gone = _gone(notes)
        self._ends_ns = np.maximum.accumulate(
            np.array([each.end_ns for each in self._chunks], np.int64)
        )
        self._places = _by_series(self._chunks, self._channels)
        self._content = lru_cache(maxsize=KEPT_CHUNKS)(self._unpacked)

    def __enter__(self) -> Self:
        """Return it, open."""
        return self

    def __exit__(self, *_: object) -> None:
        """Let the files go."""
        self._content.cache_clear()
        self._close()

    @property
    def start_ns(self) -> int:
        """When its first message was put into it; 0 if there is none."""
        return min((each.start_ns for each in self._chunks), default=0)

    @property
    def end_ns(self) -> int:
        """When its last message was put into it; 0 if there is none."""
        return int(self._ends_ns[-1]) if self._chunks else 0

    @property
    def series(self) -> list[Series]:
        """All keys there are messages of."""
        return list(self._places)

    def silences_ns(self, least_ns: int) -> Iterator[tuple[int, int]]:
        """Yield from when to when nothing was put into it for so long at least."""
        before_ns = self.start_ns
        for number, chunk in enumerate(self._chunks):
            times_ns = np.array([chunk.start_ns, chunk.end_ns], np.uint64)
            if chunk.end_ns - chunk.start_ns >= least_ns:
                places = chunk.offsets["offset"].tolist()
                entries = [self._entries(number, each)["time_ns"] for each in places]
                times_ns = np.sort(np.concatenate([times_ns, *entries]))
            reached_ns = np.maximum(times_ns.astype(np.int64), before_ns)
            since_ns = np.diff(reached_ns, prepend=before_ns)
            for row in np.flatnonzero(since_ns >= least_ns).tolist():
                yield int(reached_ns[row] - since_ns[row]), int(reached_ns[row])
            before_ns = int(reached_ns[-1])

    def located(self, wanted: Iterable[Series]) -> Iterator[tuple[RecordedMessage, Spot]]:
        """Yield all messages of some series in their order, and where each is."""
        chosen = list(wanted)
        of_chunk: dict[int, list[tuple[Series, int]]] = {}
        for each in chosen:
            chunks, offsets = self._places[each]
            for chunk, offset in zip(chunks.tolist(), offsets.tolist(), strict=True):
                of_chunk.setdefault(chunk, []).append((each, offset))
        for chunk in sorted(of_chunk):
            yield from self._of_chunk(chunk, of_chunk[chunk])

    def newest(self, series: Series, at_ns: int) -> tuple[RecordedMessage, Spot] | None:
        """Return the last message of a series that was put into the recording by ``at_ns``."""
        found = self._newest_place(series, at_ns)
        if found is None:
            return None
        chunk, _, offset = found
        return self._message(series, Spot(chunk, offset))

    def newest_ns(self, series: Series, at_ns: int) -> int | None:
        """Return when that message was put into the recording; nothing is unpacked for it."""
        found = self._newest_place(series, at_ns)
        return None if found is None else found[1]

    def first_ns(self, series: Series) -> int:
        """Return when the first message of a series was put into the recording."""
        chunks, offsets = self._places[series]
        entries = self._entries(int(chunks[0]), int(offsets[0]))
        return int(entries["time_ns"][0]) if entries.size else self._chunks[chunks[0]].start_ns

    def payload(self, spot: Spot) -> bytes:
        """Return the bytes of a message that was ``located``; none if its chunk is damaged."""
        content = self._content(spot.chunk)
        if content is None:
            return b""
        length = _MESSAGE.unpack_from(content, spot.offset)[1]
        return content[spot.offset + _MESSAGE.size : spot.offset + FRAME.size + length]

    def _newest_place(self, series: Series, at_ns: int) -> tuple[int, int, int] | None:
        chunks, offsets = self._places.get(series, _NOWHERE)
        reached = np.searchsorted(self._ends_ns, at_ns, "right")
        last = int(np.searchsorted(chunks, reached, "right")) - 1
        while last >= 0:
            chunk = int(chunks[last])
            entries = self._entries(chunk, int(offsets[last]))
            before = np.flatnonzero(entries["time_ns"] <= at_ns)
            if before.size:
                newest = entries[before[-1]]
                return chunk, int(newest["time_ns"]), int(newest["offset"])
            last -= 1
        return None

    def _of_chunk(
        self, chunk: int, wanted: list[tuple[Series, int]]
    ) -> Iterator[tuple[RecordedMessage, Spot]]:
        places = [
            (offset, series)
            for series, index_bytes in wanted
            for offset in self._entries(chunk, index_bytes)["offset"].tolist()
        ]
        for offset, series in sorted(places):
            found = self._message(series, Spot(chunk, offset))
            if found is not None:
                yield found

    def _message(self, series: Series, spot: Spot) -> tuple[RecordedMessage, Spot] | None:
        content = self._content(spot.chunk)
        if content is None:
            return None
        ends = spot.offset + _MESSAGE.size > len(content)
        if ends or content[spot.offset] != Opcode.MESSAGE:
            begin_bytes = self._chunks[spot.chunk].begin_bytes
            self.damages.append(Damage(begin_bytes, 0, "its index names what is no message"))
            return None
        _, length, _, _, log_ns, publish_ns = _MESSAGE.unpack_from(content, spot.offset)
        payload = content[spot.offset + _MESSAGE.size : spot.offset + FRAME.size + length]
        return RecordedMessage(log_ns, publish_ns, series.key, payload, series.outgoing), spot

    def _entries(self, chunk: int, index_bytes: int) -> NDArray[np.void]:
        """Return when each message of a channel was put into a chunk, and where it is in it."""
        data = self._files[self._chunks[chunk].file]
        if index_bytes + _MESSAGE_INDEX.size > len(data):
            return _NO_ENTRIES
        opcode, length, _, size = _MESSAGE_INDEX.unpack_from(data, index_bytes)
        begin = index_bytes + _MESSAGE_INDEX.size
        if opcode != Opcode.MESSAGE_INDEX or size + 6 != length or begin + size > len(data):
            return _NO_ENTRIES
        return np.frombuffer(data[begin : begin + size], _ENTRIES)

    def _unpacked(self, number: int) -> bytes | None:
        """Return what is in a chunk; note it and return ``None`` if it is damaged."""
        chunk = self._chunks[number]
        data = self._files[chunk.file]
        try:
            opcode, length = FRAME.unpack_from(data, chunk.begin_bytes)
            begin = chunk.begin_bytes + FRAME.size
            if opcode != Opcode.CHUNK or begin + length > len(data):
                raise ValueError("no chunk where its index says that one is")
            record = Chunk.read(ReadDataStream(BytesIO(data[begin : begin + length])))
            stream, size = get_chunk_data_stream(record, validate_crc=True)
            return bytes(stream.read(size))
        except UNREADABLE as error:
            self.damages.append(Damage(chunk.begin_bytes, 0, words(error)))
            return None

    def _take(self, number: int) -> list[Metadata]:
        """Find out where everything of a file is; return what it says besides."""
        data = self._files[number]
        found = contents_of(data, number)
        self.finished &= is_finished(data)
        self.damages += found.damages
        self._chunks += found.chunks
        for each in found.channels.values():
            if not _NO_WIRE & each.metadata.keys():
                outgoing = each.metadata.get("outgoing") == "yes"
                self._channels[number, each.id] = Series(each.topic, outgoing)
        for note in found.metadata:
            if note.name == ABOUT and not self.metadata:
                self.metadata = note.metadata
        return found.metadata


_NO_WIRE = frozenset({"excerpt", "derived"})
"""Marks of channels whose messages are not as they were on the wire."""

_NOWHERE: tuple[Numbers, Numbers] = (np.empty(0, np.int64), np.empty(0, np.int64))
_NO_ENTRIES = np.empty(0, _ENTRIES)


def _gone(notes: Iterable[Metadata]) -> Gone:
    said = [(each.name, each.metadata) for each in notes]
    dropped = [int(told["count"]) for name, told in said if name == DROPPED]
    resumed = tuple(int(told["time_ns"]) for name, told in said if name == RESUMED)
    ends = [int(told["time_ns"]) for name, told in said if name == END]
    places = {name: number for number, (name, _) in enumerate(said)}
    continued = places.get(CONTINUED, -1) > places.get(ABOUT, -1)
    return Gone(max(dropped, default=0), resumed, ends[-1] if ends else None, continued)


def _by_series(
    chunks: Sequence[ChunkAt], channels: dict[tuple[int, int], Series]
) -> dict[Series, tuple[Numbers, Numbers]]:
    """Return for each series the chunks that have messages of it, and where their indexes are."""
    if not chunks:
        return {}
    sizes = [len(each.offsets) for each in chunks]
    every = np.concatenate([each.offsets for each in chunks])
    chunk = np.repeat(np.arange(len(chunks)), sizes)
    file = np.repeat([each.file for each in chunks], sizes)
    owner = file * 65_536 + every["channel"].astype(np.int64)
    order = np.lexsort((chunk, owner))
    firsts = np.flatnonzero(np.diff(owner[order], prepend=-1))
    found: dict[Series, tuple[Numbers, Numbers]] = {}
    for part in np.split(order, firsts[1:]):
        series = channels.get(divmod(int(owner[part[0]]), 65_536)) if part.size else None
        if series is not None:
            before = found.get(series, _NOWHERE)
            chunks_here = np.concatenate([before[0], chunk[part]])
            offsets_here = np.concatenate([before[1], every["offset"][part].astype(np.int64)])
            in_order = np.argsort(chunks_here, kind="stable")
            found[series] = (chunks_here[in_order], offsets_here[in_order])
    return found
