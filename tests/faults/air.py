"""Air between nodes: network namespaces joined by radio that is slow, lossy, shared, or gone.

Each station is a network namespace with a tunnel device; a thread passes the IP packets between
them as the links say. So processes run as they are, over the kernel's own TCP. Needs root and
Linux; ``why_no_air`` says what is missing.
"""

from __future__ import annotations

import heapq
import os
import random
import selectors
import shutil
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

if sys.platform == "linux":
    import fcntl

_TUNSETIFF, _IFF_TUN, _IFF_NO_PI = 0x400454CA, 0x0001, 0x1000
_LONGEST_WAIT_S = 0.05
_MTU_BYTES = 1500


def why_no_air() -> str | None:
    """Return why namespaces cannot be had on this machine; ``None`` if they can."""
    if sys.platform != "linux":
        return "network namespaces are Linux's"
    if os.geteuid() != 0:
        return "network namespaces need root"
    if shutil.which("ip") is None:
        return "network namespaces need the command ip (package iproute2)"
    if not Path("/dev/net/tun").exists():
        return "network namespaces here need /dev/net/tun"
    probe = subprocess.run(
        ["ip", "netns", "add", _namespace("probe")], capture_output=True, check=False
    )
    if probe.returncode != 0:
        return f"no network namespace can be made: {probe.stderr.decode().strip()}"
    subprocess.run(["ip", "netns", "del", _namespace("probe")], check=True)
    return None


class Channel:
    """What several links share: one packet at a time, ``bytes_per_s`` fast, a queue before it."""

    def __init__(self, bit_per_s: float, longest_queue_s: float = 0.3) -> None:
        self._s_per_byte = 8.0 / bit_per_s
        self._longest_queue_s = longest_queue_s
        self._free_s = 0.0

    def pass_s(self, size_bytes: int, now_s: float) -> float | None:
        """Return when a packet that comes now is through; ``None`` if the queue is full."""
        begin_s = max(self._free_s, now_s)
        if begin_s - now_s > self._longest_queue_s:
            return None
        self._free_s = begin_s + size_bytes * self._s_per_byte
        return self._free_s


class Link(NamedTuple):
    """How packets go from one station to another."""

    delay_s: float = 0.001
    loss: float = 0.0
    channel: Channel | None = None


class _Flying(NamedTuple):
    due_s: float
    number: int
    tunnel: int
    packet: bytes


class Air:
    """Stations and the links between them. Leaving the ``with`` block removes every namespace."""

    def __init__(self, stations: Sequence[str], seed: int = 1) -> None:
        self._chance = random.Random(seed)  # noqa: S311
        self._address = {name: f"10.77.0.{n}" for n, name in enumerate(stations, 1)}
        self._tunnels: dict[str, int] = {}
        self._at: dict[bytes, str] = {}
        self._links: dict[tuple[str, str], Link] = {}
        self._flying: list[_Flying] = []
        self._number = 0
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._carry, name="air")
        self.lost = 0
        """How many packets were lost by chance or for want of room."""

    def address(self, station: str) -> str:
        """Return a station's IP address."""
        return self._address[station]

    def link(self, one: str, other: str, link: Link | None = None) -> None:
        """Let two stations hear each other, both ways alike."""
        with self._lock:
            self._links[one, other] = self._links[other, one] = link or Link()

    def cut(self, one: str, other: str) -> None:
        """Let two stations hear each other no more: packets vanish, nothing is closed."""
        with self._lock:
            self._links.pop((one, other), None)
            self._links.pop((other, one), None)

    def start(
        self, station: str, command: Sequence[str], **options: Any
    ) -> subprocess.Popen[bytes]:
        """Start a process that has only its station's network."""
        within = ["ip", "netns", "exec", _namespace(station), *command]
        return subprocess.Popen(within, **options)

    def __enter__(self) -> Self:
        try:
            for station, address in self._address.items():
                self._make(station, address)
        except BaseException:
            self._remove()
            raise
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self._remove()

    def _make(self, station: str, address: str) -> None:
        namespace = _namespace(station)
        _ip("netns", "add", namespace)
        tunnel = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
        self._tunnels[station] = tunnel
        self._at[socket.inet_aton(address)] = station
        device = f"clew{os.getpid() % 100_000}{station}"[:15]
        fcntl.ioctl(tunnel, _TUNSETIFF, struct.pack("16sH", device.encode(), _IFF_TUN | _IFF_NO_PI))
        _ip("link", "set", device, "netns", namespace)
        within = ("netns", "exec", namespace, "ip")
        _ip(*within, "link", "set", "lo", "up")
        _ip(*within, "link", "set", device, "mtu", str(_MTU_BYTES), "up")
        _ip(*within, "address", "add", f"{address}/24", "dev", device)

    def _remove(self) -> None:
        for tunnel in self._tunnels.values():
            os.close(tunnel)
        for station in self._address:
            subprocess.run(
                ["ip", "netns", "del", _namespace(station)], capture_output=True, check=False
            )

    def _carry(self) -> None:
        with selectors.DefaultSelector() as selector:
            for station, tunnel in self._tunnels.items():
                selector.register(tunnel, selectors.EVENT_READ, station)
            while not self._stop.is_set():
                for ready, _ in selector.select(self._wait_s()):
                    self._take_from(ready.fd, ready.data)
                self._deliver(time.monotonic())

    def _wait_s(self) -> float:
        if not self._flying:
            return _LONGEST_WAIT_S
        return min(max(self._flying[0].due_s - time.monotonic(), 0.0), _LONGEST_WAIT_S)

    def _take_from(self, tunnel: int, station: str) -> None:
        while True:
            try:
                packet = os.read(tunnel, 65_536)
            except BlockingIOError:
                return
            if packet[0] >> 4 == 4:
                self._send(station, packet, time.monotonic())

    def _send(self, station: str, packet: bytes, now_s: float) -> None:
        other = self._at.get(packet[16:20])
        with self._lock:
            link = None if other is None else self._links.get((station, other))
        if link is None or other is None:
            return
        through_s = now_s if link.channel is None else link.channel.pass_s(len(packet), now_s)
        if through_s is None or self._chance.random() < link.loss:
            self.lost += 1
            return
        self._number += 1
        flying = _Flying(through_s + link.delay_s, self._number, self._tunnels[other], packet)
        heapq.heappush(self._flying, flying)

    def _deliver(self, now_s: float) -> None:
        while self._flying and self._flying[0].due_s <= now_s:
            flying = heapq.heappop(self._flying)
            try:
                os.write(flying.tunnel, flying.packet)
            except BlockingIOError:
                self.lost += 1


def _namespace(station: str) -> str:
    return f"clew-{os.getpid()}-{station}"


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True)
