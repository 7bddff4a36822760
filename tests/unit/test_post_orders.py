"""The post issues orders, says them again until they are acknowledged, and records them once."""

from __future__ import annotations

from pathlib import Path

from command_post.orders import REPEAT_NS
from shared.bus.interface import Received
from shared.bus.memory import MemoryNetwork
from shared.codec import encode
from shared.messages import NodeHealth, Order, OrderReply, OrderRequest
from shared.topics import alive_key
from tests.unit.test_post import NOW_NS, key, message_in, recorded_keys, serving
from tests.waiting import wait_for


def health() -> bytes:
    return encode(NodeHealth(event_time_ns=NOW_NS, sequence=0, level="ok", findings=()))


def test_an_order_is_said_again_in_the_same_bytes_until_it_is_acknowledged(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    said: list[Received] = []
    wanted = OrderRequest(event_time_ns=NOW_NS, sequence=4, kind="evacuate", to=("r1",), text="out")
    with serving(MemoryNetwork(), path) as (other, clock, shown):
        other.subscribe(key("order", "post", "p"), said.append)
        other.declare_alive(alive_key("fire", "responder", "r1"))
        other.publish(key("health"), health())
        other.publish(key("order_request", "post", "commander"), encode(wanted))
        wait_for(lambda: said, "the order")
        for repeat in (1, 2):
            clock.set_ns(NOW_NS + repeat * (REPEAT_NS + 1))
            wait_for(lambda: len(said) > repeat, "the order again")  # noqa: B023
        assert len(set(said)) == 1
        order = message_in(said[0])
        assert isinstance(order, Order)
        assert (order.kind, order.to, order.text) == ("evacuate", ("r1",), "out")
        wait_for(lambda: shown and shown[-1].responders[0].orders, "it in the roster")
        done = OrderReply(
            event_time_ns=NOW_NS, sequence=0, post_id="p", order_sequence=order.sequence,
            stage="acknowledged",
        )  # fmt: skip
        other.publish(key("order_reply"), encode(done))
        wait_for(lambda: not shown[-1].responders[0].orders, "the order to be done with")
        count = len(said)
        clock.set_ns(NOW_NS + 10 * REPEAT_NS)
        seen = len(shown)
        wait_for(lambda: len(shown) > seen + 2, "time to say it again")
        assert len(said) == count
    keys = recorded_keys(path)
    assert keys.count("post/p/order") == 1
    assert keys.count("post/p/order_answer") == 1
    assert keys.count("post/commander/order_request") == 1
    assert keys.count("responder/r1/order_reply") == 1
