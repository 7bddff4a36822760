"""What the post and its page's process say to each other: MessagePack, each behind its length."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import IO, TypeAlias

import msgspec

from command_post.nodes.teams import Crews
from command_post.plans.plan_images import Plan
from command_post.roster import Roster
from command_post.web.people import Person
from command_post.web.serving import ServerKeys
from shared.messages import NodeId

_LENGTH = struct.Struct(">I")

Published: TypeAlias = tuple[str, bytes]
"""A message under its key."""

ALIVE: Published = ("alive", b"")
"""What the page says instead of a message, again and again, while all of it goes on."""


class Serving(msgspec.Struct, frozen=True):
    """What is served, where, and to whom: the first that the page's process is told.

    ``listening`` is the number of the socket that it inherits; ``hosts`` the names that the page
    goes by, empty for any. It is served encrypted with ``keys``, and people sign in if ``people``
    are given.
    """

    incident: NodeId
    post_id: NodeId
    listening: int
    hosts: tuple[str, ...] = ()
    keys: ServerKeys | None = None
    people: dict[NodeId, Person] | None = None
    plan: Plan = Plan()
    teams: Crews = {}


class Telling(msgspec.Struct, frozen=True, array_like=True):
    """What the post has published since it told last, and the newest roster if there is one.

    It is told now and then although there is nothing new: whoever has read it gives a sign of life.
    """

    published: list[Published] = []
    roster: Roster | None = None


def write(pipe: IO[bytes], told: msgspec.Struct | Published) -> None:
    """Write one frame, all of it. Raises ``OSError`` if nobody reads any more."""
    content = msgspec.msgpack.encode(told)
    pipe.write(_LENGTH.pack(len(content)) + content)
    pipe.flush()


def read(pipe: IO[bytes]) -> Iterator[bytes]:
    """Yield frame after frame until whoever writes them has gone."""
    while len(header := pipe.read(_LENGTH.size)) == _LENGTH.size:
        (length,) = _LENGTH.unpack(header)
        content = pipe.read(length)
        if len(content) < length:
            return
        yield content
