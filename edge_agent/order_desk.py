"""Where orders come in: told to the wearer, and replied to, on a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Literal

import structlog
from rich.console import Console

from edge_agent.desk import Desk
from edge_agent.orders import OrderBook
from shared.bus.interface import Bus
from shared.clock import Clock
from shared.gate import Gate
from shared.messages import NodeId, Order, OrderReply, TimeNs
from shared.sender import Sender
from shared.topics import Key
from shared.units import NS_PER_S

FRESH_NS = 30 * NS_PER_S
"""An order is not heeded that was said so much longer ago: the post says it again every 3 s."""

_log = structlog.stdlib.get_logger(__name__)


class OrderDesk(Desk):
    """Tells the wearer what the post orders, and the post that they were told, and understood.

    ``acknowledged`` is set when the wearer says so: all that they were told until then is.
    """

    def __init__(
        self,
        bus: Bus,
        incident: NodeId,
        book: OrderBook,
        sender: Sender,
        gate: Gate,
        clock: Clock,
        acknowledged: threading.Event,
        tell: Callable[[Order], None],
        post_time_ns: Callable[[NodeId], TimeNs | None],
    ) -> None:
        """``post_time_ns``: what time it is at a post, as far as that is known."""
        super().__init__(bus, incident, "order", gate)
        self._book = book
        self._sender = sender
        self._clock = clock
        self._acknowledged = acknowledged
        self._tell = tell
        self._post_time_ns = post_time_ns
        self.stale = 0
        """How much was said long ago, or nobody knows when."""

    def attend(self, wait_s: float = 0.0) -> None:
        """Heed what has come, within ``wait_s`` at most, and what the wearer acknowledges."""
        for key, message in self._heard(wait_s):
            if isinstance(message, Order) and self._is_fresh(message):
                self._heed(key, message)
        if self._acknowledged.is_set():
            self._acknowledged.clear()
            for order in self._book.acknowledge():
                self._reply(order, "acknowledged")
                _log.info("acknowledged", order=order.kind, number=order.sequence)

    def _heed(self, key: Key, order: Order) -> None:
        if self._book.take(key, order):
            self._tell(order)
            self._reply(order, "received")
        elif key.node_id != self._book.post_id and self._book.strangers == 1:
            _log.warning("an order of somebody else than the post is not heeded", of=key.node_id)

    def _is_fresh(self, order: Order) -> bool:
        """Whether the post says it now: who relays can keep an order, and say it long after.

        While it is not known what time it is at the post, nothing is heeded: the post says again
        what stands.
        """
        now_ns = self._post_time_ns(self._book.post_id)
        said_ns = order.event_time_ns if order.said_ns is None else order.said_ns
        if now_ns is not None and now_ns - said_ns <= FRESH_NS:
            return True
        self.stale += 1
        if self.stale == 1:
            age_s = None if now_ns is None else round((now_ns - said_ns) / NS_PER_S, 1)
            _log.warning("an order said long ago, or not known when, waits", age_s=age_s)
        return False

    def _reply(self, order: Order, stage: Literal["received", "acknowledged"]) -> None:
        self._sender.send(
            OrderReply(
                event_time_ns=self._clock.now_ns(),
                sequence=self._sender.next_sequence(OrderReply),
                post_id=self._book.post_id,
                order_sequence=order.sequence,
                stage=stage,
            )
        )


def tell_wearer(order: Order) -> None:
    """Tell the wearer an order: a line on standard output, for whatever speaks or shows it."""
    kind = order.kind.replace("_", " ").upper()
    text = f": {order.text}" if order.text else ""
    Console().print(f"ORDER {kind}{text}", highlight=False, markup=False, soft_wrap=True)
    _log.warning("order", kind=order.kind, text=order.text, number=order.sequence)
