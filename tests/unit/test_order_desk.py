"""A responder's unit heeds its post's orders, tells them once, and replies."""

from __future__ import annotations

import os
import signal
import threading

import pytest
from msgspec import structs

from edge_agent.order_desk import FRESH_NS, OrderDesk, tell_wearer
from edge_agent.orders import MOST_KNOWN, OrderBook
from shared.bus.memory import MemoryNetwork
from shared.clock import ManualClock
from shared.codec import decode, parse_key
from shared.gate import Gate, Turned
from shared.messages import Order, OrderReply
from shared.process import set_by_button
from shared.sender import Sender, Unkept
from shared.topics import Key
from tests.waiting import wait_for

ORDERED_NS = 10**18
POST = Key("fire", "post", "post", "order")


def order(sequence: int, *to: str, kind: str = "evacuate") -> Order:
    return Order(
        event_time_ns=ORDERED_NS, sequence=sequence, kind=kind, to=to, text="by the north stair",  # type: ignore[arg-type]
    )  # fmt: skip


class Unit:
    """A unit on a network, and a post that hears its replies."""

    def __init__(self, gate: Gate | None = None) -> None:
        network = MemoryNetwork()
        self.told: list[Order] = []
        self.replies: list[tuple[int, str]] = []
        self.acknowledged = threading.Event()
        self.post_time_ns: int | None = ORDERED_NS + FRESH_NS
        self.post = Sender(network.connect(), "fire", "post", "post", Unkept())
        self.bus = network.connect()
        self.bus.subscribe("clew/v1/fire/responder/r1/order_reply", lambda got: self._hear(*got))
        self.book = OrderBook("r1", "post")
        self.desk = OrderDesk(
            network.connect(), "fire", self.book, Sender(self.bus, "fire", "responder", "r1"),
            gate or Gate(), ManualClock(5), self.acknowledged, self.told.append,
            lambda post_id: self.post_time_ns if post_id == "post" else None,
        )  # fmt: skip

    def _hear(self, key_text: str, payload: bytes) -> None:
        key = parse_key(key_text)
        assert isinstance(key, Key)
        reply = decode(key, payload)
        assert isinstance(reply, OrderReply)
        assert reply.post_id == "post"
        self.replies.append((reply.order_sequence, reply.stage))


def test_an_order_is_told_once_received_at_once_and_acknowledged_by_the_wearer() -> None:
    unit = Unit()
    payload = unit.post.send(order(1, "r1"))
    unit.desk.attend()
    assert unit.told == [order(1, "r1")]
    assert unit.replies == [(1, "received")]
    # The same bytes again, and the same order sealed anew after the post began anew.
    unit.bus.publish(str(POST), payload)
    unit.post.send(order(1, "r1"))
    unit.desk.attend()
    assert (len(unit.told), unit.replies) == (1, [(1, "received")])
    unit.acknowledged.set()
    unit.desk.attend()
    unit.desk.attend()
    assert unit.replies == [(1, "received"), (1, "acknowledged")]


def test_all_that_was_told_is_acknowledged_and_nothing_that_comes_later() -> None:
    unit = Unit()
    for sequence in (1, 2):
        unit.post.send(order(sequence))
    unit.desk.attend()
    unit.acknowledged.set()
    unit.desk.attend()
    unit.post.send(order(3))
    unit.desk.attend()
    assert unit.replies == [
        (1, "received"), (2, "received"), (1, "acknowledged"), (2, "acknowledged"),
        (3, "received"),
    ]  # fmt: skip


@pytest.mark.parametrize("known", [True, False])
def test_what_was_ordered_long_ago_is_heeded_once_the_post_says_it_again(known: bool) -> None:
    unit = Unit()
    unit.post_time_ns = ORDERED_NS + FRESH_NS + 1 if known else None
    unit.post.send(order(1, "r1"))
    unit.desk.attend()
    assert (unit.told, unit.replies, unit.desk.stale) == ([], [], 1)
    unit.post_time_ns = ORDERED_NS + 10 * FRESH_NS
    again = structs.replace(order(1, "r1"), said_ns=unit.post_time_ns - FRESH_NS)
    payload = unit.post.send(again)
    unit.desk.attend()
    assert (unit.told, unit.replies) == ([again], [(1, "received")])
    # A unit that has just begun, and hears it from who kept it.
    fresh = Unit()
    fresh.post_time_ns = unit.post_time_ns + 1
    fresh.bus.publish(str(POST), payload)
    fresh.desk.attend()
    assert (fresh.told, fresh.desk.stale) == ([], 1)


def test_what_others_are_ordered_and_what_strangers_order_is_not_heeded() -> None:
    unit = Unit()
    unit.post.send(order(1, "r2"))
    stranger = Sender(unit.bus, "fire", "post", "commander", Unkept())
    stranger.send(order(2, "r1"))
    unit.bus.publish(str(POST), b"\xc1")
    unit.desk.attend()
    assert (unit.told, unit.replies, unit.book.strangers) == ([], [], 1)


class NobodyIsBelieved:
    """Finds every signature forged."""

    def verdict(self, *_: object) -> Turned | None:
        """Return that it is forged."""
        return "forged"


def test_an_order_with_a_bad_signature_is_not_heeded() -> None:
    unit = Unit(Gate(NobodyIsBelieved()))
    unit.post.send(order(1, "r1"))
    unit.desk.attend()
    assert (unit.told, unit.replies) == ([], [])


def test_the_oldest_orders_are_forgotten_and_not_the_newest() -> None:
    book = OrderBook("r1", "post")
    for sequence in range(MOST_KNOWN + 1):
        assert book.take(POST, order(sequence))
    assert not book.take(POST, order(MOST_KNOWN))
    assert len(book.acknowledge()) == MOST_KNOWN


def test_the_wearer_is_told_in_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    tell_wearer(order(1, kind="roll_call"))
    assert "ORDER ROLL CALL: by the north stair\n" in capsys.readouterr().out


def test_a_signal_acknowledges() -> None:
    before = signal.getsignal(signal.SIGUSR1)
    with set_by_button() as acknowledged:
        os.kill(os.getpid(), signal.SIGUSR1)
        wait_for(acknowledged.is_set, "the signal")
    assert signal.getsignal(signal.SIGUSR1) == before
