"""A file in the place of the network: what a node would have published, and when.

The file begins with ``CLEWLOG1``. A frame is ``time_ns`` (8 bytes), the lengths of key (2) and
payload (4), all little-endian, then key and payload. Behind the last frame stands one with empty
key and payload that has the number of frames for its time: without it the file was cut off.
"""

# ruff: noqa: ARG002  what would be said to others, or to their callers, goes unused here

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, NamedTuple, Self

from shared.bus.interface import (
    AliveHandler,
    Answerer,
    BusClosedError,
    Handler,
    LinkHandler,
    Received,
    Wanted,
)
from shared.bus.key_expression import check_key
from shared.clock import Clock
from shared.codec import MAX_PAYLOAD_BYTES
from shared.files import replace_atomically
from shared.topics import Priority

_MAGIC = b"CLEWLOG1"
_HEADER = struct.Struct("<QHI")


class WireFrame(NamedTuple):
    """One message as it was published at ``time_ns`` of the node's clock."""

    time_ns: int
    key: str
    payload: bytes


class WireLogError(ValueError):
    """A wire log is cut off, damaged, or none at all. The text says which file, and where."""


class WireLogBus:
    """A ``Bus`` of one who is alone and keeps a diary.

    What is published is appended to the file at ``path``, with the time on ``clock``. Nobody
    else is there: nothing is ever heard, queries find nobody, no token comes or goes. The file
    appears, whole, when the bus is closed; leaving a ``with`` block by an error discards it.
    """

    def __init__(self, path: Path, clock: Clock) -> None:
        self._clock = clock
        self._frames = 0
        self._open = ExitStack()
        self._file: BinaryIO | None = self._open.enter_context(replace_atomically(path))
        self._file.write(_MAGIC)

    def publish(self, key: str, payload: bytes, priority: Priority = "data") -> None:
        """Append a frame; nothing once closed.

        Raises ``ValueError`` for a malformed key, or a payload no receiver would accept.
        """
        name = check_key(key).encode()
        if len(payload) > MAX_PAYLOAD_BYTES:
            raise ValueError(f"{key}: {len(payload)} bytes, the limit is {MAX_PAYLOAD_BYTES}")
        if self._file is not None:
            self._file.write(_HEADER.pack(self._clock.now_ns(), len(name), len(payload)))
            self._file.write(name)
            self._file.write(payload)
            self._frames += 1

    def subscribe(
        self, key_expression: str, handler: Handler, wanted: Wanted | None = None
    ) -> None:
        """Nobody publishes: ``handler`` is never called."""
        self._refuse_if_closed()

    def answer(self, key: str, answerer: Answerer) -> None:
        """Nobody asks: ``answerer`` is never called."""
        self._refuse_if_closed()

    def query(self, key_expression: str, timeout_s: float, request: bytes = b"") -> list[Received]:
        """Nobody answers: return nothing, at once."""
        return []

    def ask_no_more(self) -> None:
        """Nobody was asked."""

    def on_link(self, handler: LinkHandler) -> None:
        """No link ever comes: ``handler`` is never called."""

    def declare_alive(self, key: str) -> None:
        """Nobody watches."""
        self._refuse_if_closed()

    def watch_alive(self, key_expression: str, handler: AliveHandler) -> None:
        """Nobody else is alive: ``handler`` is never called."""
        self._refuse_if_closed()

    def close(self) -> None:
        """Write the end and let the file appear. Closing twice is harmless."""
        file, self._file = self._file, None
        if file is not None:
            file.write(_HEADER.pack(self._frames, 0, 0))
            self._open.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.close()
        else:
            self._file = None
            self._open.__exit__(kind, error, trace)

    def _refuse_if_closed(self) -> None:
        if self._file is None:
            raise BusClosedError("nothing can be declared, the wire log is closed")


def read_wire_log(path: Path) -> Iterator[WireFrame]:
    """Yield the frames of a wire log in the order they were published.

    Where the file is cut off or damaged, all whole frames before that place are yielded, and then
    ``WireLogError`` is raised: whoever can do with less catches it, nobody takes less for all.
    Raises ``OSError`` if the file cannot be read.
    """
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise WireLogError(f"{path}: not a wire log")
        frames = 0
        while (frame := _read_frame(file, path, frames)).key:
            yield frame
            frames += 1
        if frame.time_ns != frames or file.read(1):
            raise WireLogError(f"{path}: damaged, its end is not after frame {frames}")


def _read_frame(file: BinaryIO, path: Path, frames: int) -> WireFrame:
    """Read one frame, or the end, whose key is empty."""
    header = file.read(_HEADER.size)
    if len(header) < _HEADER.size:
        raise WireLogError(f"{path}: cut off after {frames} whole frames")
    time_ns, key_bytes, payload_bytes = _HEADER.unpack(header)
    if payload_bytes > MAX_PAYLOAD_BYTES:
        raise WireLogError(f"{path}: damaged after {frames} whole frames")
    body = file.read(key_bytes + payload_bytes)
    if len(body) < key_bytes + payload_bytes:
        raise WireLogError(f"{path}: cut off after {frames} whole frames")
    try:
        return WireFrame(time_ns, body[:key_bytes].decode(), body[key_bytes:])
    except UnicodeDecodeError:
        raise WireLogError(f"{path}: damaged after {frames} whole frames") from None
