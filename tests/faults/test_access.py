"""What a router lets a node say and hear: its own and what is meant for it, and no more."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from shared.bus.zenoh_bus import ZenohBus, open_zenoh
from shared.security.access import ends_of
from shared.topics import ROLES, TOPICS, all_alive_of, everything_of
from tests.issued_keys import Keys
from tests.waiting import wait_for

OF = "clew/v1/fire"
R1, R2, DAP, POST = (f"{OF}/{node}" for node in
                     ("responder/r1", "responder/r2", "dap/dap1", "post/post"))  # fmt: skip


class Net:
    """A post, a DAP that dials it, and clients of either."""

    def __init__(self, keys: Keys, opened: ExitStack) -> None:
        self.keys = keys
        self._opened = opened
        self.post = self._router("post")
        self.dap = self._router("dap1", self.post.locators())
        wait_for(self.dap.connected, "the DAP to find the post")

    def client(self, name: str, of: ZenohBus) -> ZenohBus:
        """Return a client of the router ``of``, with the keys of ``name``."""
        client = open_zenoh("client", of.locators(), bundle=self.keys[name])
        self._opened.enter_context(client)
        wait_for(client.connected, f"{name} to find its router")
        return client

    def _router(self, name: str, dials: tuple[str, ...] = ()) -> ZenohBus:
        router = open_zenoh("router", dials, ["tls/127.0.0.1:0"], self.keys[name])
        return self._opened.enter_context(router)


@pytest.fixture
def net(tmp_path: Path) -> Iterator[Net]:
    with ExitStack() as opened:
        yield Net(Keys(tmp_path / "keys"), opened)


@pytest.fixture(params=["post", "dap"])
def router(request: pytest.FixtureRequest, net: Net) -> ZenohBus:
    """The router that the responders are clients of: the post itself, or a DAP before it."""
    return {"post": net.post, "dap": net.dap}[request.param]


def hears(bus: ZenohBus, key_expression: str) -> list[str]:
    """Return a list that fills with the keys that ``bus`` hears something under."""
    heard: list[str] = []
    bus.subscribe(key_expression, lambda received: heard.append(received.key))
    return heard


def said_until_heard(bus: ZenohBus, key: str, heard: list[str]) -> None:
    """Say ``key`` until it is heard; what the same node said before has come by then, or never."""

    def say() -> bool:
        bus.publish(key, b"")
        return key in heard

    wait_for(say, key)


def answers(bus: ZenohBus, key_expression: str, wanted: set[str]) -> None:
    """Ask until all ``wanted`` answer; fail if anybody else does."""

    def ask() -> bool:
        came = {received.key for received in bus.query(key_expression, timeout_s=5.0)}
        assert came <= wanted
        return came == wanted

    wait_for(ask, f"answers of {wanted}")


def test_a_responder_says_all_its_own_and_nothing_of_others(net: Net, router: ZenohBus) -> None:
    heard = hears(net.post, everything_of("fire"))
    r1 = net.client("r1", router)
    own = [f"{R1}/{name}" for name, topic in TOPICS.items() if "responder" in topic.roles]
    said_until_heard(r1, own[0], heard)
    forbidden = [f"{R2}/{own[0].rpartition('/')[2]}", f"{POST}/order", f"{DAP}/proximity",
                 f"{R1}/order", f"{R1}/weather", "clew/v2/fire/responder/r1/increment"]  # fmt: skip
    for _ in range(3):
        for key in (*forbidden, *own):
            r1.publish(key, b"")
    wait_for(lambda: set(own) <= set(heard), "all that is its own")
    said_until_heard(r1, f"{R1}/alarm", heard)
    assert set(heard) == set(own)


def test_a_responder_hears_what_is_meant_for_it_and_no_more(net: Net, router: ZenohBus) -> None:
    r1, r2 = net.client("r1", router), net.client("r2", router)
    heard = hears(r1, f"{OF}/post/*/order")
    spied = [hears(r1, spying) for spying in (everything_of("fire"), f"{R2}/**", f"{POST}/track")]
    by_post = hears(net.post, everything_of("fire"))
    said_until_heard(r2, f"{R2}/alarm", by_post)
    said_until_heard(net.post, f"{POST}/order", heard)
    net.post.publish(f"{POST}/track", b"")
    said_until_heard(r2, f"{R2}/increment", by_post)
    said_until_heard(net.dap, f"{DAP}/proximity", by_post)
    heard.clear()
    said_until_heard(net.post, f"{POST}/order", heard)
    assert {key for each in spied for key in each} <= {f"{POST}/order"}


def test_questions_reach_whom_they_may(net: Net, router: ZenohBus) -> None:
    r1, r2 = net.client("r1", router), net.client("r2", router)
    for bus, keys in ((r1, [f"{R1}/journal", f"{R1}/start", f"{R2}/certificate"]),
                      (r2, [f"{R2}/journal", f"{R2}/certificate"]),
                      (net.dap, [f"{DAP}/certificate", f"{POST}/time"]),
                      (net.post, [f"{POST}/time", f"{POST}/journal"])):  # fmt: skip
        for key in keys:
            bus.answer(key, lambda _: b"here")
    answers(net.post, f"{OF}/responder/*/journal", {f"{R1}/journal", f"{R2}/journal"})
    answers(net.post, f"{R1}/start", {f"{R1}/start"})
    answers(net.post, f"{OF}/*/*/certificate", {f"{R2}/certificate", f"{DAP}/certificate"})
    asker = net.client("r1", router)
    answers(asker, f"{OF}/post/*/time", {f"{POST}/time"})
    answers(asker, f"{POST}/journal", {f"{POST}/journal"})
    for forbidden in (f"{R2}/journal", f"{OF}/**", f"{DAP}/certificate", "clew/**"):
        assert asker.query(forbidden, timeout_s=5.0) == []


def test_tokens_are_held_by_their_own_nodes_alone(net: Net, router: ZenohBus) -> None:
    alive: list[tuple[str, bool]] = []
    net.post.watch_alive("clew/**", lambda key, is_alive: alive.append((key, is_alive)))
    r1 = net.client("r1", router)
    for key in (f"{R2}/alive", f"{POST}/alive", f"{R2}/finished", f"{R1}/alive", f"{R1}/finished"):
        r1.declare_alive(key)
    expected = [(f"{R1}/alive", True), (f"{R1}/finished", True)]
    wait_for(lambda: sorted(alive) == expected, "its own tokens, and no others")
    watcher = net.client("r2", router)
    seen: list[str] = []
    watcher.watch_alive(all_alive_of("fire"), lambda key, _: seen.append(key))
    posts: list[str] = []
    watcher.watch_alive(f"{OF}/post/*/alive", lambda key, _: posts.append(key))
    net.post.declare_alive(f"{POST}/alive")
    wait_for(lambda: posts == [f"{POST}/alive"], "the post's token")
    assert set(seen) <= set(posts)


def test_nobody_poses_as_the_router_itself(net: Net) -> None:
    heard = hears(net.post, everything_of("fire"))
    said_until_heard(net.dap, f"{DAP}/proximity", heard)
    net.dap.publish(f"{POST}/order", b"")
    net.dap.declare_alive(f"{POST}/alive")
    net.dap.publish(f"{R1}/alarm", b"")  # as a relay does: what it forges has no signature
    wait_for(lambda: f"{R1}/alarm" in heard, "what is relayed")
    assert f"{POST}/order" not in heard


def test_a_commander_speaks_through_a_dap(net: Net) -> None:
    heard = hears(net.post, everything_of("fire"))
    commander = net.client("commander", net.dap)
    said_until_heard(commander, f"{OF}/post/commander/fix", heard)
    at_commander = hears(commander, f"{OF}/post/*/track")
    said_until_heard(net.post, f"{POST}/track", at_commander)


def test_a_node_that_was_named_later_is_mute_until_the_router_is_told(tmp_path: Path) -> None:
    keys = Keys(tmp_path / "keys", ["post", "r1"])

    def is_heard(name: str, by: ZenohBus, heard: list[str]) -> Callable[[], bool]:
        client = opened.enter_context(open_zenoh("client", by.locators(), bundle=keys[name]))
        wait_for(client.connected, name)

        def say() -> bool:
            client.publish(f"{OF}/responder/{name}/alarm", b"")
            return f"{OF}/responder/{name}/alarm" in heard

        return say

    for told in (False, True):
        with (
            open_zenoh("router", (), ["tls/127.0.0.1:0"], keys["post"]) as post,
            ExitStack() as opened,
        ):
            heard = hears(post, everything_of("fire"))
            if not told:
                keys.issue("r3")
            late, named = is_heard("r3", post, heard), is_heard("r1", post, heard)
            if told:
                wait_for(late, "who was named before")
            late()
            wait_for(named, "who was named at first")
            assert late() is told


def test_every_key_that_anybody_speaks_under_is_known_here() -> None:
    assert {end for role in ROLES for end in ends_of(role)} >= set(TOPICS)
    assert "order" not in ends_of("responder")
    assert "time" not in ends_of("dap")


def test_a_responders_keys_cannot_listen(tmp_path: Path) -> None:
    keys = Keys(tmp_path / "keys", ["r1"])
    with pytest.raises(ValueError, match="only posts and DAPs listen"):
        open_zenoh("router", (), ["tls/127.0.0.1:0"], keys["r1"])
