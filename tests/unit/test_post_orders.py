"""The post issues orders, says them again until they are acknowledged, and records them once."""

from __future__ import annotations

from pathlib import Path
from threading import Event

import pytest
from msgspec import structs

from command_post.desks.orders import REPEAT_NS
from command_post.recorder.file import RecordingFile
from shared.bus.interface import Received
from shared.bus.memory import MemoryNetwork
from shared.codec import encode
from shared.messages import NodeHealth, Order, OrderAnswer, OrderReply, OrderRequest
from shared.topics import alive_key
from tests.heard import message_in
from tests.unit.test_post import NOW_NS, key, recorded_keys, serving
from tests.waiting import wait_for


def health() -> bytes:
    return encode(NodeHealth(event_time_ns=NOW_NS, sequence=0, level="ok", findings=()))


def test_an_order_is_said_again_until_it_is_acknowledged(tmp_path: Path) -> None:
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
        order, *again = map(message_in, said)
        assert isinstance(order, Order)
        assert again[:2] == [
            structs.replace(order, said_ns=NOW_NS + repeat * (REPEAT_NS + 1)) for repeat in (1, 2)
        ]
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


def test_an_order_goes_out_at_once_and_is_answered_when_a_power_cut_would_not_take_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk_works, sync, synced = Event(), RecordingFile.sync, list[int]()
    disk_works.set()

    def synced_once_it_works(file: RecordingFile) -> None:
        disk_works.wait()
        sync(file)
        synced.append(file.synced_bytes)

    monkeypatch.setattr(RecordingFile, "sync", synced_once_it_works)
    orders, answers = list[Received](), list[tuple[Received, int]]()
    path = tmp_path / "a.mcap"
    with serving(MemoryNetwork(), path) as (other, _, shown):
        other.subscribe(key("order", "post", "p"), orders.append)
        other.subscribe(
            key("order_answer", "post", "p"), lambda got: answers.append((got, synced[-1]))
        )
        other.publish(key("health"), health())
        wait_for(lambda: shown and shown[-1].responders, "the responder in the roster")
        disk_works.clear()
        wanted = OrderRequest(event_time_ns=NOW_NS, sequence=4, kind="evacuate", to=(), text="")
        other.publish(key("order_request", "post", "commander"), encode(wanted))
        wait_for(lambda: orders, "the order")
        seen = len(shown)
        wait_for(lambda: len(shown) > seen + 2, "time to answer")
        assert not answers
        disk_works.set()
        wait_for(lambda: answers, "the answer")
    (received, kept_bytes), *more = answers
    answer = message_in(received)
    assert isinstance(answer, OrderAnswer)
    assert (answer.request_sequence, answer.refusal, answer.waited_for, more) == (
        4,
        None,
        ("r1",),
        [],
    )
    kept = tmp_path / "kept.mcap"
    kept.write_bytes(path.read_bytes()[:kept_bytes])
    assert "post/p/order" in recorded_keys(kept)
