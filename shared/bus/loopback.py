"""Ports of this machine, for programs that are started here and dial one another."""

from __future__ import annotations

import socket


def free_ports(count: int) -> list[int]:
    """Return ports of loopback that are free now, all held at once so that none comes twice."""
    held = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    try:
        return [int(each.getsockname()[1]) for each in held]
    finally:
        for each in held:
            each.close()


def free_port(wished: int) -> int:
    """Return the ``wished`` port of this machine, or another that is free if that one is taken."""
    with socket.socket() as one:
        try:
            one.bind(("127.0.0.1", wished))
        except OSError:
            return free_ports(1)[0]
    return wished
