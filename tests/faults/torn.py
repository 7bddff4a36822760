"""A power cut at every byte that a journal writes, or a recording where a part of it ends.

``python -m tests.faults.torn`` has a journal write a message, and then have its log of changes
written into its file; puts on the disk each of them as far as any byte, and opens the journal. What
was said before must all be there, in the same run, and it must say that it was broken off. It
prints as JSON how many cuts there were, and what was not so. A recording is cut at every byte of
the end of a part and of the beginning of the next, and gone on with.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar, NamedTuple

from structlog.testing import capture_logs

from command_post.recorder.parts import RecordingSet, Rotation
from command_post.recorder.verification import verify_recording
from shared.journal import Journal
from shared.mcap_reader import read_recording
from shared.recording_parts import files_of, part_path, unfinished_path

KEY = "clew/v1/fire/responder/r1/increment"
SAID_BEFORE = 12
IN_MEMORY = Path("/dev/shm")  # noqa: S108
"""A disk has nothing to do with it, and takes long."""


class OnDisk(NamedTuple):
    """A journal's file and its log of changes."""

    file: bytes
    changes: bytes


class Torn(NamedTuple):
    """What a journal says that was broken off there."""

    run: bytes
    numbers: list[int]
    says_so: bool


class Torture:
    """A journal that wrote message 13 after 12, and then its changes into its file."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "r1"
        journal = Journal(self.path)
        self.run = journal.run
        for _ in range(SAID_BEFORE):
            journal.append(KEY, _said)
        self._before = self._on_disk()
        journal.append(KEY, _said)
        self._after = self._on_disk()
        journal._checkpoint()
        self._written_back = self._on_disk()
        journal.close()

    def appends(self, step: int) -> Iterator[OnDisk]:
        """Yield what the disk has while a message is appended, every ``step`` bytes."""
        file, changes = self._after
        first = len(self._before.changes)
        for cut in sorted({*range(first, len(changes), step), first + 1, len(changes) - 1}):
            yield OnDisk(file, changes[:cut])

    def writes_back(self, step: int) -> Iterator[OnDisk]:
        """Yield what it has while the changes are written into the file."""
        before, after = self._after.file, self._written_back.file
        first = next(at for at in range(len(after)) if after[at : at + 1] != before[at : at + 1])
        for cut in sorted({*range(first, len(after), step), len(after) - 1}):
            yield OnDisk(after[:cut] + before[cut:], self._after.changes)

    def torn(self, disk: OnDisk) -> Torn:
        """Open the journal that is so on the disk."""
        for ending, data in (("", disk.file), ("-wal", disk.changes), ("-shm", None)):
            path = self.path.with_name(self.path.name + ending)
            path.unlink(missing_ok=True)
            if data is not None:
                path.write_bytes(data)
        with capture_logs() as logs:
            journal = Journal(self.path)
        rows = journal.rows(1, 2**62, 10**6, 10**9)
        assert all(row.payload == _said(journal.run, row.number) for row in rows)
        journal.close()
        says_so = any("was not closed" in str(each["event"]) for each in logs)
        return Torn(journal.run, [row.number for row in rows], says_so)

    def wrong(self, disks: Iterator[OnDisk], least: int) -> Counter[str]:
        """Count the cuts (``cuts``), and in how many ``least`` messages are not there, or all."""
        found = Counter(cuts=0)
        for disk in disks:
            torn = self.torn(disk)
            found["cuts"] += 1
            found["lost"] += torn.numbers not in (
                list(range(1, least + 1)), list(range(1, SAID_BEFORE + 2))
            )  # fmt: skip
            found["of another run"] += torn.run != self.run
            found["not said"] += not torn.says_so
        return found

    def _on_disk(self) -> OnDisk:
        return OnDisk(self.path.read_bytes(), Path(f"{self.path}-wal").read_bytes())


class TornRotation:
    """A recording that ends its first part, begins the second, and syncs a chunk in it."""

    ABOUT: ClassVar = {"incident": "test"}
    ROTATION = Rotation(most_bytes=1, most_ns=10**18)

    def __init__(self, folder: Path) -> None:
        self.path = folder / "a.mcap"
        self._unfinished = unfinished_path(self.path)
        self._second = unfinished_path(part_path(self.path, 2))
        file = RecordingSet(self.path, self.ABOUT, rotation=self.ROTATION)
        file.put(KEY, b"first", 1)
        file.sync()
        self._before = self._unfinished.read_bytes()
        file.rotate_if_due()
        self._ended = self.path.read_bytes()
        self._begun = self._second.read_bytes()
        file.put(KEY, b"second", 2)
        file.sync()
        self._later = self._second.read_bytes()
        file.abandon()

    def on_disk(self, step: int) -> Iterator[tuple[dict[Path, bytes], int]]:
        """Yield what files there may be, and how many messages were synced by then."""
        for cut in range(len(self._before), len(self._ended) + 1, step):
            yield {self._unfinished: self._ended[:cut]}, 1
        yield {self.path: self._ended}, 1
        for cut in range(0, len(self._later), step):
            yield {self.path: self._ended, self._second: self._later[:cut]}, 1
        yield {self.path: self._ended, self._second: self._later}, 2

    def wrong(self, disks: Iterator[tuple[dict[Path, bytes], int]]) -> Counter[str]:
        """Count the cuts, and of how many what is gone on with lacks anything or is not whole."""
        found = Counter(cuts=0)
        for files, synced in disks:
            for path in files_of(self.path).values():
                path.unlink()
            for path, data in files.items():
                path.write_bytes(data)
            file = RecordingSet(self.path, self.ABOUT, resume=True, rotation=self.ROTATION)
            file.put(KEY, b"third", 3)
            file.sync()
            file.finish()
            *kept, last = (each.payload for each in read_recording(self.path))
            found["cuts"] += 1
            # A chunk that came on the disk whole, and was not synced, may be there.
            most = [b"first", b"second"]
            found["lost"] += kept not in (most[:synced], most) or last != b"third"
            found["not whole"] += not verify_recording(self.path).whole
        return found


def _said(run: bytes, number: int) -> bytes:
    return run + b"said %d" % number + bytes(1000)


def main() -> int:
    """Cut at every byte; print what came of it."""
    began_s = time.monotonic()
    place = IN_MEMORY if IN_MEMORY.is_dir() else None
    with tempfile.TemporaryDirectory(prefix="clew-torn-", dir=place) as folder:
        torture = Torture(Path(folder))
        append = torture.wrong(torture.appends(1), SAID_BEFORE)
        write_back = torture.wrong(torture.writes_back(1), SAID_BEFORE + 1)
        rotation = TornRotation(Path(folder))
        rotated = rotation.wrong(rotation.on_disk(1))
    told = {"append": append, "write_back": write_back, "rotation": rotated}
    took_s = round(time.monotonic() - began_s, 1)
    print(json.dumps(told | {"took_s": took_s}))  # noqa: T201
    return 1 if any(sum(each.values()) > each["cuts"] for each in told.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
