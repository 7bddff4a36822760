"""Whether somebody else has cut or overwritten a file that is still being written."""

from __future__ import annotations

from typing import IO

MOST_BYTES = 64


class LastBytes:
    """What a file ended with when that was noted last."""

    def __init__(self) -> None:
        self._at = 0
        self._bytes = b""

    def note(self, file: IO[bytes]) -> None:
        """Note what stands before where ``file`` is written."""
        end_bytes = file.tell()
        self._at = max(end_bytes - MOST_BYTES, 0)
        self._bytes = _read(file, self._at, end_bytes - self._at)

    def are_in(self, file: IO[bytes]) -> bool:
        """Say whether they still are where they were: where it is cut, they are zeros."""
        return _read(file, self._at, len(self._bytes)) == self._bytes


def _read(file: IO[bytes], at_bytes: int, count: int) -> bytes:
    """Return what stands there, and leave ``file`` where it was."""
    written_bytes = file.tell()
    file.seek(at_bytes)
    found = file.read(count)
    file.seek(written_bytes)
    return found
