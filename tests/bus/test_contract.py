"""What a program may rely on, whatever the transport."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from structlog.testing import capture_logs

from shared.bus.interface import Bus, BusClosedError, Received
from shared.bus.memory import MemoryBus, MemoryNetwork
from shared.bus.zenoh_bus import ZenohBus, open_zenoh
from tests.bus.settling import settle
from tests.waiting import wait_for

AnyBus = MemoryBus | ZenohBus


@pytest.fixture(params=["memory", "zenoh"])
def connect(request: pytest.FixtureRequest) -> Iterator[Callable[[], AnyBus]]:
    """Give a function that returns one more bus on a network of the test's own."""
    with ExitStack() as opened:
        if request.param == "memory":
            network = MemoryNetwork()
            yield lambda: opened.enter_context(network.connect())
        else:
            router = opened.enter_context(open_zenoh("router", listen=["tcp/127.0.0.1:0"]))
            locators = router.locators()
            yield lambda: opened.enter_context(open_zenoh("client", connect=locators))


Connect = Callable[[], AnyBus]


def listen(bus: Bus, key_expression: str) -> list[Received]:
    heard: list[Received] = []
    bus.subscribe(key_expression, heard.append)
    return heard


def test_what_is_published_is_heard_under_its_key(connect: Connect) -> None:
    near, far = connect(), connect()
    heard = listen(far, "clew/v1/i/responder/r1/increment")
    settle(near, far)
    near.publish("clew/v1/i/responder/r1/increment", b"\x00step\xff", "high")
    near.publish("clew/v1/i/responder/r1/increment", b"", "low")
    wait_for(lambda: len(heard) == 2, "both messages")
    assert sorted(heard) == [
        Received("clew/v1/i/responder/r1/increment", b""),
        Received("clew/v1/i/responder/r1/increment", b"\x00step\xff"),
    ]


def test_a_bus_hears_itself(connect: Connect) -> None:
    bus = connect()
    heard = listen(bus, "clew/own")
    settle(bus, bus)
    bus.publish("clew/own", b"1")
    wait_for(lambda: heard, "the bus's own message")
    assert heard == [Received("clew/own", b"1")]


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("clew/*/i/**", ["clew/v1/i/dap/d1/rssi", "clew/v1/i/dap/d2/rssi", "clew/v2/i"]),
        ("clew/v1/i/dap/*/rssi", ["clew/v1/i/dap/d1/rssi", "clew/v1/i/dap/d2/rssi"]),
        ("clew/v1/i/dap/d1/*", ["clew/v1/i/dap/d1/rssi"]),
        ("**/rssi", ["clew/v1/i/dap/d1/rssi", "clew/v1/i/dap/d2/rssi", "clew/v1/j/dap/d1/rssi"]),
        ("clew/v1/i/dap", []),
    ],
)
def test_wildcards(connect: Connect, expression: str, expected: list[str]) -> None:
    near, far = connect(), connect()
    heard = listen(far, expression)
    last = listen(far, "last")
    settle(near, far)
    for key in (
        "clew/v1/i/dap/d1/rssi",
        "clew/v1/i/dap/d2/rssi",
        "clew/v1/j/dap/d1/rssi",
        "clew/v2/i",
        "clew",
    ):
        near.publish(key, b"")
    near.publish("last", b"")
    wait_for(lambda: len(heard) == len(expected) and last, "the messages")
    assert [received.key for received in heard] == expected


def test_order_is_kept(connect: Connect) -> None:
    near, far = connect(), connect()
    heard = listen(far, "clew/count")
    settle(near, far)
    sent: list[Received] = []
    for _ in range(20):
        for _ in range(50):  # few enough to fit the link's queue
            sent.append(Received("clew/count", str(len(sent)).encode()))
            near.publish(*sent[-1])
        wait_for(lambda: len(heard) == len(sent), "all messages so far")
    assert heard == sent


def test_a_late_subscriber_hears_nothing_old(connect: Connect) -> None:
    near, far, late = connect(), connect(), connect()
    heard = listen(far, "clew/x")
    settle(near, far)
    near.publish("clew/x", b"old")
    wait_for(lambda: heard, "the first subscriber to hear")
    heard_late = listen(late, "clew/x")
    settle(near, late)
    near.publish("clew/x", b"new")
    wait_for(lambda: heard_late, "the late subscriber to hear")
    assert heard_late == [Received("clew/x", b"new")]


def test_a_query_gathers_all_answers(connect: Connect) -> None:
    asking, first, second = connect(), connect(), connect()
    silent_asked: list[bool] = []
    first.answer("clew/state/silent", lambda _: silent_asked.append(True))
    first.answer("clew/state/r1", lambda _: b"one")
    second.answer("clew/state/r2", lambda _: b"two")
    second.answer("clew/other", lambda _: b"not asked")
    expected = [Received("clew/state/r1", b"one"), Received("clew/state/r2", b"two")]
    wait_for(
        lambda: sorted(asking.query("clew/state/*", timeout_s=5.0)) == expected, "both answers"
    )
    assert silent_asked
    assert asking.query("clew/state/silent", timeout_s=5.0) == []
    assert asking.query("clew/nobody", timeout_s=5.0) == []


