"""What a wearer calls for help by: a button of Linux's input devices, and this unit's own command.

A button may be a Bluetooth one, or GPIO lines that the kernel makes a keyboard of (gpio-keys).
"""

from __future__ import annotations

import os
import socket
import struct
import time
from pathlib import Path
from typing import NamedTuple, Protocol

import structlog

from edge_agent.mayday import Act, HeldButton

INPUT_EVENT = struct.Struct("@llHHi")
"""``struct input_event`` of Linux: seconds, microseconds, type, code, value."""

EV_KEY = 1
KEY_UP, KEY_DOWN = 0, 1
MOST_EVENTS = 64
REOPEN_S = 1.0

MOST_REQUEST_BYTES = 64
MOST_CLIENTS = 8
COMMANDS: dict[bytes, Act] = {b"call": "call", b"cancel": "cancel"}

_log = structlog.stdlib.get_logger(__name__)


class Request(NamedTuple):
    """What the wearer wants, and by what they said so."""

    act: Act
    reason: str


class Control(Protocol):
    """Something by which a wearer calls; looked at now and then, by one thread."""

    def requests(self, *, stands: bool) -> list[Request]:
        """Return what was wanted since, while a call ``stands`` or none does."""

    def tell(self, words: str) -> None:
        """Tell the wearer how their call stands, if there is a way to."""

    def close(self) -> None:
        """Look no more."""


class InputButton:
    """Any key of an input device (``/dev/input/event3``), which may come and go."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._held = HeldButton()
        self._file: int | None = None
        self._open_s = -REOPEN_S
        self._missed = False

    def requests(self, *, stands: bool) -> list[Request]:
        """Return what holding the button means by now."""
        now_s = time.monotonic()
        if self._file is None and now_s - self._open_s >= REOPEN_S:
            self._open(now_s)
        for value in self._values():
            if value == KEY_DOWN:
                self._held.press(now_s)
            elif value == KEY_UP:
                self._held.release()
        act = self._held.act(now_s, stands=stands)
        return [] if act is None else [Request(act, "the button was held")]

    def tell(self, words: str) -> None:
        """Pass: a button shows nothing."""

    def close(self) -> None:
        """Let the device go."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def _open(self, now_s: float) -> None:
        self._open_s = now_s
        try:
            self._file = os.open(self._path, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            self._miss(error)
        else:
            self._missed = False
            _log.info("mayday button", path=str(self._path))

    def _values(self) -> list[int]:
        """Return what its keys did: down, up, or repeated."""
        if self._file is None:
            return []
        try:
            data = os.read(self._file, MOST_EVENTS * INPUT_EVENT.size)
        except BlockingIOError:
            return []
        except OSError as error:
            self.close()
            self._held.release()
            self._miss(error)
            return []
        whole = len(data) - len(data) % INPUT_EVENT.size
        events = INPUT_EVENT.iter_unpack(data[:whole])
        return [value for _, _, kind, _, value in events if kind == EV_KEY]

    def _miss(self, error: OSError) -> None:
        if not self._missed:
            self._missed = True
            why = error.strerror
            _log.error("the mayday button cannot be read, trying on", path=str(self._path), why=why)


class UnitSocket:
    """Where ``edge-agent mayday`` reaches the agent that runs on this unit, beside its journal."""

    def __init__(self, path: Path) -> None:
        """Listen at ``path``, for this user alone; whoever left it there is gone."""
        self._path = path
        self._clients: list[socket.socket] = []
        path.unlink(missing_ok=True)
        self._listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listening.setblocking(False)
        former = os.umask(0o177)
        try:
            self._listening.bind(str(path))
        except OSError as error:
            self._listening.close()
            raise ValueError(
                f"{path}: no place for a socket ({error}); give a --journal elsewhere"
            ) from None
        finally:
            os.umask(former)
        self._listening.listen(MOST_CLIENTS)

    def requests(self, *, stands: bool) -> list[Request]:  # noqa: ARG002
        """Return what was commanded."""
        asked = []
        try:
            client, _ = self._listening.accept()
        except BlockingIOError:
            pass  # nobody new
        else:
            client.setblocking(False)
            self._clients.append(client)
            if len(self._clients) > MOST_CLIENTS:
                self._clients.pop(0).close()
        for client in tuple(self._clients):
            try:
                data = client.recv(MOST_REQUEST_BYTES)
            except BlockingIOError:
                continue
            except OSError as error:
                self._miss(client, error)
                continue
            act = COMMANDS.get(data.strip())
            if act is None:
                self._let_go(client)
            else:
                asked.append(Request(act, "said at the unit"))
        return asked

    def tell(self, words: str) -> None:
        """Tell whoever has commanded something and still listens."""
        for client in tuple(self._clients):
            try:
                client.send(f"{words}\n".encode())
            except OSError as error:
                self._miss(client, error)

    def _miss(self, client: socket.socket, error: OSError) -> None:
        _log.info("who commanded at the unit is gone", why=error.strerror)
        self._let_go(client)

    def _let_go(self, client: socket.socket) -> None:
        client.close()
        self._clients.remove(client)

    def close(self) -> None:
        """Listen no more."""
        for each in (*self._clients, self._listening):
            each.close()
        self._path.unlink(missing_ok=True)


def socket_path(journal: Path) -> Path:
    """Return where the agent that keeps ``journal`` listens for commands of this unit."""
    return journal.with_name(f"{journal.name}.mayday")
