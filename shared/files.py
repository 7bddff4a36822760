"""Files that others read are whole or absent: written beside their place, then moved into it."""

from __future__ import annotations

import os
import secrets
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, BinaryIO

if sys.platform != "win32":
    import fcntl


class FolderHeldError(RuntimeError):
    """A folder is in use. The text names it."""


class FileHeldError(RuntimeError):
    """A file is in use. The text names it."""


@contextmanager
def replace_atomically(path: Path) -> Iterator[BinaryIO]:
    """Open a new file that takes the place of ``path`` when the block ends without an error.

    Until then, and after an error, ``path`` is as it was: a reader sees the old file or the whole
    new one, even after a power failure. The folder of ``path`` must exist. A program that is
    killed inside the block leaves a hidden ``.NAME.XXXXXXXX.part`` behind.
    """
    part = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with part.open("xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


@contextmanager
def held_alone(folder: Path) -> Iterator[None]:
    """Hold ``folder`` for this process; it must exist. Raises ``FolderHeldError`` if one does.

    However the process ends, it holds the folder no longer: the hidden ``.held`` that stays in it
    means nothing. Where files cannot be locked (Windows), nobody is kept out.
    """
    with _locked(folder / ".held") as is_free:
        if not is_free:
            raise FolderHeldError(f"{folder}: another process is at work there")
        yield


@contextmanager
def file_held_alone(path: Path) -> Iterator[None]:
    """Hold ``path``, which need not exist, for this process, as ``held_alone`` does a folder.

    Raises ``FileHeldError`` if another process does, or if there is no folder for it. A hidden
    ``.NAME.held`` stays.
    """
    if not path.parent.is_dir():
        raise FileHeldError(f"{path.parent}: no such folder; make it, or give another")
    with _locked(path.with_name(f".{path.name}.held")) as is_free:
        if not is_free:
            raise FileHeldError(f"{path}: another process has it")
        yield


@contextmanager
def _locked(path: Path) -> Iterator[bool]:
    """Lock the file at ``path`` until the end of the block; say whether nobody else has."""
    if sys.platform == "win32":
        yield True
        return
    with path.open("wb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        yield True


def is_at(path: Path, file: IO[bytes]) -> bool:
    """Say whether ``file``, which is open, is the one at ``path``: nobody has removed it."""
    try:
        return os.path.samestat(path.stat(), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False


def sync_folder(folder: Path) -> None:
    """Have the move itself survive a power failure, where folders can be opened (not Windows)."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
