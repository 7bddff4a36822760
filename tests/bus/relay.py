"""A bad link: a TCP relay that is slow or narrow, falls silent without closing, or is cut."""

from __future__ import annotations

import queue
import socket
import threading
import time
from contextlib import suppress
from typing import Self, TypeAlias

CHUNK_BYTES = 2048
RECEIVE_BUFFER_BYTES = 16_384
"""So that what waits for a narrow link waits where it would by radio: with its sender."""


OnTheWay: TypeAlias = "queue.SimpleQueue[tuple[float, bytes]]"
"""Bytes, and when they are due; none for the end."""


class Channel:
    """What several relays share: bytes of all of them, both ways, pass one after another."""

    def __init__(self, bit_per_s: float) -> None:
        self._s_per_byte = 8.0 / bit_per_s
        self._free = threading.Lock()

    def carry(self, size_bytes: int) -> None:
        """Return when so many bytes have passed."""
        with self._free:
            time.sleep(size_bytes * self._s_per_byte)


class Relay:
    """Passes connections to its own ``port`` on to ``target_port``, until it is stalled or cut.

    What is passed on takes ``there_s`` to the target, and ``back_s`` from it, and before that its
    time on ``channel``.
    """

    def __init__(
        self,
        target_port: int,
        there_s: float = 0.0,
        back_s: float = 0.0,
        channel: Channel | None = None,
    ) -> None:
        self._target_port = target_port
        self._delays_s = (there_s, back_s)
        self._channel = channel
        self._flowing = threading.Event()
        self._flowing.set()
        self._lock = threading.Lock()
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        self._sockets: list[socket.socket] = []
        self._is_cut = False
        self.port: int = self._server.getsockname()[1]
        self._threads = [threading.Thread(target=self._accept)]
        self._threads[0].start()

    @property
    def connections(self) -> int:
        """How many connections it has passed on so far."""
        with self._lock:
            return len(self._sockets) // 2

    def stall(self) -> None:
        """Pass nothing on from now on, and close nothing: both ends see a half-open link."""
        self._flowing.clear()

    def resume(self) -> None:
        """Pass on what has waited, and all that comes."""
        self._flowing.set()

    def cut(self) -> None:
        """Break all connections, lose what is on the way, and let none through from now on."""
        with self._lock:
            self._is_cut = True
            for each in self._sockets:
                with suppress(OSError):
                    each.shutdown(socket.SHUT_RDWR)

    def mend(self) -> None:
        """Let connections through again."""
        with self._lock:
            self._is_cut = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._flowing.set()
        with suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)
        self.cut()
        for thread in self._threads:
            thread.join()
        for each in (self._server, *self._sockets):
            each.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._server.accept()
                try:
                    far = socket.create_connection(("127.0.0.1", self._target_port))
                except ConnectionError:
                    near.close()
                else:
                    self._pass(near, far)

    def _pass(self, near: socket.socket, far: socket.socket) -> None:
        with self._lock:
            if self._is_cut:
                near.close()
                far.close()
                return
            self._sockets += [near, far]
        ways = ((near, far), (far, near))
        for way, delay_s in zip(ways, self._delays_s, strict=True):
            on_the_way: OnTheWay = queue.SimpleQueue()
            for target, arguments in (
                (self._take, (way[0], on_the_way, delay_s)),
                (self._give, (on_the_way, way[1])),
            ):
                pump = threading.Thread(target=target, args=arguments)
                self._threads.append(pump)
                pump.start()

    def _take(
        self,
        source: socket.socket,
        on_the_way: OnTheWay,
        delay_s: float,
    ) -> None:
        with suppress(OSError):
            while data := source.recv(CHUNK_BYTES):
                self._flowing.wait()
                if self._channel is not None:
                    self._channel.carry(len(data))
                on_the_way.put((time.monotonic() + delay_s, data))
        on_the_way.put((0.0, b""))

    def _give(self, on_the_way: OnTheWay, sink: socket.socket) -> None:
        with suppress(OSError):
            while True:
                due_s, data = on_the_way.get()
                if not data:
                    break
                time.sleep(max(0.0, due_s - time.monotonic()))
                sink.sendall(data)
        with suppress(OSError):
            sink.shutdown(socket.SHUT_RDWR)
