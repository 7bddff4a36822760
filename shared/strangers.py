"""Strangers (pure): who poses as a node, says what is not theirs to say, or wants a link."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

from shared.gate import Turned

WORDS: dict[Turned, str] = {
    "forged": "that it has not signed",
    "unsigned": "without a signature",
    "unsealed": "without a signature",
    "withdrawn": "with a withdrawn key",
}

LINK_WORDS: dict[str, str] = {
    "no_certificate": "shows no certificate",
    "expired": "has a certificate that has expired",
    "not_yet_valid": "has a certificate that is not valid yet",
    "foreign": "has a certificate of another authority",
    "not_tls": "does not encrypt",
    "not_named": "has a certificate that nobody here knows of",
}
"""Why a link was refused, where that is worth an alert."""


class AtLinks(NamedTuple):
    """What a router refuses, counted: links by why, and what is not its sender's to say.

    ``breaches`` are by the sender, "" if nobody knows who that is, and by the node that is named.
    """

    refused: Mapping[str, int]
    breaches: Mapping[tuple[str, str], int]


NOBODY = AtLinks(MappingProxyType({}), MappingProxyType({}))


class Noticed(NamedTuple):
    """Somebody strange: ``why``, in ``words``, and which node's name is in it, if any is."""

    why: str
    node_id: str | None
    words: str


class Strangers:
    """Notices each kind of stranger once for each node that they name."""

    def __init__(self) -> None:
        self._noticed: set[Noticed] = set()

    def noticed(
        self, at_links: AtLinks, turned: Mapping[tuple[Turned, str], int] = MappingProxyType({})
    ) -> list[Noticed]:
        """Return what is new at the links, and among what a gate has ``turned`` away."""
        new = [each for each in _all(at_links, turned) if each not in self._noticed]
        self._noticed.update(new)
        return new


def _all(at_links: AtLinks, turned: Mapping[tuple[Turned, str], int]) -> Iterator[Noticed]:
    for why, node_id in list(turned):
        if why in WORDS:
            yield Noticed(why, node_id, f"somebody sends messages {WORDS[why]}")
    for sender_id, named in list(at_links.breaches):
        whose = f"{named}'s" if named else "nobody's"
        if sender_id:
            yield Noticed("breach", sender_id, f"says what is {whose} to say, and is not let")
        elif named:
            yield Noticed("breach", named, "somebody says what is its to say, and is not let")
    for reason in list(at_links.refused):
        if reason in LINK_WORDS:
            words = f"a link was refused: who dials {LINK_WORDS[reason]}"
            yield Noticed(reason, None, words)
