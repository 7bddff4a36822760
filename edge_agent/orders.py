"""What the post has ordered the wearer, and how they reply (pure)."""

from __future__ import annotations

from typing import NamedTuple

from shared.messages import NodeId, Order, Sequence
from shared.topics import Key

MOST_KNOWN = 4096
"""Orders that are remembered; the oldest are forgotten, and would be told again."""


class OrderBook:
    """Takes in what posts order; tells each order that is for the wearer once.

    Heeded is only the post ``post_id``: who else says something under a post's keys is a stranger.
    """

    def __init__(self, responder_id: NodeId, post_id: NodeId) -> None:
        self.post_id = post_id
        self._responder_id = responder_id
        self._known: dict[Sequence, _Told] = {}
        self.strangers = 0
        """How much was ordered by somebody else."""

    def take(self, key: Key, order: Order) -> bool:
        """Take in an order; say whether it is new, and for the wearer."""
        if (key.role, key.node_id) != ("post", self.post_id):
            self.strangers += 1
            return False
        if order.to and self._responder_id not in order.to:
            return False
        if order.sequence in self._known:
            return False
        if len(self._known) >= MOST_KNOWN:
            del self._known[next(iter(self._known))]
        self._known[order.sequence] = _Told(order, acknowledged=False)
        return True

    def acknowledge(self) -> list[Order]:
        """Take in that the wearer has understood all they were told; return what that is."""
        told = [order for order, acknowledged in self._known.values() if not acknowledged]
        for order in told:
            self._known[order.sequence] = _Told(order, acknowledged=True)
        return told


class _Told(NamedTuple):
    """An order, and whether the wearer has acknowledged it."""

    order: Order
    acknowledged: bool
