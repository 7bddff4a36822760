"""A recording is written in the bytes that the MCAP library makes of the same, to the last one."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from mcap.records import Channel, Schema
from mcap.writer import Writer

from command_post.recorder.layout import Declared
from command_post.recorder.writer import CHUNK_BYTES, RecordWriter

MESSAGES = 3000


def write(writer: Writer | RecordWriter) -> None:
    """Write three channels' messages, enough for several chunks, some of them closed early."""
    chance = np.random.default_rng(5)
    writer.add_metadata("about", {"what": "a test", "by": "nobody"})
    writer.register_schema("One", "jsonschema", b"{}")
    for number in range(1, 4):
        writer.register_channel(f"topic/{number}", "msgpack", number % 2, {"outgoing": "yes"})
    for k in range(MESSAGES):
        data = chance.bytes(int(chance.integers(0, 600)))
        time_ns = int(chance.integers(0, 1 << 62))
        writer.add_message(int(chance.integers(1, 4)), time_ns, data, time_ns // 2, k)
        if k in {10, 11, 2000}:
            writer.flush()
            writer.flush()
            writer.add_metadata("dropped", {"count": str(k)})


def test_it_makes_the_bytes_that_the_library_makes(tmp_path: Path) -> None:
    by_library, own = tmp_path / "library.mcap", tmp_path / "own.mcap"
    with by_library.open("wb") as stream:
        library = Writer(stream, chunk_size=CHUNK_BYTES, enable_data_crcs=True)
        library.start(library="clew test")
        write(library)
        library.finish()
    with own.open("wb") as stream:
        writer = RecordWriter(stream)
        writer.start("clew test")
        write(writer)
        writer.flush()
        marks = {"outgoing": "yes"}
        channels = {n: Channel(n, f"topic/{n}", "msgpack", marks, n % 2) for n in range(1, 4)}
        stream.write(writer.ending(Declared({1: Schema(1, b"{}", "jsonschema", "One")}, channels)))
    assert own.stat().st_size > 2 * CHUNK_BYTES
    assert own.read_bytes() == by_library.read_bytes()


def test_of_a_message_that_cannot_be_held_nothing_is_written(tmp_path: Path) -> None:
    found = []
    for name, tried in (("with", True), ("without", False)):
        path = tmp_path / name
        with path.open("wb") as stream:
            writer = RecordWriter(stream)
            writer.register_channel("topic", "msgpack", 0, {})
            writer.add_message(1, 1, b"one", 1)
            if tried:
                with pytest.raises(struct.error):
                    writer.add_message(1, -1, b"never", 1)
            writer.add_message(1, 2, b"two", 2)
            writer.flush()
        found.append(path.read_bytes())
    assert found[0] == found[1]
