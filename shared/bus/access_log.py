"""Whose messages, questions and declarations a router turns away, as Zenoh's trace has it (pure).

Zenoh counts them nowhere. Its trace tells of each, but by the link's number alone, and tells in the
same words what it looks up beforehand, for every key that anybody declares. A look-up begins with
the key that it is of; it names the link's certificate as well, and that is how a number gets one.
"""

from __future__ import annotations

import re
from typing import Literal, NamedTuple, TypeAlias

Act: TypeAlias = Literal["say", "ask", "listen", "answer", "be there"]

ACCESS_TARGET = "zenoh::net::routing::interceptor::access_control"
"""What Zenoh's trace is to be turned on for."""

_ACTS: dict[str, Act] = {
    "Put": "say",
    "Query": "ask",
    "Declare Subscriber": "listen",
    "Declare Queryable": "answer",
    "Liveliness Token": "be there",
}
"""What a node may not, by Zenoh's word for it."""

_WORD = "|".join(_ACTS)
TELLING = (rf"unauthorized to (?:{_WORD}) \(ingress\)", r"\(ingress\): caching")
"""Only lines that have one of these, a regular expression each, are worth taking."""

OURS = "clew/"
"""What keys of ours begin with."""

MOST_LINKS = 1000
MOST_THREADS = 100

_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_LOOKS_UP = re.compile(r"(ThreadId\(\d+\)).*\(ingress\): caching permissions for `([^`]*)`")
_TURNED_AWAY = re.compile(
    r"(?P<thread>ThreadId\(\d+\)).*?: (?P<again>Using cached result: )?(?P<link>[0-9a-f]+) "
    rf"(?:on (?P<where>\S+) )?is unauthorized to (?P<word>{_WORD}) \(ingress\) on (?P<key>\S+)"
)
_NAME = re.compile(r"CertCommonName\(([A-Za-z0-9_-]+)\)")


class Breach(NamedTuple):
    """What a node did under a key where it may not, and was not let.

    ``sender_id`` is the node whose certificate the link has; "" where Zenoh did not tell.
    """

    sender_id: str
    key: str
    act: Act = "say"


class AccessLog:
    """Takes Zenoh's lines in order, and picks from them what was turned away."""

    def __init__(self) -> None:
        self._looks_up: dict[str, str] = {}
        """The key that each thread of Zenoh's looked up last."""

        self._senders: dict[str, str] = {}

    def take(self, line: str) -> Breach | None:
        """Return the breach that a line tells of, if it does."""
        line = _COLOURS.sub("", line)
        looks_up = _LOOKS_UP.search(line)
        if looks_up is not None:
            _keep(self._looks_up, looks_up[1], looks_up[2], MOST_THREADS)
            return None
        turned = _TURNED_AWAY.search(line)
        if turned is None:
            return None
        name = _NAME.search(turned["where"] or "")
        if name is not None:
            _keep(self._senders, turned["link"], name[1], MOST_LINKS)
        if not turned["again"] and self._looks_up.get(turned["thread"]) == turned["key"]:
            return None
        sender_id, key, act = (
            self._senders.get(turned["link"], ""),
            turned["key"],
            _ACTS[turned["word"]],
        )
        # Routers hand on what Zenoh has of its own.
        return Breach(sender_id, key, act) if act == "say" or key.startswith(OURS) else None


def _keep(known: dict[str, str], name: str, value: str, most: int) -> None:
    """Keep ``value`` under ``name``; whoever invents names has all forgotten, not kept."""
    if name not in known and len(known) >= most:
        known.clear()
    known[name] = value
