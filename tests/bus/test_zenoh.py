"""What only a network can break: start order, restarts, dead links, and the end of a process."""

from __future__ import annotations

import itertools
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
from structlog.testing import capture_logs

from shared.bus.interface import Received
from shared.bus.loopback import free_ports
from shared.bus.zenoh_bus import ZenohBus, open_zenoh
from tests.bus.relay import Relay
from tests.bus.settling import settle
from tests.waiting import DEADLINE_S, wait_for


def free_endpoint() -> str:
    """Return an endpoint on which nobody listens yet."""
    (port,) = free_ports(1)
    return f"tcp/127.0.0.1:{port}"


def port_of(endpoint: str) -> int:
    return int(endpoint.rpartition(":")[2])


@pytest.fixture
def opened() -> Iterator[ExitStack]:
    """Close what is entered, the last first: clients before their router."""
    with ExitStack() as stack:
        yield stack


def test_a_router_tells_the_port_it_was_given(opened: ExitStack) -> None:
    router = opened.enter_context(open_zenoh("router", listen=["tcp/127.0.0.1:0"]))
    (locator,) = router.locators()
    assert locator.startswith("tcp/127.0.0.1:")
    socket.create_connection(("127.0.0.1", port_of(locator))).close()
    client = opened.enter_context(open_zenoh("client", connect=[locator]))
    wait_for(client.connected, "the client to connect")
    assert client.locators() == ()


def test_a_client_may_start_before_its_router(opened: ExitStack) -> None:
    endpoint = free_endpoint()
    client = ZenohBus("client", [endpoint], [])
    heard: list[Received] = []
    client.subscribe("clew/down", heard.append)
    client.answer("clew/state", lambda _: b"here")
    client.declare_alive("clew/alive")
    client.publish("clew/up", b"unheard")
    assert client.unsent == 1
    assert not client.connected()
    assert client.query("clew/**", timeout_s=5.0) == []

    router = opened.enter_context(open_zenoh("router", listen=[endpoint]))
    opened.enter_context(client)
    alive: list[tuple[str, bool]] = []
    router.watch_alive("clew/**", lambda key, is_alive: alive.append((key, is_alive)))
    wait_for(lambda: alive == [("clew/alive", True)], "the client's token")
    wait_for(lambda: router.query("clew/state", timeout_s=5.0), "the client's answer")
    settle(router, client)
    router.publish("clew/down", b"1")
    wait_for(lambda: heard == [Received("clew/down", b"1")], "the client to hear")
    assert client.unsent == 1


def test_a_client_is_back_after_its_router_restarts(opened: ExitStack) -> None:
    endpoint = free_endpoint()
    router = open_zenoh("router", listen=[endpoint])
    near = opened.enter_context(open_zenoh("client", connect=[endpoint]))
    far = opened.enter_context(open_zenoh("client", connect=[endpoint]))
    heard: list[bytes] = []
    alive: list[tuple[str, bool]] = []
    far.subscribe("clew/x", lambda received: heard.append(received.payload))
    far.watch_alive("clew/**", lambda key, is_alive: alive.append((key, is_alive)))
    near.declare_alive("clew/near")
    near.answer("clew/state", lambda _: b"here")
    settle(near, far)
    near.publish("clew/x", b"before")
    wait_for(lambda: heard == [b"before"] and alive == [("clew/near", True)], "the first router")

    router.close()
    wait_for(lambda: alive[1:] == [("clew/near", False)], "the token to go")
    near.publish("clew/x", b"lost")
    with open_zenoh("router", listen=[endpoint]):
        wait_for(lambda: alive[2:] == [("clew/near", True)], "the token to come back")
        wait_for(lambda: far.query("clew/state", timeout_s=5.0), "the answer to come back")
        settle(near, far)
        near.publish("clew/x", b"after")
        wait_for(lambda: heard[1:] == [b"after"], "what is published after")
        near.close()
        far.close()


@pytest.mark.parametrize("order", list(itertools.permutations(["post", "dap", "agent"])))
def test_a_chain_of_routers_in_any_start_order(opened: ExitStack, order: tuple[str, ...]) -> None:
    post_endpoint, dap_endpoint = free_endpoint(), free_endpoint()
    programs: dict[str, Callable[[], ZenohBus]] = {
        "post": lambda: open_zenoh("router", listen=[post_endpoint]),
        "dap": lambda: open_zenoh("router", connect=[post_endpoint], listen=[dap_endpoint]),
        "agent": lambda: open_zenoh("client", connect=[dap_endpoint]),
    }
    started = {name: programs[name]() for name in order}
    post, dap, agent = (opened.enter_context(started[name]) for name in programs)
    heard: dict[str, list[bytes]] = {"post": [], "agent": []}
    post.subscribe("clew/up", lambda received: heard["post"].append(received.payload))
    agent.subscribe("clew/down", lambda received: heard["agent"].append(received.payload))
    agent.answer("clew/state", lambda _: b"inside")
    alive: list[tuple[str, bool]] = []
    post.watch_alive("clew/**", lambda key, is_alive: alive.append((key, is_alive)))
    agent.declare_alive("clew/agent")
    dap.declare_alive("clew/dap")

    settle(agent, post)
    settle(post, agent)
    agent.publish("clew/up", b"step")
    post.publish("clew/down", b"place")
    wait_for(lambda: heard == {"post": [b"step"], "agent": [b"place"]}, "both directions")
    wait_for(
        lambda: sorted(alive) == [("clew/agent", True), ("clew/dap", True)],
        "the tokens at the post",
    )
    wait_for(lambda: post.query("clew/**", timeout_s=5.0), "an answer through the chain")


