"""How Zenoh is set up: whom to dial, where to listen, with what certificates (pure).

Multicast and gossip are off: whom to dial is configured. A lease of 1.6 s finds a dead link in
1.2 to 1.6 s (each side applies the lease the other announces, and hears from it four times in
that time). With a bundle every link is TLS, with certificates of our authority at both ends and the
dialled name held against the other's.
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

from shared.security.access import access_control
from shared.security.bundle import AUTHORITY_FILE, CERTIFICATE_FILE, KEY_FILE, Bundle
from shared.security.certificates import Identity

Mode: TypeAlias = Literal["router", "client"]

OPEN_LINK_MS = 2500
"""Over TLS a link is open after some four times what there and back takes."""

OPEN_RESERVE_MS = 1800
"""Who has a link does not wait longer for another: nor does their program, when it is to end."""

LEASE_MS = 1600
LONGEST_MESSAGE_BYTES = 1 << 20
"""What is longer never reaches us: Zenoh drops it before it has come in whole."""

SEND_BUFFER_BYTES = 16_384
"""What waits for a narrow link waits where Zenoh sorts it by priority, not behind it in TCP."""


_ENDPOINT = re.compile(
    r"(?P<protocol>tcp|tls)/(?P<host>\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+):(?P<port>\d{1,5})"
)


def check_endpoint(endpoint: str, bundle: Bundle | None, option: str = "--listen") -> None:
    """Raise ``ValueError`` for an endpoint that is malformed, or that is not safe.

    Without a bundle links are neither encrypted nor authenticated, so none leaves this machine.
    ``option`` is what gives it on every command line.
    """
    protocol = "tcp" if bundle is None else "tls"
    parts = _ENDPOINT.fullmatch(endpoint)
    if parts is None or int(parts["port"]) > 65_535:
        raise ValueError(
            f"{option} {endpoint!r}: write {protocol}/HOST:PORT, as in {protocol}/127.0.0.1:7447"
        )
    if bundle is None and not _is_loopback(parts["host"].strip("[]")):
        raise ValueError(
            f"{option} {endpoint!r}: without --keys nothing is encrypted or authenticated, so "
            "only this machine is dialled or listened on; use tcp/127.0.0.1:PORT, or keys"
        )
    if parts["protocol"] != protocol:
        why = "with --keys all links are TLS" if bundle else "TLS needs --keys FOLDER"
        raise ValueError(f"{option} {endpoint!r}: {why}; write {protocol}/HOST:PORT")


def check_dialled(endpoint: str, bundle: Bundle | None) -> None:
    """Raise ``ValueError`` for an endpoint that ``check_endpoint`` refuses or none can dial."""
    check_endpoint(endpoint, bundle, "--connect")
    if bundle is not None and "[" in endpoint:
        raise ValueError(
            f"--connect {endpoint!r}: Zenoh cannot dial an IPv6 address over TLS; "
            "use an IPv4 address, or a name"
        )


def session_settings(
    mode: Mode, connect: Sequence[str], listen: Sequence[str], bundle: Bundle | None
) -> dict[str, Any]:
    """Return a session's settings, as Zenoh's configuration file would have them."""
    client = mode == "client"
    link: dict[str, Any] = {
        "tx": {"lease": LEASE_MS},
        "rx": {"max_message_size": LONGEST_MESSAGE_BYTES},
        "tcp": {"so_sndbuf": SEND_BUFFER_BYTES},
    }
    settings: dict[str, Any] = {
        "mode": mode,
        "scouting": {
            "multicast": {"enabled": False},
            "gossip": {"enabled": False},
            "delay": 0,
        },
        "listen": {"endpoints": list(listen)},
        "connect": {
            "endpoints": list(connect),
            # A router opens at once and dials behind; a client tries once, as -1 makes it deaf
            # to signals.
            "timeout_ms": 0 if client else -1,
            "exit_on_failure": client,
            "retry": {
                "period_init_ms": 200,
                "period_max_ms": 1000,
                "period_increase_factor": 1.5,
            },
        },
        "transport": {
            "shared_memory": {"enabled": False},
            "unicast": {"open_timeout": OPEN_LINK_MS},
            "link": link,
        },
        # Where a router says which port it was given.
        "adminspace": {"enabled": not client, "permissions": {"read": True, "write": False}},
    }
    if bundle is not None:
        link["protocols"] = ["tls"]
        link["tls"] = _tls(mode, bundle)
        if not client:
            named = [Identity(node.role, node.id) for node in bundle.nodes.nodes]
            settings["access_control"] = access_control(bundle.identity, named)
    return settings


def _tls(mode: Mode, bundle: Bundle) -> dict[str, Any]:
    certificate, key = bundle.path(CERTIFICATE_FILE), bundle.path(KEY_FILE)
    dialling = {"connect_certificate": certificate, "connect_private_key": key}
    listening = {"listen_certificate": certificate, "listen_private_key": key}
    return {
        "so_sndbuf": SEND_BUFFER_BYTES,
        "root_ca_certificate": bundle.path(AUTHORITY_FILE),
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
        **dialling,
        **(listening if mode == "router" else {}),
    }


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
