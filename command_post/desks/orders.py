"""What the post has ordered, and who has not acknowledged it (pure).

An order stands until each of those it is for has acknowledged it. Nothing here runs on its own:
time is what the caller says it is.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Literal, NamedTuple, TypeAlias

from shared.messages import NodeId, Order, OrderReply, OrderRequest
from shared.units import NS_PER_MS, NS_PER_S

REPEAT_NS = 3 * NS_PER_S
"""An order is said again so long after it was said last, while somebody who is alive has not
acknowledged it."""

MOST_STANDING = 1000
MOST_NAMED = 8
"""Who is known is named in a refusal, if there are no more."""

Stage: TypeAlias = Literal["sent", "received"]


class Unacknowledged(NamedTuple):
    """An order that a responder has not acknowledged; ``received`` if their unit has it."""

    order: Order
    stage: Stage


class Issued(NamedTuple):
    """What came of a request: an order to publish, if any, and who is to acknowledge it."""

    order: Order | None
    waited_for: tuple[NodeId, ...]


class Orders:
    """Issues orders as they are requested, and takes the replies to them."""

    def __init__(self) -> None:
        self._standing: dict[int, _Standing] = {}
        self._last_sequence = -1

    def request(
        self, request: OrderRequest, known: Collection[NodeId], now_ns: int
    ) -> Issued | str:
        """Do what is requested at ``now_ns``, or return in words why not.

        ``known`` are the responders that have been heard: nobody else can be ordered anything. An
        order to everybody is for all of them; to evacuate, also for who is heard later.
        """
        unknown = sorted(set(request.to).difference(known))
        if unknown:
            return _not_known(unknown, known)
        to = tuple(dict.fromkeys(request.to)) or tuple(sorted(known))
        if request.kind == "withdraw":
            return Issued(None, self._withdraw(to, everybody=not request.to))
        if not to and request.kind != "evacuate":
            return "no responder has been heard"
        if len(self._standing) >= MOST_STANDING:
            return f"{MOST_STANDING} orders stand already: withdraw some"
        # Counted by the clock: a post that begins anew does not give an old order's number again.
        self._last_sequence = max(self._last_sequence + 1, now_ns // NS_PER_MS)
        order = Order(
            event_time_ns=now_ns,
            sequence=self._last_sequence,
            kind=request.kind,
            to=tuple(dict.fromkeys(request.to)),
            text=request.text,
        )
        self._standing[order.sequence] = _Standing(order, dict.fromkeys(to, "sent"))
        return Issued(order, to)

    def meet(self, responder_id: NodeId) -> None:
        """Take in that a responder is there who was not: orders to evacuate are for them too."""
        for order, waited_for in self._standing.values():
            if order.kind == "evacuate" and not order.to:
                waited_for.setdefault(responder_id, "sent")

    def take(self, responder_id: NodeId, reply: OrderReply) -> None:
        """Take in what a responder's unit replies; what answers no order changes nothing."""
        standing = self._standing.get(reply.order_sequence)
        if standing is None or responder_id not in standing.waited_for:
            return
        if reply.stage == "received":
            standing.waited_for[responder_id] = "received"
            return
        del standing.waited_for[responder_id]
        self._drop_if_done(standing)

    def of(self, responder_id: NodeId) -> list[Unacknowledged]:
        """Return what a responder has not acknowledged: to evacuate first, then the oldest."""
        found = [
            Unacknowledged(order, waited_for[responder_id])
            for order, waited_for in self._standing.values()
            if responder_id in waited_for
        ]
        return sorted(found, key=lambda one: (one.order.kind != "evacuate", one.order.sequence))

    def waited_for(self) -> Iterator[tuple[Order, Collection[NodeId]]]:
        """Yield each order that stands, and who has not acknowledged it."""
        for order, waited_for in self._standing.values():
            yield order, waited_for.keys()

    def _withdraw(self, to: Collection[NodeId], *, everybody: bool) -> tuple[NodeId, ...]:
        """Wait no longer for those in ``to``; return for whom something stood."""
        stood = set()
        for standing in tuple(self._standing.values()):
            for responder_id in standing.waited_for.keys() & set(to):
                del standing.waited_for[responder_id]
                stood.add(responder_id)
            if everybody:
                del self._standing[standing.order.sequence]
            else:
                self._drop_if_done(standing)
        return tuple(sorted(stood))

    def _drop_if_done(self, standing: _Standing) -> None:
        """Forget an order that all have acknowledged, unless it is for who may still come too."""
        order, waited_for = standing
        may_come = order.kind == "evacuate" and not order.to
        if not waited_for and not may_come:
            del self._standing[order.sequence]


class _Standing(NamedTuple):
    """An order, and who has not acknowledged it."""

    order: Order
    waited_for: dict[NodeId, Stage]


class OrderRepeats:
    """When to say which order again. What it says changes nothing of what stands."""

    def __init__(self) -> None:
        self._said_ns: dict[int, int] = {}

    def due(self, orders: Orders, alive: Collection[NodeId], now_ns: int) -> list[Order]:
        """Return what is to be said again at ``now_ns``, for those who are ``alive``."""
        said_ns, self._said_ns = self._said_ns, {}
        due = []
        for order, waited_for in orders.waited_for():
            last_ns = said_ns.get(order.sequence, order.event_time_ns)
            if not 0 <= now_ns - last_ns < REPEAT_NS and not set(waited_for).isdisjoint(alive):
                due.append(order)
                last_ns = now_ns
            self._said_ns[order.sequence] = last_ns
        return due


def _not_known(unknown: list[NodeId], known: Collection[NodeId]) -> str:
    names = ", ".join(unknown[:MOST_NAMED])
    if not known:
        return f"{names}: no responder has been heard"
    few = len(known) <= MOST_NAMED
    return f"{names}: not heard so far; {', '.join(sorted(known)) if few else len(known)} have been"
