"""What is told of nodes, once each, and what of theirs was not taken, counted (pure)."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

from shared.topics import check_id

MOST_REFUSAL_KINDS = 4096
MOST_DETAIL = 200
UNNAMED = "?"
"""A node that a key too malformed does not name."""

DOUBT = "doubt_"
"""Before the kind of what the fusion doubts: a notice's reason."""

WRONG_CLOCK = "wrong_clock"
"""The reason of a notice that a node's clock is off the post's."""


class Notice(NamedTuple):
    """What is to be told once of a node: a kind of refusal, or what is wrong with it.

    ``trace`` is of an exception, where that was a fault of ours.
    """

    reason: str
    node_id: str
    detail: str
    trace: str = ""


class Notices:
    """Keeps what is to be told until it is taken; of refusals the first of a kind and node alone.

    ``refusals`` counts them per (reason, node), with what was put aside; ``refused`` those for
    which the node is to be blamed.
    """

    def __init__(self) -> None:
        self.refusals: Counter[tuple[str, str]] = Counter()
        self.refused = 0
        self._to_tell: list[Notice] = []

    def tell(self, reason: str, node_id: str, detail: str) -> None:
        """Have something be told of a node."""
        self._to_tell.append(Notice(reason, node_id, detail))

    def refuse(self, reason: str, node_id: str, detail: str) -> None:
        """Note that something of a node's was not taken."""
        self.refused += 1
        self._count(reason, node_id, detail)

    def put_aside(self, reason: str, node_id: str, detail: str, trace: str) -> None:
        """Note that something of a node's could not be handled, and that this is our fault."""
        self._count(reason, node_id, detail, trace)

    def _count(self, reason: str, node_id: str, detail: str, trace: str = "") -> None:
        kind = (reason, node_id)
        if kind not in self.refusals:
            if len(self.refusals) >= MOST_REFUSAL_KINDS:
                kind = (reason, UNNAMED)
            if kind not in self.refusals:
                self._to_tell.append(Notice(*kind, detail[:MOST_DETAIL], trace))
        self.refusals[kind] += 1

    def take(self) -> list[Notice]:
        """Return what is to be told, once."""
        taken, self._to_tell = self._to_tell, []
        return taken


def named_in(key_text: str) -> str:
    """Return the node that a key which is not ours still names, if it is a name at all."""
    chunks = key_text.split("/")
    try:
        return check_id(chunks[4], "node") if len(chunks) > 4 else UNNAMED
    except ValueError:
        return UNNAMED
