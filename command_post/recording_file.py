"""The file of the record: raw wire bytes into MCAP, each key on its own channel.

What cannot be decoded is evidence too, and stands on a channel without a schema. The file is
called ``NAME.mcap.part`` until it is finished; ``shared.mcap_reader`` reads both.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import msgspec
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import Writer

from shared.codec import Refusal, decode, parse_key
from shared.files import sync_folder
from shared.mcap_reader import ABOUT, CHANNEL, DROPPED, END, Excerpt
from shared.messages import Message
from shared.topics import TOPICS, WIRE_VERSION

CHUNK_BYTES = 1 << 18
"""A chunk is closed when it holds this much, so that rare topics are quick to read."""

MAX_CHANNELS = 4096
"""Messages under further keys are kept as excerpts: made-up keys must not exhaust the format."""

MAX_PAYLOAD_BYTES = 1 << 20
"""What is kept of one message; far more than the codec accepts, so replay refuses it as well."""

EXCERPTS = "clew/excerpts"
"""Topic of the channel for messages that are kept in part, or away from their own key."""

_NO_SCHEMA = 0


class RecorderError(RuntimeError):
    """A recording cannot be begun. The text says why and what to do."""


class RecordingFile:
    """An MCAP file that messages are put into, by one thread. Depends on no clock.

    Any method raises ``OSError`` when the disk does; after that, only ``abandon`` it.
    """

    def __init__(self, path: Path, metadata: Mapping[str, str], *, replace: bool = False) -> None:
        """Begin ``path``; ``metadata`` says what is recorded and all that a replay needs to know.

        Raises ``RecorderError`` if it cannot be begun, or is there already and not to be replaced.
        """
        self.path = path
        self._part = path.with_name(f"{path.name}.part")
        self._channels: dict[_Channel, int] = {}
        self._schemas: dict[str, int] = {}
        if path.exists() and not replace:
            raise RecorderError(f"{path}: is there already; give the recording another name")
        try:
            self._stream = self._part.open("wb" if replace else "xb")
        except FileExistsError:
            raise RecorderError(
                f"{self._part}: an unfinished recording; move it, or give this one another name"
            ) from None
        except OSError as error:
            raise _cannot_be_written(path, error) from error
        self._writer = Writer(self._stream, chunk_size=CHUNK_BYTES, enable_data_crcs=True)
        try:
            self._begin(metadata)
        except OSError as error:
            self.abandon()
            raise _cannot_be_written(path, error) from error

    def _begin(self, metadata: Mapping[str, str]) -> None:
        software = {"software_version": version("clew"), "wire_version": WIRE_VERSION}
        self._writer.start(library=f"clew {version('clew')}")
        self._writer.add_metadata(ABOUT, {**metadata, **software})
        self.sync()

    def put(self, key: str, payload: bytes, log_time_ns: int, *, outgoing: bool = False) -> None:
        """Add a message that was received at ``log_time_ns``, or made then (``outgoing``).

        It is passed over if its topic is one that is not to be recorded.
        """
        parsed = parse_key(key)
        if not isinstance(parsed, Refusal) and not TOPICS[parsed.topic].recorded:
            return
        message = parsed if isinstance(parsed, Refusal) else decode(parsed, payload)
        schema = None if isinstance(message, Refusal) else type(message)
        channel = _Channel(key, schema, outgoing)
        if len(payload) > MAX_PAYLOAD_BYTES or not self._has_place(channel):
            channel = _Channel(EXCERPTS, None, outgoing, excerpt=True)
            payload = _excerpt(key, payload)
        self._writer.add_message(
            self._channel_id(channel),
            log_time=log_time_ns,
            data=payload,
            publish_time=log_time_ns if isinstance(message, Refusal) else message.event_time_ns,
            sequence=0 if isinstance(message, Refusal) else message.sequence % (1 << 32),
        )

    def mark_end(self, now_ns: int) -> None:
        """Say that the incident was finished at ``now_ns``: no more is received."""
        self._writer.add_metadata(END, {"time_ns": str(now_ns)})

    def mark_dropped(self, count: int) -> None:
        """Say that so far ``count`` messages are missing."""
        self._writer.add_metadata(DROPPED, {"count": str(count)})

    def sync(self) -> None:
        """Return once all that was put in would survive a power cut."""
        self._writer.flush()
        os.fsync(self._stream.fileno())

    def finish(self) -> None:
        """End the file with its index, and give it its name."""
        self._writer.finish()
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._stream.close()
        self._part.replace(self.path)
        sync_folder(self.path.parent)

    def abandon(self) -> None:
        """Leave the file unfinished, as far as it got, under its ``.part`` name."""
        # Closing tries once more to write what could not be written; that has been told.
        with suppress(OSError):
            self._stream.close()

    def discard(self) -> None:
        """Leave nothing of the file."""
        self.abandon()
        self._part.unlink(missing_ok=True)

    def _has_place(self, channel: _Channel) -> bool:
        return channel in self._channels or len(self._channels) < MAX_CHANNELS

    def _channel_id(self, channel: _Channel) -> int:
        if channel not in self._channels:
            marks = {"outgoing": channel.outgoing, "excerpt": channel.excerpt}
            metadata = {name: "yes" for name, applies in marks.items() if applies}
            number = self._writer.register_channel(
                channel.topic,
                MessageEncoding.MessagePack if channel.schema or channel.excerpt else "",
                self._schema_id(channel.schema) if channel.schema else _NO_SCHEMA,
                metadata,
            )
            self._writer.add_metadata(
                CHANNEL, {"id": str(number), "topic": channel.topic, **metadata}
            )
            self._channels[channel] = number
        return self._channels[channel]

    def _schema_id(self, message: type[Message]) -> int:
        name = message.__name__
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(
                name, SchemaEncoding.JSONSchema, json_schema(message)
            )
        return self._schemas[name]


def _cannot_be_written(path: Path, error: OSError) -> RecorderError:
    return RecorderError(f"{path}: cannot be written ({error.strerror}); record somewhere else")


class _Channel(NamedTuple):
    topic: str
    schema: type[Message] | None
    outgoing: bool
    excerpt: bool = False


def json_schema(message: type[Message]) -> bytes:
    """Return the JSON Schema of what ``message`` decodes to: one object, self-contained."""
    _, parts = msgspec.json.schema_components([message], ref_template="#/$defs/{name}")
    root = parts.pop(message.__name__)
    dialect = "https://json-schema.org/draft/2020-12/schema"
    return msgspec.json.encode({"$schema": dialect, **root, "$defs": parts}, order="sorted")


def _excerpt(key: str, payload: bytes) -> bytes:
    digest = hashlib.sha256(payload).hexdigest()
    kept = payload[:MAX_PAYLOAD_BYTES]
    return msgspec.msgpack.encode(Excerpt(key, kept, len(payload), digest))