def test_two_who_answer_under_one_key_are_both_heard(connect: Connect) -> None:
    asking, first, second = connect(), connect(), connect()
    first.answer("clew/state", lambda _: b"one")
    second.answer("clew/state", lambda _: b"two")
    expected = [Received("clew/state", b"one"), Received("clew/state", b"two")]
    wait_for(lambda: sorted(asking.query("clew/*", timeout_s=5.0)) == expected, "both answers")


def test_an_answerer_that_fails_is_no_answer(connect: Connect) -> None:
    asking, answering = connect(), connect()

    def fail(_: bytes) -> bytes:
        raise LookupError("nothing yet")

    answering.answer("clew/state/r1", fail)
    answering.answer("clew/state/r2", lambda _: b"two")
    with capture_logs():
        wait_for(lambda: asking.query("clew/state/*", timeout_s=5.0), "an answer")
        assert asking.query("clew/state/*", timeout_s=5.0) == [Received("clew/state/r2", b"two")]
    assert answering.handler_failures > 0


def test_tokens_come_and_go(connect: Connect) -> None:
    watching, early, late = connect(), connect(), connect()
    seen: list[tuple[str, bool]] = []
    early.declare_alive("clew/i/dap/d1")
    watching.watch_alive("clew/i/**", lambda key, alive: seen.append((key, alive)))
    wait_for(lambda: seen == [("clew/i/dap/d1", True)], "a token held before")
    late.declare_alive("clew/i/dap/d2")
    late.declare_alive("clew/elsewhere/d3")
    wait_for(lambda: seen[1:] == [("clew/i/dap/d2", True)], "a token that comes")
    early.close()
    wait_for(lambda: seen[2:] == [("clew/i/dap/d1", False)], "a token that goes")
    late.close()
    wait_for(lambda: seen[3:] == [("clew/i/dap/d2", False)], "the last token to go")


def test_a_token_goes_when_nobody_holds_it_any_more(connect: Connect) -> None:
    watching, one, other = connect(), connect(), connect()
    seen: list[tuple[str, bool]] = []
    watching.watch_alive("clew/**", lambda key, alive: seen.append((key, alive)))
    one.declare_alive("clew/shared")
    other.declare_alive("clew/shared")
    other.declare_alive("clew/other")
    wait_for(lambda: len(seen) == 2, "both tokens")
    one.close()
    other.close()
    wait_for(lambda: len(seen) == 4, "both tokens to go")
    assert sorted(seen[:2]) == [("clew/other", True), ("clew/shared", True)]
    assert sorted(seen[2:]) == [("clew/other", False), ("clew/shared", False)]


def test_a_handler_that_fails_harms_nobody(connect: Connect) -> None:
    near, far = connect(), connect()
    tried: list[bytes] = []

    def fail(received: Received) -> None:
        tried.append(received.payload)
        raise ValueError("a fault of the program")

    far.subscribe("clew/x", fail)
    heard = listen(far, "clew/x")
    settle(near, far)
    with capture_logs() as logs:
        near.publish("clew/x", b"1")
        near.publish("clew/x", b"2")
        wait_for(lambda: far.handler_failures == 2 and len(heard) == 2, "both handlers")
    assert tried == [b"1", b"2"]
    assert [entry["role"] for entry in logs if entry["log_level"] == "error"] == [
        "subscriber to clew/x"
    ]


def test_nothing_happens_after_close(connect: Connect) -> None:
    near, far, other = connect(), connect(), connect()
    heard = listen(far, "clew/x")
    heard_other = listen(other, "clew/x")
    settle(near, far)
    settle(near, other)
    far.close()
    far.close()
    far.publish("clew/x", b"from the closed")
    near.publish("clew/x", b"to the closed")
    wait_for(lambda: heard_other, "the open one to hear")
    assert heard == []
    assert heard_other == [Received("clew/x", b"to the closed")]
    assert far.query("clew/**", timeout_s=1.0) == []


@pytest.mark.parametrize(
    "declare",
    [
        lambda bus: bus.subscribe("clew/x", print),
        lambda bus: bus.answer("clew/x", lambda _: None),
        lambda bus: bus.declare_alive("clew/x"),
        lambda bus: bus.watch_alive("clew/x", print),
    ],
)
def test_a_closed_bus_takes_no_declarations(
    connect: Connect, declare: Callable[[Bus], Any]
) -> None:
    bus = connect()
    bus.close()
    with pytest.raises(BusClosedError, match="closed"):
        declare(bus)


@pytest.mark.parametrize(
    "key", ["", "/clew", "clew/", "clew//x", "clew/*", "clew/a?b", "a#b", "$*"]
)
def test_malformed_keys_are_refused(connect: Connect, key: str) -> None:
    bus = connect()
    with pytest.raises(ValueError, match="key"):
        bus.publish(key, b"")
    with pytest.raises(ValueError, match="key"):
        bus.declare_alive(key)
    if "*" not in key:
        with pytest.raises(ValueError, match="key expression"):
            bus.subscribe(key, print)


def test_who_asks_no_more_finds_nobody(connect: Connect) -> None:
    answering, asking = connect(), connect()
    answering.answer("clew/state", lambda _: b"here")
    wait_for(lambda: asking.query("clew/state", timeout_s=5.0), "an answer")
    asking.ask_no_more()
    assert asking.query("clew/state", timeout_s=5.0) == []
