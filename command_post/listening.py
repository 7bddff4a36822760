"""Addresses that the post's HTTP is served at."""

from __future__ import annotations

import ipaddress
import re
from typing import NamedTuple

_ADDRESS = re.compile(r"(?P<host>\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+):(?P<port>\d{1,5})")


class Address(NamedTuple):
    """Where to listen."""

    host: str
    port: int

    @property
    def is_local(self) -> bool:
        """Whether it is reached from this machine alone."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False


def listening_address(option: str, text: str, example: str) -> Address:
    """Return the address in ``option HOST:PORT``; ``ValueError`` for a malformed one."""
    parts = _ADDRESS.fullmatch(text)
    if parts is None or int(parts["port"]) > 65_535:
        raise ValueError(f"{option} {text!r}: write HOST:PORT, as in {example}")
    return Address(parts["host"].strip("[]"), int(parts["port"]))
