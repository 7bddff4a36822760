"""A gateway at work: on a thread of its own until a block ends."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Gateway(Protocol):
    """Works until it is told to stop, by another thread."""

    def run(self) -> None:
        """Work."""

    def stop(self) -> None:
        """Have ``run`` return."""


@contextmanager
def at_work(gateway: Gateway, name: str) -> Iterator[None]:
    """Let a gateway work on a thread of that name; return once it has stopped."""
    thread = threading.Thread(target=gateway.run, name=name)
    thread.start()
    try:
        yield
    finally:
        gateway.stop()
        thread.join()
