"""Work that goes on by itself: a thread of its own, from when a block is entered to its end."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from typing import Self


class OwnThread(ABC):
    """Works on a thread while it is entered; leaving it waits until the work has ended."""

    def __init__(self, name: str) -> None:
        """``name`` is the thread's."""
        self._stop = threading.Event()
        # No daemon: it is inside Zenoh when it says or asks something.
        self._thread = threading.Thread(target=self._run, name=name, daemon=False)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    @abstractmethod
    def _run(self) -> None:
        """Work until ``_stop`` is set."""
