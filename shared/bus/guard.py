"""Keeps a program's fault in a handler from the bus that called it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import structlog

log = structlog.stdlib.get_logger(__name__)

P = ParamSpec("P")
R = TypeVar("R")


class HandlerGuard:
    """Wraps handlers; what they raise is counted, and logged the first time for each."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._failures = 0

    @property
    def failures(self) -> int:
        """How often a handler has raised."""
        return self._failures

    def wrap(self, handler: Callable[P, R], role: str) -> Callable[P, R | None]:
        """Return ``handler``, save that it returns ``None`` where it would raise an exception.

        ``role`` tells it in the log.
        """
        told = False

        def guarded(*args: P.args, **kwargs: P.kwargs) -> R | None:
            """Call the handler; tell its first failure and count the others."""
            nonlocal told
            try:
                return handler(*args, **kwargs)
            except Exception:
                with self._lock:
                    self._failures += 1
                    first, told = not told, True
                if first:
                    log.exception("a handler failed; more of the same are only counted", role=role)
                return None

        return guarded
