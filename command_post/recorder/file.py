"""The file of the record: raw wire bytes into MCAP, each key on its own channel.

What cannot be decoded is evidence too, and stands on a channel without a schema. Beside them are
channels to be looked at in Foxglove, marked ``derived``. The file is
called ``NAME.mcap.part`` until it is finished; ``shared.mcap_reader`` reads both.
"""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from importlib.metadata import version
from io import BufferedRandom
from pathlib import Path
from typing import Literal, TypeAlias

import msgspec
import structlog

from command_post.known_keys import KnownKeys
from command_post.recorder.channels import FileChannel
from command_post.recorder.declarations import Declarations
from command_post.recorder.differences import differences
from command_post.recorder.last_bytes import LastBytes
from command_post.recorder.layout import Declared, WholePart, ending_of, whole_part
from command_post.recorder.mirror import Mirror
from command_post.recorder.writer import RecordWriter
from shared.codec import Refusal, decode
from shared.files import is_at, replace_atomically, sync_folder
from shared.mcap_reader import (
    ABOUT,
    DROPPED,
    END,
    RESUMED,
    BegunFrom,
    Excerpt,
    RecordingError,
)  # fmt: skip
from shared.mcap_records import MAGIC
from shared.messages import Message
from shared.recording_parts import CONTINUED, PART, Link, unfinished_path
from shared.topics import TOPICS, WIRE_VERSION

MAX_PAYLOAD_BYTES = 1 << 20
"""What is kept of one message; far more than the codec accepts, so replay refuses it as well."""

EXCERPTS = "clew/excerpts"
"""Topic of the channel for messages that are kept in part, or away from their own key."""

MOST_TOLD = 4
"""How much is told of how two recordings differ."""

_Mode: TypeAlias = Literal["r+b", "w+b", "x+b"]

_log = structlog.stdlib.get_logger(__name__)


class RecorderError(RuntimeError):
    """A recording cannot be begun. The text says why and what to do."""


