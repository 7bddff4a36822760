"""What the doctor finds."""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

Level: TypeAlias = Literal["ok", "warning", "fault"]


class Finding(NamedTuple):
    """One thing that was looked at: ``about`` what, what it ``says``, and what to ``do``.

    With a ``fault`` a post does not work, or not safely; a ``warning`` is one in waiting.
    """

    level: Level
    about: str
    says: str
    do: str = ""


def ok(about: str, says: str) -> Finding:
    """Return that all is well."""
    return Finding("ok", about, says)


def warning(about: str, says: str, do: str) -> Finding:
    """Return that something is not as it should be."""
    return Finding("warning", about, says, do)


def fault(about: str, says: str, do: str) -> Finding:
    """Return that something has to be done."""
    return Finding("fault", about, says, do)
