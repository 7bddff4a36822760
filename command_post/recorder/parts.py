"""A recording in parts, each a whole file by itself: the next is begun before one grows too large.

What the writer keeps of a file for its index goes with the file. A part is ended with its index and
its name before the next one is begun, by the thread that writes, right after a sync: what comes
meanwhile waits.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from command_post.recorder.file import RecorderError, RecordingFile
from command_post.recorder.mirror import Mirror
from shared.mcap_index import IndexedRecording
from shared.mcap_reader import BegunFrom
from shared.mcap_records import RecordingError
from shared.recording_parts import (
    UNFINISHED,
    Link,
    files_of,
    part_number,
    part_path,
    sha256_of,
    where_part_is,
)

HASHED_AT_ONCE_BYTES = 16 << 20
"""Of a file that is gone on with so much is hashed with each sync: it is wanted at its end."""

_BLOCK_BYTES = 1 << 20


class Rotation(NamedTuple):
    """When a part is to be the last no more: once it has so many bytes, or lasts for so long."""

    most_bytes: int
    most_ns: int


class RecordingSet:
    """Files that messages are put into, by one thread; for it, one ``RecordingFile`` after another.

    Any method raises ``OSError`` when the disk does; what to do then is as with that.
    """

    def __init__(
        self,
        path: Path,
        metadata: Mapping[str, str],
        *,
        resume: bool = False,
        mirror: Mirror | None = None,
        rotation: Rotation | None = None,
    ) -> None:
        """Begin ``path``, or go on with the last part there is; without ``rotation``, in one file.

        Raises ``RecorderError`` as ``RecordingFile``, and where there are later parts.
        """
        self.first = path
        self._metadata = metadata
        self._mirror = mirror
        self._rotation = rotation
        self._digest = _Digest()
        self._begun_ns: int | None = None
        self._newest_ns = 0
        self._between = False
        """Whether a part is being ended, and the next one not begun."""

        self.number, self._dropped = _to_go_on_with(path, resume=resume)
        self._file = self._opened(self.number, self._link_to_previous, resume=resume)
        self.is_resumed = self._file.is_resumed or self.number > 1
        self.dropped_before = max(self._dropped, self._file.dropped_before)
        if self._dropped:
            self._file.mark_dropped(self._dropped)
        self._dropped = self.dropped_before

    @property
    def path(self) -> Path:
        """What the part that is written will be called."""
        return self._file.path

    @property
    def part(self) -> Path:
        """What it is called now."""
        return self._file.part

    @property
    def synced_bytes(self) -> int:
        """How much of it would survive a power cut."""
        return self._file.synced_bytes

    def put(self, key: str, payload: bytes, log_time_ns: int, *, outgoing: bool = False) -> bool:
        """Add a message, as ``RecordingFile`` does."""
        if self._begun_ns is None or log_time_ns < self._begun_ns:
            self._begun_ns = log_time_ns
        self._newest_ns = log_time_ns
        return self._file.put(key, payload, log_time_ns, outgoing=outgoing)

    def mark_end(self, now_ns: int) -> None:
        """Say that the incident was finished at ``now_ns``: no more is received."""
        self._file.mark_end(now_ns)

    def mark_dropped(self, count: int) -> None:
        """Say that so far ``count`` messages are missing."""
        self._dropped = count
        self._file.mark_dropped(count)

    def mark_resumed(
        self, now_ns: int, begun_from: BegunFrom = "all", put_aside: Sequence[str] = ()
    ) -> None:
        """Say that it had been broken off, and is gone on with since ``now_ns``."""
        self._file.mark_resumed(now_ns, begun_from, put_aside)

    def sync(self) -> None:
        """Return once all that was put in would survive a power cut."""
        self._file.sync()

    def rotate_if_due(self) -> None:
        """End the part and begin another if it is time to; to be called right after a sync."""
        if self._rotation is None:
            return
        self._digest.follow(self._file.part, self._file.synced_bytes, HASHED_AT_ONCE_BYTES)
        if self._is_due(self._rotation):
            self._file.mark_continued(part_path(self.first, self.number + 1).name)
            self._between = True
            self._file.finish()
            self._begin_next()

    def mend(self) -> int:
        """Go on, after an ``OSError``, behind what was synced last; return how many are gone."""
        if self._between and not self._file.part.exists():
            self._begin_next()
            return 0
        self._between = False
        gone = self._file.mend()
        if gone:
            self._digest, self._begun_ns = _Digest(), None
        return gone

    def finish(self) -> None:
        """End the part, which is the last."""
        self._file.finish()

    def abandon(self) -> None:
        """Leave the part unfinished, as far as it got."""
        self._file.abandon()

    def _is_due(self, rotation: Rotation) -> bool:
        if self._begun_ns is None:
            return False
        is_large = self._file.synced_bytes >= rotation.most_bytes
        return is_large or self._newest_ns - self._begun_ns >= rotation.most_ns

    def _begin_next(self) -> None:
        ended = self._file.path
        size = ended.stat().st_size
        self._digest.follow(ended, size, size)
        link = Link(self.number + 1, ended.name, size, self._digest.hexadecimal)
        try:
            self._file = self._opened(link.number, lambda: link, resume=True)
        except RecorderError as error:
            raise (error.__cause__ if isinstance(error.__cause__, OSError) else error) from None
        self.number, self._between = link.number, False
        self._digest, self._begun_ns = _Digest(), None
        if self._mirror is not None:
            self._mirror.draw_again()
        if self._dropped:
            self._file.mark_dropped(self._dropped)

    def _opened(self, number: int, link: Callable[[], Link], *, resume: bool) -> RecordingFile:
        return RecordingFile(
            part_path(self.first, number), self._metadata, resume=resume, mirror=self._mirror,
            link=link if number > 1 else None,
        )  # fmt: skip

    def _link_to_previous(self) -> Link:
        number = self.number - 1
        named, found = part_path(self.first, number), where_part_is(self.first, number)
        if found is None:
            return Link(self.number, named.name, 0, "")
        return Link(self.number, named.name, found.stat().st_size, sha256_of(found))


class _Digest:
    """The hash of a file, as far as it has been followed."""

    def __init__(self) -> None:
        self._sha256 = hashlib.sha256()
        self._at_bytes = 0

    @property
    def hexadecimal(self) -> str:
        return self._sha256.hexdigest()

    def follow(self, path: Path, end_bytes: int, most_bytes: int) -> None:
        """Take in ``path`` up to ``end_bytes``, but no more than ``most_bytes`` of it."""
        end = min(end_bytes, self._at_bytes + most_bytes)
        with path.open("rb") as file:
            file.seek(self._at_bytes)
            while block := file.read(min(end - self._at_bytes, _BLOCK_BYTES)):
                self._sha256.update(block)
                self._at_bytes += len(block)


def _to_go_on_with(path: Path, *, resume: bool) -> tuple[int, int]:
    """Return which part is to be begun or gone on with, and how many messages are missing by then.

    Raises ``RecorderError`` if there are parts that must not be touched.
    """
    if part_number(path) > 1:
        raise RecorderError(f"{path}: is a name for a later part; give the recording another name")
    number, last = max(files_of(path).items(), default=(1, None))
    if last is None or (last.name.endswith(UNFINISHED) and (resume or number == 1)):
        return number, 0
    if resume:
        with suppress(RecordingError), IndexedRecording([last]) as ended:
            if ended.gone.continued:
                return number + 1, ended.gone.dropped_count
    if number > 1:
        raise RecorderError(f"{last}: is there already; give the recording another name")
    return 1, 0
