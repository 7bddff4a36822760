"""Faults of our own, met while something is handled: got over, and told of (pure).

An exception that nobody expected must not end the post, nor go unseen. Where it comes up what was
being done is put aside, and everything else goes on from what was held before. It comes up again in
a replay, at the same place, so that this makes the same of it.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import PurePath
from typing import NamedTuple

from shared.topics import Role

MOST_KEPT = 100


class GotOver:
    """Breaks off what is done within at an exception, and ``note``s it.

    What is no fault of ours goes on upwards: interrupts, and memory that has run out.
    """

    __slots__ = ("_note",)

    def __init__(self, note: Callable[[Exception], object]) -> None:
        self._note = note

    def __enter__(self) -> None:
        """Begin."""

    def __exit__(
        self, _kind: type[BaseException] | None, error: BaseException | None, _trace: object
    ) -> bool:
        """Note an exception, if it is to be got over."""
        if not isinstance(error, Exception) or isinstance(error, MemoryError):
            return False
        cause = error.__cause__
        while cause is not None:
            # Amid machine code an interrupt comes out as what one function after another fails of.
            if isinstance(cause, KeyboardInterrupt):
                raise cause
            cause = cause.__cause__
        self._note(error)
        return True


class Mishap(NamedTuple):
    """An exception of the kind ``error``, that came up at ``place`` while doing ``what``.

    ``role`` and ``node_id`` are of the node whose word it was about; empty if that is not known.
    """

    role: Role | None
    node_id: str
    what: str
    error: str
    place: str
    text: str
    trace: str

    @property
    def words(self) -> str:
        """What happened, in words."""
        why = f": {self.error} at {self.place} ({self.text})" if self.place else ""
        return f"{self.what}{why}"


class Mishaps:
    """Those that came up since they were taken last."""

    def __init__(self) -> None:
        self._found: list[Mishap] = []

    def __bool__(self) -> bool:
        return bool(self._found)

    def survived(self, what: str) -> GotOver:
        """Break off what is done within at an exception, and note it."""
        return GotOver(lambda error: self.note(error, what))

    def note(
        self, error: Exception, what: str, role: Role | None = None, node_id: str = ""
    ) -> None:
        """Note an exception that was caught while doing ``what``."""
        if len(self._found) < MOST_KEPT:
            last = traceback.extract_tb(error.__traceback__)[-1]
            place = f"{PurePath(last.filename).name}:{last.lineno}"
            trace = "".join(traceback.format_exception(error))
            self._found.append(
                Mishap(role, node_id, what, type(error).__name__, place, str(error), trace)
            )

    def put_aside(self, what: str, role: Role, node_id: str, error: str = "Unsolvable") -> None:
        """Note that ``what`` a node said is put aside, being what was failed of."""
        if len(self._found) < MOST_KEPT:
            self._found.append(Mishap(role, node_id, what, error, "", "", what))

    def take(self) -> list[Mishap]:
        """Return them, once."""
        taken, self._found = self._found, []
        return taken