class RecordingFile:
    """An MCAP file that messages are put into, by one thread. Depends on no clock.

    Any method raises ``OSError`` when the disk does; after that, ``abandon`` the file, or ``mend``
    it and put in anew what had been put in since it was last synced.
    """

    def __init__(
        self,
        path: Path,
        metadata: Mapping[str, str],
        *,
        replace: bool = False,
        resume: bool = False,
        mirror: Mirror | None = None,
        link: Callable[[], Link] | None = None,
    ) -> None:
        """Begin ``path``; ``metadata`` says what is recorded and all that a replay needs to know.

        ``mirror``: draws what is recorded, to be looked at. ``link``: gives what a later part of a
        recording follows, once it is begun.
        With ``resume``, an unfinished recording with the same ``metadata`` is gone on with behind
        all that is whole of it. Raises ``RecorderError`` if the recording cannot be begun, is there
        already and not to be replaced, or unfinished and not to be gone on with.
        """
        self.path = path
        self.part = unfinished_path(path)
        """What it is called until it is finished."""

        self.is_resumed = False
        self.dropped_before = 0
        """How many messages were missing when it was broken off."""

        self.synced_bytes = 0
        """How much of it would survive a power cut."""

        self._declarations = Declarations(Declared())
        self._mirror = mirror
        self._link = link
        self._metadata = metadata
        self._last_bytes = LastBytes()
        self._keys = KnownKeys()
        self._is_cut = False
        self._messages = self._synced_messages = 0
        if path.exists() and not replace:
            raise RecorderError(f"{path}: is there already; give the recording another name")
        whole = self._to_be_resumed() if resume else None
        mode: _Mode = "r+b" if whole is not None else "w+b" if replace or resume else "x+b"
        self._stream = self._opened(mode)
        self._writer = RecordWriter(self._stream)
        try:
            if whole is None:
                self._begin()
            else:
                self._resume(whole)
        except OSError as error:
            self.abandon()
            raise _cannot_be_written(path, error) from error

    def _to_be_resumed(self) -> WholePart | None:
        """Return what is whole of the file; ``None`` if nothing was recorded in it yet.

        Raises ``RecorderError`` if it is not to be gone on with.
        """
        part = self.part
        if not part.exists() or part.stat().st_size < len(MAGIC):
            return None
        elsewhere = "move it, or give this recording another name"
        try:
            whole = whole_part(part)
        except RecordingError as error:
            raise RecorderError(f"{error}; {elsewhere}") from error
        if whole.about is None:
            return None
        if whole.ended:
            raise RecorderError(f"{part}: is of an incident that was ended; {elsewhere}")
        differ = differences(whole.about, self._metadata)
        if differ:
            told = "; ".join(differ[:MOST_TOLD])
            raise RecorderError(f"{part}: was begun with other settings: {told}; {elsewhere}")
        if self._link is not None and whole.follows is None:
            if whole.declared.channels:
                raise RecorderError(f"{part}: what it follows cannot be read; {elsewhere}")
            return None
        return whole

    def _opened(self, mode: _Mode) -> BufferedRandom:
        try:
            return self.part.open(mode)
        except FileExistsError:
            raise RecorderError(
                f"{self.part}: an unfinished recording; move it, or give this one another name"
            ) from None
        except OSError as error:
            raise _cannot_be_written(self.path, error) from error

    def _begin(self) -> None:
        software = {"software_version": version("clew"), "wire_version": WIRE_VERSION}
        self._writer.start(f"clew {version('clew')}")
        self._writer.add_metadata(ABOUT, {**self._metadata, **software})
        if self._link is not None:
            self._writer.add_metadata(PART, self._link().as_metadata())
        self.sync()

    def _resume(self, whole: WholePart) -> None:
        self.dropped_before = whole.dropped_count
        self._declarations = Declarations(whole.declared.without_gaps())
        self._go_on_at(whole.end_bytes)
        for message in whole.unindexed:
            self._writer.add_message(
                message.channel_id, message.log_time, message.data, message.publish_time,
                message.sequence,
            )  # fmt: skip
        if whole.dropped_count:
            self.mark_dropped(whole.dropped_count)
        self.sync()

    def _go_on_at(self, end_bytes: int) -> None:
        """Cut the file off there, and have what follows declare all channels once more."""
        self._stream.truncate(end_bytes)
        self._stream.seek(end_bytes)
        self._writer = RecordWriter(self._stream)
        self._declarations.declare_again(self._writer)
        self.is_resumed = True

    def mend(self) -> int:
        """Go on, after an ``OSError``, behind what was synced last.

        Where that has been cut by somebody else, another file is begun: return how many messages
        were in the one before. Raises ``OSError`` as long as that is not possible, and can be
        called again then.
        """
        self.abandon()
        if self._is_cut:
            return self._begin_anew()
        self._stream = self.part.open("r+b")
        self._go_on_at(self.synced_bytes)
        self._declarations.tell_again(self._writer, beyond=self._synced_channels)
        return 0

    def _begin_anew(self) -> int:
        """Put what is left of the file aside, for whoever can read it, and begin it once more."""
        aside = self.part.with_name(f"{self.part.name}.cut")
        if not aside.exists():
            self.part.replace(aside)
        self._stream = self.part.open("w+b")
        self._writer = RecordWriter(self._stream)
        self._declarations = Declarations(Declared())
        self.is_resumed, gone = False, self._synced_messages
        self._last_bytes = LastBytes()
        self._begin()
        self._is_cut, self._messages, self._synced_messages = False, 0, 0
        if self._mirror is not None:
            self._mirror.draw_again()
        _log.error(
            "somebody has cut the recording: another is begun", file=str(self.part), gone=gone,
            what_is_left=str(aside),
        )  # fmt: skip
        return gone

    def put(self, key: str, payload: bytes, log_time_ns: int, *, outgoing: bool = False) -> bool:
        """Add a message that was received at ``log_time_ns``, or made then (``outgoing``).

        It is passed over if its topic is one that is not to be recorded. Whatever is not taken
        raises.
        """
        parsed = self._keys.parsed(key)
        if not isinstance(parsed, Refusal) and not TOPICS[parsed.topic].recorded:
            return True
        message = parsed if isinstance(parsed, Refusal) else decode(parsed, payload)
        schema = None if isinstance(message, Refusal) else type(message).__name__
        channel = FileChannel(key, schema, outgoing)
        if len(payload) > MAX_PAYLOAD_BYTES or not self._declarations.has_place(channel):
            channel = FileChannel(EXCERPTS, None, outgoing, excerpt=True)
            payload = _excerpt(key, payload)
        self._writer.add_message(
            self._declarations.number_of(channel, self._writer),
            log_time=log_time_ns,
            data=payload,
            publish_time=log_time_ns if isinstance(message, Refusal) else message.event_time_ns,
            sequence=0 if isinstance(message, Refusal) else message.sequence % (1 << 32),
        )
        self._messages += 1
        if not (isinstance(parsed, Refusal) or isinstance(message, Refusal)):
            self._draw(parsed.node_id, message, log_time_ns, outgoing=outgoing)
        return True

    def mark_end(self, now_ns: int) -> None:
        """Say that the incident was finished at ``now_ns``: no more is received."""
        self._writer.add_metadata(END, {"time_ns": str(now_ns)})

    def mark_dropped(self, count: int) -> None:
        """Say that so far ``count`` messages are missing."""
        self._writer.add_metadata(DROPPED, {"count": str(count)})

    def mark_resumed(
        self, now_ns: int, begun_from: BegunFrom = "all", put_aside: Sequence[str] = ()
    ) -> None:
        """Say that it had been broken off, and is gone on with since ``now_ns``, from what.

        What is ``put_aside`` is not handled, and was not before.
        """
        told = {"time_ns": str(now_ns), "begun_from": begun_from, "put_aside": "\n".join(put_aside)}
        self._writer.add_metadata(RESUMED, told)

    def mark_continued(self, following: str) -> None:
        """Say that this is not the last part: one called ``following`` comes next."""
        self._writer.add_metadata(CONTINUED, {"next": following})

    def sync(self) -> None:
        """Return once all that was put in would survive a power cut."""
        self._writer.flush()
        if not self._last_bytes.are_in(self._stream):
            self._is_cut = True
            raise OSError(errno.EIO, "somebody else has cut or overwritten it", str(self.part))
        os.fsync(self._stream.fileno())
        if not is_at(self.part, self._stream):
            self._put_back()
        self.synced_bytes = self._stream.tell()
        self._last_bytes.note(self._stream)
        self._synced_channels = self._declarations.count
        self._synced_messages = self._messages

    def _put_back(self) -> None:
        """Write anew what somebody has removed or moved: it is still open here."""
        end_bytes = self._stream.tell()
        self._stream.seek(0)
        with replace_atomically(self.part) as anew:
            shutil.copyfileobj(self._stream, anew)
        self._stream.close()
        self._stream = self.part.open("r+b")
        self._go_on_at(end_bytes)
        _log.error("the recording was removed: it is written anew", file=str(self.part))

    def finish(self) -> None:
        """End the file with its index, and give it its name."""
        if self._mirror is not None:
            self._write_drawn(self._mirror)
        self.sync()
        declared = self._declarations.declared
        # The writer knows of what it has written itself.
        told = ending_of(self.part, declared) if self.is_resumed else self._writer.ending(declared)
        self._stream.write(told)
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._stream.close()
        self.part.replace(self.path)
        sync_folder(self.path.parent)

    def abandon(self) -> None:
        """Leave the file unfinished, as far as it got, under its ``.part`` name."""
        # Closing tries once more to write what could not be written; that has been told.
        with suppress(OSError):
            self._stream.close()

    def discard(self) -> None:
        """Leave nothing of the file."""
        self.abandon()
        self.part.unlink(missing_ok=True)

    def _draw(self, node_id: str, message: Message, time_ns: int, *, outgoing: bool) -> None:
        if self._mirror is not None:
            self._mirror.take(node_id, message, time_ns, outgoing=outgoing)
            if self._mirror.is_due:
                self._write_drawn(self._mirror)

    def _write_drawn(self, mirror: Mirror) -> None:
        """Write a chunk of what is only to be looked at."""
        self._writer.flush()
        for drawn in mirror.take_all():
            channel = FileChannel(drawn.topic, drawn.schema, outgoing=False, derived=True)
            if self._declarations.has_place(channel):
                number = self._declarations.number_of(channel, self._writer, drawn)
                self._writer.add_message(number, drawn.time_ns, drawn.data, drawn.time_ns)
        self._writer.flush()


def _cannot_be_written(path: Path, error: OSError) -> RecorderError:
    return RecorderError(f"{path}: cannot be written ({error.strerror}); record somewhere else")


def _excerpt(key: str, payload: bytes) -> bytes:
    digest = hashlib.sha256(payload).hexdigest()
    kept = payload[:MAX_PAYLOAD_BYTES]
    return msgspec.msgpack.encode(Excerpt(key, kept, len(payload), digest))
