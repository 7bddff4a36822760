"""Links: only nodes of our authority, with certificates that are valid now, get one."""

from __future__ import annotations

import socket
import ssl
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from datetime import timedelta
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from shared.bus.zenoh_bus import ZenohBus, open_zenoh
from shared.security.bundle import Bundle
from tests.issued_keys import Keys, identity, now
from tests.waiting import wait_for

KEY = "clew/v1/fire/responder/r1/alarm"
DAY = timedelta(days=1)


@pytest.fixture
def keys(tmp_path: Path) -> Keys:
    return Keys(tmp_path / "keys")


@pytest.fixture
def post(keys: Keys) -> Iterator[ZenohBus]:
    with open_zenoh("router", (), ["tls/127.0.0.1:0"], keys["post"]) as router:
        yield router


def port_of(router: ZenohBus) -> int:
    return int(router.locators()[0].rpartition(":")[2])


def assert_refused(locator: str, bundle: Bundle | None) -> None:
    """Dial until it has failed; nothing that was said gets anywhere."""
    with capture_logs() as logs, open_zenoh("client", [locator], bundle=bundle) as client:
        wait_for(lambda: any("no router answers" in each["event"] for each in logs), "a refusal")
        assert not client.connected()
        client.publish(KEY, b"")
        assert client.unsent == 1
    assert "PRIVATE" not in str(logs)


def assert_served(router: ZenohBus, bundle: Bundle, key: str = KEY) -> None:
    """A node that does nothing wrong is heard, whatever others have tried."""
    heard: list[str] = []
    router.subscribe(key, lambda received: heard.append(received.key))
    with open_zenoh("client", router.locators(), bundle=bundle) as client:

        def say() -> bool:
            client.publish(key, b"")
            return bool(heard)

        wait_for(say, "r1 to be heard")


def foreign(keys: Keys, folder: Path) -> Bundle:
    """Return keys for r1 that another authority of the same name has issued.

    They trust ours as well: a thief has seen what is public of it.
    """
    stranger = Keys(folder / "strangers", ["r1"])["r1"]
    bundle = stranger.folder
    other = (bundle / "authority.pem").read_bytes()
    ours = (keys["r1"].folder / "authority.pem").read_bytes()
    (bundle / "authority.pem").write_bytes(other + ours)
    return stranger


BAD: dict[str, Callable[[Keys, Path], Bundle]] = {
    "foreign": foreign,
    "expired": lambda keys, _: keys.date("r1", end=now() - DAY),
    "not yet valid": lambda keys, _: keys.date("r1", now() + DAY, now() + 2 * DAY),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_certificate_gets_no_link(
    keys: Keys, post: ZenohBus, tmp_path: Path, name: str
) -> None:
    good = keys["r2"]
    assert_refused(post.locators()[0], BAD[name](keys, tmp_path))
    assert good.identity == identity("r2")
    keys.date("r1")
    assert_served(post, keys["r1"])


def test_a_link_ends_with_its_certificate(keys: Keys, post: ZenohBus) -> None:
    bundle = keys.date("r1", end=now() + timedelta(seconds=3))
    with open_zenoh("client", post.locators(), bundle=bundle) as client:
        wait_for(client.connected, "the link")
        wait_for(lambda: not client.connected(), "the link to end")
        assert_served(post, keys["r2"], KEY.replace("r1", "r2"))


def test_without_certificate_or_encryption_there_is_no_link(keys: Keys, post: ZenohBus) -> None:
    port = port_of(post)
    assert_refused(f"tcp/127.0.0.1:{port}", None)
    for junk in (b"", b"GET / HTTP/1.0\r\n\r\n", bytes(100_000)):
        with socket.create_connection(("127.0.0.1", port)) as plain:
            plain.sendall(junk)
    trusting = ssl.create_default_context(cafile=str(keys["r1"].folder / "authority.pem"))
    with socket.create_connection(("127.0.0.1", port)) as plain, pytest.raises(ssl.SSLError) as no:  # noqa: SIM117
        with trusting.wrap_socket(plain, server_hostname="localhost") as nameless:
            nameless.recv(1)
    assert "CERTIFICATE_REQUIRED" in str(no.value)
    assert_served(post, keys["r1"])


@pytest.mark.parametrize("name", ["expired", "foreign"])
def test_a_router_is_held_to_the_same(keys: Keys, tmp_path: Path, name: str) -> None:
    impostor = Keys(tmp_path / "others")
    bundle = (
        impostor["post"] if name == "foreign" else keys.date("post", end=now() - DAY)
    )  # fmt: skip
    with open_zenoh("router", (), ["tls/127.0.0.1:0"], bundle) as router:
        assert_refused(router.locators()[0], keys["r1"])


def test_a_router_is_held_to_the_name_it_was_dialled_by(keys: Keys, post: ZenohBus) -> None:
    assert_refused(f"tls/127.0.0.2:{port_of(post)}", keys["r1"])


def test_a_responder_cannot_pass_for_a_router(keys: Keys) -> None:
    """Its certificate is for dialling alone, even where the program does not stop it."""
    with (
        ExitStack() as opened,
        pytest.MonkeyPatch.context() as patched,
    ):
        thief = keys["r2"]
        patched.setattr(
            "shared.security.bundle.Bundle.identity", identity("dap1")
        )  # what its program would say of itself
        router = opened.enter_context(open_zenoh("router", (), ["tls/127.0.0.1:0"], thief))
        assert_refused(router.locators()[0], keys["r1"])


@pytest.mark.parametrize(
    ("endpoint", "has_keys", "why"),
    [
        ("tcp/127.0.0.1:7447", True, "all links are TLS"),
        ("tls/127.0.0.1:7447", False, "needs --keys"),
        ("tcp/10.0.0.1:7447", False, "nothing is encrypted"),
        ("tls/10.0.0.1", True, "write tls/HOST:PORT"),
    ],
)
def test_endpoints_and_keys_go_together(
    keys: Keys, endpoint: str, has_keys: bool, why: str
) -> None:
    bundle = keys["dap1"] if has_keys else None
    for connect, listen in (([endpoint], []), ([], [endpoint])):
        with pytest.raises(ValueError, match=why):
            open_zenoh("router", connect, listen, bundle)


def test_an_ipv6_address_is_not_dialled_in_vain(keys: Keys) -> None:
    with pytest.raises(ValueError, match="cannot dial an IPv6 address"):
        open_zenoh("client", ["tls/[::1]:7447"], bundle=keys["r1"])
