"""A bad link: a TCP relay that can fall silent without closing, as radio does."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress
from typing import Self


class Relay:
    """Passes connections to its own ``port`` on to ``target_port``, until it is stalled.

    What is passed on takes ``there_s`` to the target, and ``back_s`` from it.
    """

    def __init__(self, target_port: int, there_s: float = 0.0, back_s: float = 0.0) -> None:
        self._target_port = target_port
        self._delays_s = (there_s, back_s)
        self._closing = threading.Event()
        self._flowing = threading.Event()
        self._flowing.set()
        self._sockets = [socket.create_server(("127.0.0.1", 0))]
        self.port: int = self._sockets[0].getsockname()[1]
        self._threads = [threading.Thread(target=self._accept, args=(self._sockets[0],))]
        self._threads[0].start()

    def stall(self) -> None:
        """Pass nothing on from now on, and close nothing: both ends see a half-open link."""
        self._flowing.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._flowing.set()
        self._closing.set()
        for each in self._sockets:
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for each in self._sockets:
            each.close()

    def _accept(self, server: socket.socket) -> None:
        with suppress(OSError):
            while True:
                near, _ = server.accept()
                far = socket.create_connection(("127.0.0.1", self._target_port))
                self._sockets += [near, far]
                ways = ((near, far), (far, near))
                for way, delay_s in zip(ways, self._delays_s, strict=True):
                    pump = threading.Thread(target=self._pump, args=(*way, delay_s))
                    self._threads.append(pump)
                    pump.start()

    def _pump(self, source: socket.socket, sink: socket.socket, delay_s: float) -> None:
        with suppress(OSError):
            while data := source.recv(65_536):
                self._flowing.wait()
                self._closing.wait(delay_s)
                sink.sendall(data)
        with suppress(OSError):
            sink.shutdown(socket.SHUT_RDWR)
