"""The post as a TAK client: its own thread, over PyTAK, for as long as it takes the server to come.

Whatever becomes of the server, the post does not wait: the newest is told once there is a link.
"""

from __future__ import annotations

import asyncio
import ssl
import threading
import time
import warnings
from collections.abc import Iterator
from configparser import ConfigParser
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple
from urllib.parse import SplitResult, urlsplit

import structlog

from command_post.gateways.at_work import at_work
from command_post.gateways.cot import LONGEST_EVENT_BYTES, Heard
from command_post.gateways.cot_stream import EventStream, OutsideWords
from command_post.gateways.tak_board import TakBoard
from command_post.roster import Roster
from shared.bus.inbox import Inbox
from shared.codec import encode
from shared.geodesy import Origin
from shared.messages import NodeId, OutsideWord
from shared.topics import Key

TAK_ID = "tak"
"""Under whose name what comes from TAK stands in the record."""

TELL_PERIOD_S = 1.0
RETRY_S = 3.0
MOST_HEARD = 256
_log = structlog.stdlib.get_logger(__name__)


class TakServer(NamedTuple):
    """Where a TAK server is; with a certificate, its key and the server's authority for ``tls``."""

    url: str
    certificate: Path | None = None
    key: Path | None = None
    authority: Path | None = None


def checked_server(server: TakServer) -> TakServer:
    """Return ``server`` if it can be dialled as it stands. Raises ``ValueError``."""
    parts = urlsplit(server.url)
    if parts.scheme not in ("tcp", "tls") or not parts.hostname or not _port(parts):
        raise ValueError(f"--tak {server.url!r}: write tcp://HOST:PORT or tls://HOST:PORT")
    needed = (server.certificate, server.key, server.authority)
    if parts.scheme == "tls" and None in needed:
        raise ValueError("--tak tls://…: give --tak-cert, --tak-key and --tak-ca as well")
    for path in needed:
        if path is not None and not path.is_file():
            raise ValueError(f"{path}: no such file; give the PEM files that the server issued")
    _check_files(server)
    return server


def _port(parts: SplitResult) -> int | None:
    """Return the port, if there is one that can be."""
    try:
        return parts.port
    except ValueError:
        return None


def _check_files(server: TakServer) -> None:
    if server.certificate is None or server.authority is None:
        return
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    try:
        # An empty password: one that is needed would be asked for at the terminal.
        context.load_cert_chain(server.certificate, server.key, password="")
    except (ssl.SSLError, OSError, ValueError) as error:
        raise ValueError(
            f"--tak-cert {server.certificate}, --tak-key {server.key}: give a certificate and its "
            f"own key, PEM, without a password ({error})"
        ) from error
    try:
        context.load_verify_locations(server.authority)
    except (ssl.SSLError, OSError) as error:
        raise ValueError(
            f"--tak-ca {server.authority}: give certificates, PEM ({error})"
        ) from error


class TakLink:
    """Tells a TAK server of an incident, and the post of what comes back."""

    def __init__(self, server: TakServer, incident: NodeId, origin: Origin | None) -> None:
        self._server = server
        self._incident = incident
        self._lock = threading.Lock()
        self._board = TakBoard(incident, origin)
        self._heard: Inbox[OutsideWord] = Inbox(MOST_HEARD)
        self._stop = threading.Event()
        self._words = OutsideWords(origin)

    def published(self, key_text: str, payload: bytes) -> None:
        """Take in what the post has published."""
        with self._lock:
            self._board.publish(key_text, payload)

    def show(self, roster: Roster) -> None:
        """Take in the newest roster."""
        with self._lock:
            self._board.show(roster)

    def take_requests(self) -> list[tuple[str, bytes]]:
        """Return what TAK has said since, as messages under their keys."""
        key = str(Key(self._incident, "post", TAK_ID, "outside"))
        return [(key, encode(word)) for word in self._heard.get_all()]

    def stop(self) -> None:
        """Have ``run`` return soon."""
        self._stop.set()

    def run(self) -> None:
        """Talk to the server, again and again, until stopped."""
        asyncio.run(self._run())

    async def _run(self) -> None:
        told = ""
        while not self._stop.is_set():
            try:
                await self._talk()
                told = ""
            except (OSError, ValueError, SyntaxError, asyncio.IncompleteReadError) as error:
                if str(error) != told:
                    _log.warning("no link to TAK, trying on", url=self._server.url, why=str(error))
                told = str(error)
            await self._pause(RETRY_S)

    async def _talk(self) -> None:
        """Tell and hear over one connection, until it breaks or the post stops."""
        with warnings.catch_warnings():
            # It warns of parts that are not used here.
            warnings.simplefilter("ignore")
            import pytak  # noqa: PLC0415
        reader, writer = await pytak.protocol_factory(_configuration(self._server))
        _log.info("linked to TAK", url=self._server.url)
        hearing = asyncio.ensure_future(self._hear(reader))
        try:
            while not (self._stop.is_set() or hearing.done()):
                for event in self._due():
                    writer.write(event)
                await writer.drain()
                await self._pause(TELL_PERIOD_S)
            if hearing.done():
                hearing.result()
        finally:
            hearing.cancel()
            with suppress(asyncio.CancelledError, OSError):
                await hearing
            writer.close()
            with suppress(OSError):
                await writer.wait_closed()

    async def _hear(self, reader: asyncio.StreamReader) -> None:
        events = EventStream()
        while data := await reader.read(LONGEST_EVENT_BYTES):
            for heard in events.feed(data):
                self._note(heard)
        raise OSError("the server has closed the link")

    def _note(self, heard: Heard) -> None:
        with self._lock:
            self._words.origin = self._board.origin
        word = self._words.word(heard, time.time_ns())
        if word is None:
            _log.warning("a mayday from TAK is passed over: too many stand", uid=heard.uid)
        else:
            self._heard.put(word)

    def _due(self) -> list[bytes]:
        with self._lock:
            return list(self._board.due(time.time_ns()))

    async def _pause(self, seconds: float) -> None:
        end_s = time.monotonic() + seconds
        while not self._stop.is_set() and time.monotonic() < end_s:
            await asyncio.sleep(0.1)


@contextmanager
def linked_to_tak(
    server: TakServer | None, incident: NodeId, origin: Origin | None = None
) -> Iterator[TakLink | None]:
    """Talk to a TAK server until the block ends; ``None`` if there is none.

    TAK knows places on the Earth alone: it is told nothing before it is known where the incident
    is, as ``origin`` or by what the post says.
    """
    if server is None:
        yield None
        return
    link = TakLink(server, incident, origin)
    with at_work(link, "tak"):
        yield link


def _configuration(server: TakServer) -> object:
    files = {
        "PYTAK_TLS_CLIENT_CERT": server.certificate,
        "PYTAK_TLS_CLIENT_KEY": server.key,
        "PYTAK_TLS_CLIENT_CAFILE": server.authority,
    }
    parser = ConfigParser()
    parser["tak"] = {
        "COT_URL": server.url,
        "TAK_PROTO": "0",
        # PyTAK would take all, those without authentication among them.
        "PYTAK_TLS_CLIENT_CIPHERS": "DEFAULT:!aNULL:!eNULL",
        **{name: str(path) for name, path in files.items() if path is not None},
    }
    return parser["tak"]
