"""What the post is handling, on the disk before it is handled.

What ends the process itself (a crash in machine code, no memory) leaves no exception to be put
aside, and would come again with every start. So a page of a file says what is being handled: the
kernel keeps it though the process is killed. What two starts have ended at is put aside from then
on; starts that end amid handling again and again go on from less each time (``TakingUp``).
"""

from __future__ import annotations

import mmap
from pathlib import Path

import msgspec
import structlog

from shared.files import replace_atomically

PAGE_BYTES = 4096
MOST_WHAT_BYTES = 1024
MOST_ENDS = 32
FATAL_ENDS = 2
"""What so many starts have ended at is put aside."""

_BUSY, _PROVEN, _TEXT = 0, 1, 2

_log = structlog.stdlib.get_logger(__name__)


class Ends(msgspec.Struct):
    """At what starts have ended, the last ones of all.

    ``in_row`` ended so just now, one after the other, and lasted for no time. ``put_aside`` is what
    is not to be handled any more.
    """

    at: list[str] = msgspec.field(default_factory=list)
    put_aside: list[str] = msgspec.field(default_factory=list)
    in_row: int = 0


class Handling:
    """Notes at ``path`` what is being handled; what was when a start ended is in ``ends``."""

    def __init__(self, path: Path, *, goes_on: bool) -> None:
        """Unless the recording ``goes_on``, nothing is known of earlier starts.

        Raises ``OSError`` if the file cannot be written.
        """
        self.ends = _ends_until_now(path) if goes_on else Ends()
        self.what = ""
        """What is being handled; empty between two."""

        self.count = 0
        """How much was begun."""

        self.is_live = False
        """Whether all is handled that was recorded before."""

        with replace_atomically(path) as file:
            file.write(bytes(PAGE_BYTES) + msgspec.msgpack.encode(self.ends))
        with path.open("r+b") as file:
            self._page = mmap.mmap(file.fileno(), PAGE_BYTES)

    def begin(self, what: str) -> None:
        """Note that ``what`` is handled from now on."""
        self.what = what
        self.count += 1
        text = what.encode()[:MOST_WHAT_BYTES]
        self._page[_TEXT : _TEXT + len(text) + 1] = text + b"\0"
        self._page[_BUSY] = 1

    def end(self) -> None:
        """Note that it is done."""
        self._page[_BUSY] = 0
        self.what = ""

    def prove(self) -> None:
        """Note that this start has lasted: whatever ends it is another matter."""
        self._page[_PROVEN] = 1


def handling_path(recording: Path) -> Path:
    """Return where it stands what is handled while ``recording`` is made."""
    return recording.with_name(f"{recording.name}.handling")


def _ends_until_now(path: Path) -> Ends:
    """Return at what starts have ended, the last among them."""
    try:
        data = path.read_bytes()
        ends = msgspec.msgpack.decode(data[PAGE_BYTES:], type=Ends)
        what = data[_TEXT : data.index(b"\0", _TEXT)].decode()
    except FileNotFoundError:
        return Ends()
    except (OSError, ValueError) as error:
        _log.warning("what was handled last cannot be read", file=path.name, why=str(error))
        return Ends()
    if data[_PROVEN] or not data[_BUSY]:
        ends.in_row = 0
    if not data[_BUSY]:
        return ends
    ends.at = [*ends.at, what][-MOST_ENDS:]
    ends.in_row += 1
    times = ends.at.count(what)
    if times >= FATAL_ENDS and what not in ends.put_aside:
        ends.put_aside = [*ends.put_aside, what][-MOST_ENDS:]
    _log.error(
        "the post ended amid handling",
        what=what, times=times, in_row=ends.in_row, put_aside=what in ends.put_aside,
    )  # fmt: skip
    return ends
