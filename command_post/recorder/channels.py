"""The channels of a recording: a key, what its messages decode to, and what they are for (pure)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

_MARKS = ("outgoing", "excerpt", "derived")


class FileChannel(NamedTuple):
    """What stands on one channel; without a ``schema``, what cannot be decoded."""

    topic: str
    schema: str | None
    outgoing: bool
    excerpt: bool = False
    derived: bool = False

    @property
    def marks(self) -> dict[str, str]:
        """What the file says of it beside its topic and schema."""
        return {name: "yes" for name in _MARKS if getattr(self, name)}


def marked(topic: str, schema: str | None, marks: Mapping[str, str]) -> FileChannel:
    """Return the channel of which a file says that."""
    return FileChannel(topic, schema, **{each: each in marks for each in _MARKS})