def test_a_client_changes_to_another_router(opened: ExitStack) -> None:
    post = opened.enter_context(open_zenoh("router", listen=["tcp/127.0.0.1:0"]))
    endpoints = [free_endpoint(), free_endpoint()]

    def start_dap(endpoint: str) -> ZenohBus:
        dap = open_zenoh("router", connect=post.locators(), listen=[endpoint])
        return opened.enter_context(dap)

    daps = [start_dap(endpoint) for endpoint in endpoints]
    agent = open_zenoh("client", connect=endpoints)
    with agent:
        settle(agent, post)
        for dap, endpoint in zip(daps, endpoints, strict=True):
            dap.close()
            settle(agent, post)
            start_dap(endpoint)


def test_a_client_leaves_a_router_that_falls_silent(
    opened: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Be it the first or the last of those it dials; what it has declared comes along."""
    monkeypatch.setattr("shared.bus.zenoh_settings.LEASE_MS", 400)
    post = opened.enter_context(open_zenoh("router", listen=["tcp/127.0.0.1:0"]))
    relays = [opened.enter_context(Relay(port_of(post.locators()[0]))) for _ in range(2)]
    agent = open_zenoh("client", connect=[f"tcp/127.0.0.1:{relay.port}" for relay in relays])
    opened.enter_context(agent)
    heard: list[bytes] = []
    agent.subscribe("clew/down", lambda received: heard.append(received.payload))
    agent.answer("clew/state", lambda _: b"here")
    alive: list[tuple[str, bool]] = []
    post.watch_alive("clew/**", lambda key, is_alive: alive.append((key, is_alive)))
    agent.declare_alive("clew/agent")
    found: list[bool] = []
    agent.on_link(lambda: found.append(agent.connected()))
    settle(agent, post)
    wait_for(lambda: relays[1].connections, "a link in reserve")
    for number, relay in enumerate(relays, 1):
        found.clear()
        relay.stall()
        wait_for(lambda: not agent.connected(), "the dead link to be found")
        wait_for(lambda: found == [True], "the other router")
        assert relay is relays[1] or relays[1].connections == 1, "not the link in reserve"
        relay.resume()
        settle(agent, post)
        settle(post, agent)
        post.publish("clew/down", str(number).encode())
        wait_for(lambda: heard == [b"1", b"2"][:number], "the agent to hear, and once")  # noqa: B023
        wait_for(lambda: len(post.query("clew/state", timeout_s=5.0)) == 1, "one answer")
        wait_for(lambda: alive and alive[-1] == ("clew/agent", True), "the token to stay")


@pytest.mark.parametrize("lost", [0, 1])
def test_a_ring_of_routers_that_loses_a_link(
    opened: ExitStack, monkeypatch: pytest.MonkeyPatch, lost: int
) -> None:
    """Whichever falls silent, who is behind it is heard the other way round."""
    monkeypatch.setattr("shared.bus.zenoh_settings.LEASE_MS", 400)
    post = opened.enter_context(open_zenoh("router", listen=["tcp/127.0.0.1:0"]))
    relays = [opened.enter_context(Relay(port_of(post.locators()[0]))) for _ in range(2)]
    ends = [free_endpoint() for _ in relays]
    for relay, end in zip(relays, ends, strict=True):
        dialled = [f"tcp/127.0.0.1:{relay.port}"]
        dap = opened.enter_context(open_zenoh("router", connect=dialled, listen=[end]))
        settle(dap, post)
    far = opened.enter_context(open_zenoh("router", connect=ends, listen=["tcp/127.0.0.1:0"]))
    agent = opened.enter_context(open_zenoh("client", connect=far.locators()))
    settle(agent, post)
    relays[lost].stall()
    settle(agent, post)
    settle(post, agent)


def test_a_dead_link_is_found_and_does_not_hold_the_close(opened: ExitStack) -> None:
    router = opened.enter_context(open_zenoh("router", listen=["tcp/127.0.0.1:0"]))
    relay = opened.enter_context(Relay(port_of(router.locators()[0])))
    client = open_zenoh("client", connect=[f"tcp/127.0.0.1:{relay.port}"])
    alive: list[tuple[str, bool]] = []
    sunk: list[str] = []
    router.watch_alive("clew/**", lambda key, is_alive: alive.append((key, is_alive)))
    router.subscribe("clew/x", lambda received: sunk.append(received.key))
    client.declare_alive("clew/agent")
    wait_for(lambda: alive == [("clew/agent", True)], "the token")
    settle(client, router)

    relay.stall()
    for _ in range(20_000):  # more than the link's buffers hold
        client.publish("clew/x", bytes(1000))
    with capture_logs() as logs:
        client.close()
    assert [entry["event"] for entry in logs] == [
        "a link does not take our goodbye and is left to itself"
    ]
    wait_for(lambda: alive[1:] == [("clew/agent", False)], "the lease to run out")


NODE = """
import sys
import threading
from shared.bus.zenoh_bus import open_zenoh
from shared.process import configure_logging, stop_on_signals
configure_logging("warning")
mode, endpoint = sys.argv[1:]
ends = {"connect": [endpoint]} if mode == "client" else {"listen": [endpoint]}
with stop_on_signals() as stop, open_zenoh(mode, **ends) as bus:
    bus.subscribe("clew/**", lambda received: None)
    bus.answer("clew/state", lambda _: b"here")
    bus.declare_alive("clew/node")
    bus.watch_alive("clew/**", lambda key, alive: None)
    print("ready", flush=True)
    while not stop.wait(0.01):
        bus.publish("clew/x", b"")
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    ("mode", "finds_router"), [("router", False), ("client", True), ("client", False)]
)
def test_a_process_ends_cleanly_on_a_signal(
    opened: ExitStack, number: signal.Signals, mode: str, finds_router: bool
) -> None:
    router = opened.enter_context(open_zenoh("router", listen=["tcp/127.0.0.1:0"]))
    endpoint = router.locators()[0] if finds_router else free_endpoint()
    with subprocess.Popen(
        [sys.executable, "-c", NODE, mode, endpoint],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            if finds_router:
                wait_for(lambda: router.query("clew/state", timeout_s=5.0), "the client's answer")
            process.send_signal(number)
            output, errors = process.communicate(timeout=DEADLINE_S)
        finally:
            process.kill()
    assert (process.returncode, output, errors) == (0, "", "")


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp/0.0.0.0:7447",
        "tcp/[::]:7447",
        "tcp/192.168.1.4:7447",
        "tcp/localhost:7447",
        "tcp/commandpost.local:7447",
    ],
)
def test_listening_beyond_this_machine_is_refused(endpoint: str) -> None:
    with pytest.raises(ValueError, match="only this machine is dialled or listened on"):
        open_zenoh("router", listen=[endpoint])


