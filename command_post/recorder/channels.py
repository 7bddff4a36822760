"""The channels of a recording: a key, what its messages decode to, and what they are for (pure)."""

from __future__ import annotations

from typing import NamedTuple

from mcap.records import Channel

from command_post.recorder.layout import Declared

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


def channel_of(channel: Channel, declared: Declared) -> FileChannel:
    """Return what a file says of a channel that is ``declared`` in it."""
    schema = declared.schemas.get(channel.schema_id)
    name = None if schema is None else schema.name
    marks = channel.metadata
    return FileChannel(channel.topic, name, **{each: each in marks for each in _MARKS})
