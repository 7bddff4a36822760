"""The air carries what its links carry, and no more."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.faults.air import Air, Channel, Link, why_no_air

NO_AIR = why_no_air()
pytestmark = pytest.mark.skipif(NO_AIR is not None, reason=str(NO_AIR))

LISTEN = """
import socket
server = socket.create_server(("0.0.0.0", 7000))
print("ready", flush=True)
near, _ = server.accept()
size = 0
while data := near.recv(65536):
    size += len(data)
near.sendall(str(size).encode())
"""
SEND = """
import socket, sys, time
with socket.create_connection((sys.argv[1], 7000), timeout=20) as far:
    begun = time.monotonic()
    far.sendall(bytes(int(sys.argv[2])))
    far.shutdown(socket.SHUT_WR)
    print(int(far.recv(100)), time.monotonic() - begun)
"""


def send(air: Air, size: int) -> tuple[int, float]:
    """Send so many bytes from ``a`` to ``b`` over TCP; return how many came, and in what time."""
    listening = air.start("b", [sys.executable, "-c", LISTEN], stdout=subprocess.PIPE)
    assert listening.stdout is not None
    assert listening.stdout.readline() == b"ready\n"
    sending = air.start(
        "a", [sys.executable, "-c", SEND, air.address("b"), str(size)], stdout=subprocess.PIPE
    )
    said, _ = sending.communicate(timeout=60)
    listening.communicate(timeout=60)
    came, seconds = said.split()
    return int(came), float(seconds)


def test_tcp_gets_through_loss_and_delay() -> None:
    with Air(["a", "b"]) as air:
        air.link("a", "b", Link(delay_s=0.01, loss=0.1))
        came, _ = send(air, 100_000)
    assert came == 100_000
    assert air.lost > 0


def test_a_channel_has_its_rate() -> None:
    with Air(["a", "b"]) as air:
        air.link("a", "b", Link(channel=Channel(bit_per_s=1_000_000)))
        came, seconds = send(air, 125_000)
    assert came == 125_000
    assert seconds > 0.9


def test_who_is_not_linked_is_not_heard() -> None:
    with Air(["a", "b", "c"]) as air:
        air.link("a", "b")
        air.cut("a", "b")
        listening = air.start("b", [sys.executable, "-c", LISTEN], stdout=subprocess.PIPE)
        sending = air.start(
            "a",
            [
                sys.executable,
                "-c",
                SEND.replace("timeout=20", "timeout=0.5"),
                air.address("b"),
                "1",
            ],
            stderr=subprocess.PIPE,
        )
        _, complaint = sending.communicate(timeout=60)
        listening.kill()
        listening.communicate()
    assert b"TimeoutError" in complaint or b"timed out" in complaint