@pytest.mark.parametrize(
    "endpoint",
    ["127.0.0.1:7447", "udp/127.0.0.1:7447", "tcp/127.0.0.1", "tcp/h:65536", "tcp/h:1#a=b"],
)
def test_malformed_endpoints_are_refused(endpoint: str) -> None:
    for connect, listen in (([endpoint], []), ([], [endpoint])):
        with pytest.raises(ValueError, match="write tcp/HOST:PORT"):
            open_zenoh("router", connect, listen)


def test_a_client_needs_a_router_and_does_not_listen() -> None:
    with pytest.raises(ValueError, match="only 'connect'"):
        open_zenoh("client")
    with pytest.raises(ValueError, match="only 'connect'"):
        open_zenoh("client", connect=["tcp/127.0.0.1:1"], listen=["tcp/127.0.0.1:0"])


def test_a_port_in_use_is_told(opened: ExitStack) -> None:
    router = opened.enter_context(open_zenoh("router", listen=["tcp/127.0.0.1:0"]))
    with pytest.raises(OSError, match=r"cannot listen on tcp/127\.0\.0\.1:.*use another port"):
        open_zenoh("router", listen=router.locators())


def test_a_question_that_waits_is_broken_off(opened: ExitStack) -> None:
    router = opened.enter_context(open_zenoh("router", listen=["tcp/127.0.0.1:0"]))
    (locator,) = router.locators()
    client = opened.enter_context(open_zenoh("client", connect=[locator]))
    wait_for(client.connected, "the client to connect")
    asked, answers = threading.Event(), threading.Event()

    def answer(_request: bytes) -> bytes:
        asked.set()
        answers.wait(DEADLINE_S)
        return b"late"

    router.answer("clew/state", answer)
    heard: list[list[Received]] = []

    def ask() -> None:
        while not asked.is_set():
            heard.append(client.query("clew/state", 10.0 * DEADLINE_S))

    asker = threading.Thread(target=ask)
    asker.start()
    assert asked.wait(DEADLINE_S)
    client.ask_no_more()
    asker.join(DEADLINE_S)
    assert not asker.is_alive()
    assert heard[-1] == []
    answers.set()
