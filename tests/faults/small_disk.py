"""A disk of its own, in memory: to be filled, and given room again."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

CHUNK_BYTES = 1 << 12


def why_no_disk() -> str | None:
    """Return why no disk can be mounted on this machine; ``None`` if one can."""
    if sys.platform != "linux" or os.geteuid() != 0:
        return "a disk of its own can be mounted by root, on Linux"
    probe = ["unshare", "--mount", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    done = subprocess.run(probe, capture_output=True, check=False)
    if done.returncode != 0:
        return f"no disk can be mounted here: {done.stderr.decode().strip()}"
    return None


@contextmanager
def small_disk(folder: Path, size_bytes: int) -> Iterator[None]:
    """Mount a disk of that size on ``folder``, which must be empty, until the block ends."""
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size_bytes}", "tmpfs", str(folder)]
    subprocess.run(mount, check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def fill(ballast: Path) -> None:
    """Fill the disk that ``ballast`` is on to its last byte."""
    with suppress(OSError), ballast.open("ab", buffering=0) as file:
        while file.write(bytes(CHUNK_BYTES)):
            pass
