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
    part = _part_of(path)
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


def check_can_write(path: Path | None, option: str) -> None:
    """Raise ``ValueError`` if there can be no file at ``path``, which ``option`` gives.

    That is for before a long work whose result is to go there.
    """
    if path is None:
        return
    if path.is_dir():
        raise ValueError(f"{option} {path}: is a folder; give a file's name in it")
    part = _part_of(path)
    try:
        part.open("xb").close()
        part.unlink()
    except OSError as error:
        raise ValueError(
            f"{option} {path}: cannot be written ({error.strerror}); give another"
        ) from None


def _part_of(path: Path) -> Path:
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")


HOLDING = ".held"
"""What stays, hidden, in a folder that a process has held."""


@contextmanager
def held_alone(folder: Path) -> Iterator[None]:
    """Hold ``folder`` for this process; it must exist. Raises ``FolderHeldError`` if one does.

    However the process ends, it holds the folder no longer: the ``HOLDING`` that stays in it only
    tells that one did. Where files cannot be locked (Windows), nobody is kept out.
    """
    with _locked(folder / HOLDING) as is_free:
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
