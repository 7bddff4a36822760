"""The control socket of hostapd and wpa_supplicant: commands, their answers, and events.

Each is a datagram over a UNIX socket (hostapd's documentation, "hostapd control interface"). Who
has sent ``ATTACH`` is sent events as well, told from answers by the level in front: ``<3>``.
"""

from __future__ import annotations

import socket
import time
from contextlib import suppress
from pathlib import Path

ANSWER_S = 2.0
MOST_BYTES = 65_536
MOST_EVENTS = 1000
"""Events that are kept until somebody asks for them."""


class ControlSocket:
    """A connection to the control socket at ``path``. One thread may use it."""

    def __init__(self, path: Path) -> None:
        """Connect, and ask for events; raise ``OSError`` where nobody answers there."""
        self._events: list[str] = []
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            # An abstract address that the kernel chooses: no file is left behind.
            self._socket.bind("")
            self._socket.connect(str(path))
            answer = self.request("ATTACH")
            if answer != "OK":
                raise ConnectionRefusedError(f"{path}: ATTACH is answered with {answer!r}")
        except BaseException:
            self._socket.close()
            raise

    def request(self, command: str) -> str:
        """Return what is answered, without the last line end; ``TimeoutError`` if nothing is."""
        until_s = time.monotonic() + ANSWER_S
        try:
            self._socket.settimeout(ANSWER_S)
            self._socket.send(command.encode())
            while (left_s := until_s - time.monotonic()) > 0.0:
                self._socket.settimeout(left_s)
                answer = self._receive()
                if answer is not None:
                    return answer
        except TimeoutError as error:
            raise TimeoutError(f"{command} is not answered") from error
        raise TimeoutError(f"{command} is not answered: there are only events")

    def take_events(self) -> list[str]:
        """Return what has happened since this was last asked, without the levels in front."""
        self._socket.setblocking(False)
        # Until nothing is there any more; an answer now came too late for whom it was for.
        with suppress(BlockingIOError):
            while len(self._events) < MOST_EVENTS:
                self._receive()
        events, self._events = self._events, []
        return events

    def close(self) -> None:
        """Close; whoever is at the other end forgets about it."""
        self._socket.close()

    def _receive(self) -> str | None:
        """Return the next answer; ``None`` if it was an event, which is kept."""
        text = self._socket.recv(MOST_BYTES).decode(errors="replace").removesuffix("\n")
        level, bracket, event = text.partition(">")
        if not (bracket and level.startswith("<") and level[1:].isdecimal()):
            return text
        if len(self._events) < MOST_EVENTS:
            self._events.append(event)
        return None
