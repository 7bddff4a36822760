"""How many increments a second get from one process into another, and what the codec costs."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgpack
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from shared.bus.inbox import Inbox
from shared.bus.interface import Received
from shared.bus.zenoh_bus import ZenohBus, open_zenoh
from shared.codec import Refusal, decode, encode, message_of, parse_key
from shared.messages import Message
from tests.benchmarks.increments import (
    ACKNOWLEDGED_EACH,
    KEY,
    READY_KEY,
    SEND_KEY,
    TAKEN_KEY,
    increment,
)
from tests.waiting import DEADLINE_S, wait_for

CHECKOUT = Path(__file__).resolve().parents[2]


@contextmanager
def publisher(post: ZenohBus) -> Iterator[None]:
    """Run the publishing process, connected to ``post``."""
    alive: list[tuple[str, bool]] = []
    post.watch_alive(READY_KEY, lambda key, is_alive: alive.append((key, is_alive)))
    command = [sys.executable, "-m", "tests.benchmarks.increments", *post.locators()]
    with subprocess.Popen(command, cwd=CHECKOUT, stdin=subprocess.PIPE) as process:
        try:
            wait_for(lambda: alive, "the publisher")
            yield
        finally:
            process.terminate()


def receive(post: ZenohBus, inbox: Inbox[Received], count: int) -> list[Message | Refusal]:
    """Have ``count`` increments sent; take them in as the command post does."""
    post.publish(SEND_KEY, str(count).encode())
    messages: list[Message | Refusal] = []
    acknowledged = 0
    while len(messages) < count:
        received = inbox.get_all(DEADLINE_S)
        assert received, f"{count - len(messages)} of {count} increments are missing"
        for key, payload in received:
            messages.append(message_of(key, payload))
            if len(messages) - acknowledged == ACKNOWLEDGED_EACH:
                acknowledged = len(messages)
                post.publish(TAKEN_KEY, str(acknowledged).encode())
    return messages


@pytest.mark.benchmark(group="bus")
def test_increments_from_process_to_process(benchmark: BenchmarkFixture) -> None:
    """Encode, publish, receive, decode: an agent's process to the post's, over loopback."""
    count = 50_000 if benchmark.enabled else 2_000
    inbox: Inbox[Received] = Inbox(count)
    with open_zenoh("router", listen=["tcp/127.0.0.1:0"]) as post:
        post.subscribe(KEY, inbox.put)
        with publisher(post):
            messages = benchmark.pedantic(  # type: ignore[no-untyped-call]
                receive, args=(post, inbox, count), rounds=5, warmup_rounds=1
            )
    assert messages == [increment(sequence) for sequence in range(count)]
    benchmark.extra_info["payload_bytes"] = len(encode(increment(0)))
    if benchmark.stats is not None:
        benchmark.extra_info["messages_per_s"] = round(count / benchmark.stats["median"])


@pytest.mark.benchmark(group="codec")
def test_codec(benchmark: BenchmarkFixture) -> None:
    """Encode an increment and decode it, with every bound checked."""
    message = increment(7)
    key = parse_key(KEY)
    assert not isinstance(key, Refusal)
    assert benchmark(lambda: decode(key, encode(message))) == message


@pytest.mark.benchmark(group="codec")
def test_codec_beside_msgpack(benchmark: BenchmarkFixture) -> None:
    """The named peer: the msgpack package, from a dict and to a dict, nothing checked."""
    fields = msgpack.unpackb(encode(increment(7)))
    assert benchmark(lambda: msgpack.unpackb(msgpack.packb(fields))) == fields
