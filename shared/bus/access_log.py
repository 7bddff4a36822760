"""Whose messages a router's access rules turn away, as Zenoh's trace has it (pure).

Zenoh counts them nowhere. Its trace tells of each, but by the link's number alone, and tells in the
same words what it looks up beforehand, for every key that anybody declares. A look-up begins with
the key that it is of; it names the link's certificate as well, and that is how a number gets one.
"""

from __future__ import annotations

import re
from typing import NamedTuple

ACCESS_TARGET = "zenoh::net::routing::interceptor::access_control"
"""What Zenoh's trace is to be turned on for."""

TELLING = (r"unauthorized to Put \(ingress\)", r"\(ingress\): caching")
"""Only lines that have one of these, a regular expression each, are worth taking."""

MOST_LINKS = 1000
MOST_THREADS = 100

_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_LOOKS_UP = re.compile(r"(ThreadId\(\d+\)).*\(ingress\): caching permissions for `([^`]*)`")
_TURNED_AWAY = re.compile(
    r"(?P<thread>ThreadId\(\d+\)).*?: (?P<again>Using cached result: )?(?P<link>[0-9a-f]+) "
    r"(?:on (?P<where>\S+) )?is unauthorized to Put \(ingress\) on (?P<key>\S+)"
)
_NAME = re.compile(r"CertCommonName\(([A-Za-z0-9_-]+)\)")


class Breach(NamedTuple):
    """A message that was put under a key which is not its sender's to say, and not let pass.

    ``sender_id`` is the node whose certificate the link has; "" where Zenoh did not tell.
    """

    sender_id: str
    key: str


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
        return Breach(self._senders.get(turned["link"], ""), turned["key"])


def _keep(known: dict[str, str], name: str, value: str, most: int) -> None:
    """Keep ``value`` under ``name``; whoever invents names has all forgotten, not kept."""
    if name not in known and len(known) >= most:
        known.clear()
    known[name] = value
