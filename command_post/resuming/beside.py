"""A file kept beside a recording, of which it holds as far as some place: whole, or of no use."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec
import structlog

from command_post.recorder.recording import Recorder
from shared.files import replace_atomically
from shared.recording_parts import where_part_is

Made = TypeVar("Made")

TAIL_BYTES = 1 << 16
"""What stands before its place in a recording shows that it is of that recording."""

_log = structlog.stdlib.get_logger(__name__)


class Place(NamedTuple):
    """How far into which part of a recording something holds."""

    position_bytes: int
    part: int


BEGINNING = Place(0, 1)


class _File(msgspec.Struct):
    software: str
    part: int
    position_bytes: int
    tail_sha256: str
    content_sha256: str
    content: bytes


def before_path(path: Path) -> Path:
    """Return where the file is that was kept before the one at ``path``."""
    return path.with_name(f"{path.name}.before")


def keep_beside(
    path: Path, software: str, content: bytes, recorder: Recorder, position_bytes: int
) -> None:
    """Keep ``content``, as of that position, in place of what is at ``path``, which stays beside.

    To be called on the recorder's thread. Raises ``OSError``.
    """
    tail = _tail_of(recorder.part, position_bytes)
    part, digest = recorder.part_number, sha256_hex(content)
    file = _File(software, part, position_bytes, tail, digest, content)
    if path.exists():
        path.replace(before_path(path))
    with replace_atomically(path) as stream:
        os.fchmod(stream.fileno(), 0o600)
        stream.write(msgspec.msgpack.encode(file))


def kept_beside(path: Path, software: str, recording: Path) -> tuple[bytes, Place]:
    """Return what ``software`` kept at ``path``, and how far into ``recording`` it holds.

    Raises ``ValueError`` (also ``msgspec.DecodeError``) if it is of no use, ``OSError`` if it
    cannot be read. Only what this user has written is looked at.
    """
    if path.stat().st_uid != os.geteuid():
        raise ValueError("it is not this user's")
    file = msgspec.msgpack.decode(path.read_bytes(), type=_File)
    if file.software != software:
        raise ValueError("other software has written it")
    if file.content_sha256 != sha256_hex(file.content):
        raise ValueError("it is damaged")
    part = where_part_is(recording, file.part)
    if part is None or file.tail_sha256 != _tail_of(part, file.position_bytes):
        raise ValueError("it is of another recording")
    return file.content, Place(file.position_bytes, file.part)


def of_use(path: Path, what: str, load: Callable[[Path], Made]) -> Iterator[Made]:
    """Yield what ``load`` makes of the file at ``path``, then of the one kept before it.

    Of one that is of no use it is told why, and of ``what``.
    """
    for each in (path, before_path(path)):
        try:
            made = load(each)
        except FileNotFoundError:
            continue
        except Exception as error:
            # Whatever is wrong with it, it can be done without.
            words = str(error) or type(error).__name__
            _log.warning(f"{what} is of no use", file=each.name, why=words)
            continue
        yield made


def _tail_of(recording: Path, end_bytes: int) -> str:
    with recording.open("rb") as file:
        file.seek(max(end_bytes - TAIL_BYTES, 0))
        tail = file.read(min(end_bytes, TAIL_BYTES))
    return sha256_hex(tail)


def sha256_hex(data: bytes) -> str:
    """Return the SHA-256 of ``data``, hexadecimal."""
    return hashlib.sha256(data).hexdigest()
