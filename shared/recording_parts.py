"""The parts of a recording: several files of one incident, each of them whole by itself.

``NAME.mcap`` is followed by ``NAME.part002.mcap``, ``NAME.part003.mcap`` and so on; the one that is
being written has ``.part`` at its end. Each says which one it follows, and the hash of its bytes;
each but the last says that there is another. Whoever reads the first, or their folder, reads all.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from contextlib import suppress
from glob import escape
from pathlib import Path
from typing import NamedTuple

from mcap.records import Chunk, Metadata

from shared.mcap_records import RecordingError, RecordScan, mapped

PART = "clew.part"
"""Name of the metadata that says which part of a recording a file is, and what it follows."""

CONTINUED = "clew.continued"
"""Name of the metadata that says that another part follows."""

UNFINISHED = ".part"
_NUMBERED = re.compile(r"(?P<stem>.+)\.part(?P<number>\d{3,})")
_SUFFIX = ".mcap"
_BLOCK_BYTES = 1 << 20


class Link(NamedTuple):
    """Which part a file is, and the name, the size and the hash of the one before it."""

    number: int
    previous: str
    previous_bytes: int
    previous_sha256: str

    def as_metadata(self) -> dict[str, str]:
        """Return it as it stands in the file."""
        return {name: str(value) for name, value in self._asdict().items()}


class Part(NamedTuple):
    """A file of a recording; the first one of all follows none."""

    path: Path
    number: int
    link: Link | None


def parts_of(path: Path) -> list[Part]:
    """Return the parts of the recording that begins at ``path``, in their order.

    ``path`` may be their folder, or a later part, which is read from there on. Raises
    ``RecordingError`` if it is no MCAP file, or a folder without just one recording.
    """
    begin = _first_in(path) if path.is_dir() else path
    if not begin.exists():
        # It may have been finished meanwhile.
        begin = where_part_is(begin, part_number(begin)) or begin
    number = part_number(begin)
    link = _link_of(begin) if number > 1 else None
    if number > 1 and link is None:
        # A name like that of a part says nothing.
        return [Part(begin, 1, None)]
    parts = [Part(begin, number, link)]
    for each, file in _later(begin).items():
        if each > number:
            # One that was killed as it was begun says nothing yet, and has nothing.
            with suppress(RecordingError):
                link = _link_of(file)
                parts += [Part(file, each, link)] if link and link.number == each else []
    return parts


def part_number(path: Path) -> int:
    """Return which part a file is by its name."""
    numbered = _NUMBERED.fullmatch(_stem(path))
    return int(numbered["number"]) if numbered else 1


def part_path(path: Path, number: int) -> Path:
    """Return what part ``number`` is called, of whose recording ``path`` is any part."""
    numbered = _NUMBERED.fullmatch(_stem(path))
    stem = numbered["stem"] if numbered else _stem(path)
    ending = _SUFFIX if path.name.removesuffix(UNFINISHED).endswith(_SUFFIX) else ""
    return path.with_name(f"{stem}{f'.part{number:03d}' if number > 1 else ''}{ending}")


def unfinished_path(path: Path) -> Path:
    """Return what ``path`` is called until it is finished."""
    return path.with_name(f"{path.name}{UNFINISHED}")


def where_part_is(path: Path, number: int) -> Path | None:
    """Return part ``number`` as it is called now; ``None`` if there is none."""
    named = part_path(path, number)
    return next((each for each in (named, unfinished_path(named)) if each.exists()), None)


def files_of(path: Path) -> dict[int, Path]:
    """Return all files that are called like a part of the recording at ``path``, by number."""
    first = where_part_is(path, 1)
    return ({} if first is None else {1: first}) | _later(path)


def sha256_of(path: Path) -> str:
    """Return the hash of a file, hexadecimal. Raises ``OSError``."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_BLOCK_BYTES):
            digest.update(block)
    return digest.hexdigest()


def _later(path: Path) -> dict[int, Path]:
    """Return the files that are called like the second part, or a later one."""
    first = part_path(path, 1)
    found: dict[int, Path] = {}
    for each in sorted(first.parent.glob(f"{escape(_stem(first))}.part*")):
        named = each.with_name(each.name.removesuffix(UNFINISHED))
        number = part_number(named)
        if number > 1 and part_path(first, number) == named:
            # A finished one comes first in order, and counts.
            found.setdefault(number, each)
    return dict(sorted(found.items()))


def _stem(path: Path) -> str:
    return path.name.removesuffix(UNFINISHED).removesuffix(_SUFFIX)


def _first_in(folder: Path) -> Path:
    ending = f"{_SUFFIX}{UNFINISHED}"
    files = sorted(
        each for each in folder.iterdir()
        if each.name.endswith((_SUFFIX, ending)) and not each.name.startswith(".")
    )  # fmt: skip
    first = [each for each in files if part_number(each) == 1]
    if len(first) != 1:
        names = ", ".join(each.name for each in first[:4])
        said = f"has several recordings ({names})" if first else "has no recording"
        raise RecordingError(f"{folder}: {said}; name the first file of one")
    return first[0]


def _link_of(path: Path) -> Link | None:
    """Return what a file says that it follows; it stands before its first chunk."""
    for told in _beginning(path):
        if told.name == PART:
            values = told.metadata
            try:
                return Link(
                    int(values["number"]), values["previous"], int(values["previous_bytes"]),
                    values["previous_sha256"],
                )  # fmt: skip
            except (KeyError, ValueError):
                return None
    return None


def _beginning(path: Path) -> Iterator[Metadata]:
    with mapped(path) as data:
        for record, _, _ in RecordScan(data).placed():
            if isinstance(record, Chunk):
                return
            if isinstance(record, Metadata):
                yield record
