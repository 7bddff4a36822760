"""The disk that is recorded on: there, writable, roomy and quick enough."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from command_post.doctor.finding import Finding, fault, ok, warning
from shared.recording_parts import UNFINISHED, files_of

LEAST_BYTES = 200 << 20
ENOUGH_BYTES = 5 << 30
"""A day with a hundred responders, without raw samples, and some."""

SLOW_S = 0.3
SYNCS = 5
SYNCED_BYTES = 1 << 18


def check_recording(record: Path) -> Iterator[Finding]:
    """Yield whether a post could record to ``record``, and for how long."""
    files = list(files_of(record).values())
    part = files[-1] if files else record
    if files and not part.name.endswith(UNFINISHED):
        yield fault("recording", f"{part} is there already", "give the recording another name")
    elif files:
        size_mb = sum(each.stat().st_size for each in files) / 1e6
        yield warning(
            "recording",
            f"{part} ({size_mb:.1f} MB) was broken off",
            "the post goes on with it, if given the same settings; else move it away",
        )
    yield from _check_folder(record.absolute().parent)


def _check_folder(folder: Path) -> Iterator[Finding]:
    if not folder.is_dir():
        yield fault("disk", f"{folder} is no folder", "make it, or record elsewhere")
        return
    free = shutil.disk_usage(folder).free
    said = f"{free / 1e9:.1f} GB free in {folder}"
    if free < LEAST_BYTES:
        yield fault("disk", said, "make room, or record elsewhere")
    elif free < ENOUGH_BYTES:
        yield warning("disk", said, "make room: a long incident takes more")
    else:
        yield ok("disk", said)
    try:
        slowest_s = _slowest_sync_s(folder)
    except OSError as error:
        yield fault(
            "disk",
            f"cannot be written ({error.strerror})",
            "mount it for writing, or record elsewhere",
        )
        return
    said = f"the slowest of {SYNCS} syncs took {slowest_s * 1e3:.0f} ms"
    slow = slowest_s > SLOW_S
    do = "use a faster disk: what is not synced is lost in a power cut"
    yield warning("disk", said, do) if slow else ok("disk", said)


def _slowest_sync_s(folder: Path) -> float:
    took_s = []
    with tempfile.TemporaryFile(dir=folder, prefix=".clew-doctor-") as file:
        for _ in range(SYNCS):
            began_s = time.perf_counter()
            file.write(bytes(SYNCED_BYTES))
            file.flush()
            os.fsync(file.fileno())
            took_s.append(time.perf_counter() - began_s)
    return max(took_s)
