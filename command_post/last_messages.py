"""What is still handled once the post is to stop: a while of it, however much there is."""

from __future__ import annotations

import time
from collections.abc import Callable
from threading import Event

LASTS_S = 0.5


class LastMessages:
    """Says when it is too late to handle more, so long after ``stop`` was found to be set.

    ``unhandled`` counts what came too late: what of it is journalled comes again.
    """

    def __init__(
        self, stop: Event, lasts_s: float = LASTS_S, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        self._stop = stop
        self._lasts_s = lasts_s
        self._monotonic = monotonic
        self._latest_s: float | None = None
        self.unhandled = 0

    @property
    def is_over(self) -> bool:
        """Whether it is too late."""
        if self._latest_s is None and self._stop.is_set():
            self._latest_s = self._monotonic() + self._lasts_s
        return self._latest_s is not None and self._monotonic() >= self._latest_s
