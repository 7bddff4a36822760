"""The file of a journal: an SQLite database, whole, damaged, or removed while it is in use."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path

from shared.files import sync_folder
from shared.seal import RUN_BYTES

CHECKPOINT_PAGES = 200

_APPLICATION_ID = 0x436C6577
_VERSION = 1
_DAMAGE = frozenset({sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR})
"""What SQLite finds of a file that is no whole journal; an error in general if it lacks a table."""

_TABLES = (
    "CREATE TABLE about (run BLOB NOT NULL, acknowledged INTEGER NOT NULL,"
    " in_use INTEGER NOT NULL)",
    "CREATE TABLE message (number INTEGER PRIMARY KEY, written_ns INTEGER NOT NULL,"
    " key TEXT NOT NULL, payload BLOB NOT NULL, checksum INTEGER NOT NULL)",
)


class ForeignFileError(ValueError):
    """What is to be the journal belongs to another program. The text names it."""


class NotWholeError(Exception):
    """A file that SQLite can read is no whole journal."""


@contextmanager
def connected(path: Path) -> Iterator[sqlite3.Connection]:
    """Give a connection to the file at ``path``, made if need be, that any thread may use."""
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    try:
        yield connection
    finally:
        connection.close()


def prepare(connection: sqlite3.Connection, path: Path) -> None:
    """Make an empty file a journal; else check that it is one, whole.

    Raises ``ForeignFileError``, ``NotWholeError``, and what SQLite raises of a damaged one.
    """
    owner = connection.execute("PRAGMA application_id").fetchone()[0]
    tables = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    if tables and (owner, version) != (_APPLICATION_ID, _VERSION):
        raise ForeignFileError(f"{path}: another program's database; give another --journal")
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = FULL")
    connection.execute(f"PRAGMA wal_autocheckpoint = {CHECKPOINT_PAGES}")
    if not tables:
        _make_tables(connection)
    (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    if found != "ok":
        raise NotWholeError(found)


def _make_tables(connection: sqlite3.Connection) -> None:
    """All at once, so that a power cut leaves an empty file or a journal."""
    connection.execute("BEGIN IMMEDIATE")
    for statement in _TABLES:
        connection.execute(statement)
    connection.execute("INSERT INTO about VALUES (randomblob(?), 0, 0)", (RUN_BYTES,))
    connection.execute(f"PRAGMA application_id = {_APPLICATION_ID}")
    connection.execute(f"PRAGMA user_version = {_VERSION}")
    connection.execute("COMMIT")


def about_of(connection: sqlite3.Connection) -> tuple[bytes, int, bool]:
    """Return the run, up to which number it is acknowledged, and whether it was in use."""
    rows = connection.execute("SELECT run, acknowledged, in_use FROM about").fetchall()
    if len(rows) == 1:
        run, acknowledged, in_use = rows[0]
        if isinstance(run, bytes) and len(run) == RUN_BYTES and isinstance(acknowledged, int):
            return run, acknowledged, bool(in_use)
    raise NotWholeError("it does not say its run")


def moved_aside(path: Path) -> Path:
    """Move a damaged journal, and what SQLite keeps beside it; return where to."""
    free = (path.with_name(f"{path.name}.damaged{index}") for index in count(1))
    aside = next(each for each in free if not each.exists())
    # The file itself last: broken off before, it is found damaged again.
    for part, other in reversed(list(zip(files_of(path), files_of(aside), strict=True))):
        if part.exists():
            part.replace(other)
    return aside


def write_anew(path: Path, connection: sqlite3.Connection) -> None:
    """Write all that ``connection`` still holds, open, of a file that is not at ``path`` any more.

    What stands there by now is moved aside. The connection goes on with the old one.
    """
    anew = path.with_name(f".{path.name}.anew")
    anew.unlink(missing_ok=True)
    with connected(anew) as copy:
        connection.backup(copy)
    if any(each.exists() for each in files_of(path)):
        moved_aside(path)
    anew.replace(path)
    sync_folder(path.parent)


def files_of(path: Path) -> list[Path]:
    """Return the file and what SQLite keeps beside it while it is in use: log, index."""
    return [path.with_name(path.name + ending) for ending in ("", "-wal", "-shm")]


class Place:
    """Which file it is that stands at ``path`` now, in use."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._files = self._found()

    def is_left(self) -> bool:
        """Say whether the file has been removed or moved since, or the log of its changes."""
        return self._found() != self._files

    def _found(self) -> tuple[tuple[int, int] | None, ...]:
        main, log, _ = files_of(self._path)
        return (_identity(main), _identity(log))


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


def _code(error: sqlite3.Error) -> int:
    return getattr(error, "sqlite_errorcode", 0) & 0xFF


def is_full(error: sqlite3.Error) -> bool:
    """Say whether ``error`` is for want of room on the disk."""
    return _code(error) == sqlite3.SQLITE_FULL


def is_damage(error: Exception) -> bool:
    """Say whether ``error`` means that the file is no whole journal."""
    damaged = isinstance(error, sqlite3.DatabaseError) and _code(error) in _DAMAGE
    return damaged or isinstance(error, NotWholeError)
