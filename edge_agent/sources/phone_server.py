"""A phone that is carried, as a source: it sends what it reads, and the agent listens.

A phone comes by our page, which sends the browser's DeviceMotion over a WebSocket, or by the app
'Sensor Logger' and its HTTP push. Both are served under a path that nobody can guess and that is
told as the source opens, so that nobody else tells of the wearer.
"""

from __future__ import annotations

import queue
import secrets
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib.resources import files

import structlog
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from edge_agent.gnss import SpeedReading
from edge_agent.sources.phone_button import PhoneButton
from edge_agent.sources.phone_stream import (
    PhonePush,
    PhoneStream,
    decoded,
    reads_upside_down,
    speeds_of,
    unreadable,
)
from edge_agent.sources.reading import Quiet, Reading, Source
from edge_agent.sources.recording import SourceError
from shared.messages import ImuSample
from shared.security.bundle import CERTIFICATE_FILE, KEY_FILE, Bundle
from shared.units import NS_PER_S

MOST_BYTES = 4_000_000
MOST_WAITING = 10_000
"""As long as so many readings wait to be taken, a message is to be sent again."""

ASTRAY_NS = 2 * NS_PER_S
"""A phone whose newest reading is further from now has a clock of its own."""

QUIET_S = 0.25
HIGHEST_PORT = 65_535
EVERYWHERE = frozenset({"0.0.0.0", "::"})  # noqa: S104
GOODBYE_S = 1
NOT_UNDERSTOOD, TRY_AGAIN = 1007, 1013
"""Why a WebSocket is closed (RFC 6455, section 7.4, and its register)."""

TAKEN = "taken"
"""The answer to each of a WebSocket's messages: what is not answered is to be sent again."""

DISPLACED = "another phone, or page, sends since: open the page anew to send from here"
UPSIDE_DOWN = (
    "the phone reads as if held upside down: if it is an iPhone, switch on "
    "'Standardise Units & Frames' in the app, or left and right are exchanged"
)

_log = structlog.stdlib.get_logger(__name__)


class PhoneServer:
    """Listens for one phone; ``readings`` are what it sends, by the clock ``now_ns``.

    The phone's clock need not be right: where it is not, a message is taken to come at once.
    """

    def __init__(
        self, where: str, now_ns: Callable[[], int], bundle: Bundle | None, token: str | None = None
    ) -> None:
        """Listen at ``where``, HOST:PORT, encrypted by ``bundle``; raise ``SourceError`` if not."""
        self._now_ns = now_ns
        self._bundle = bundle
        self._socket = _listen(where)
        host, port = self._socket.getsockname()[:2]
        scheme = "http" if bundle is None else "https"
        if host in EVERYWHERE:
            host = socket.gethostname()
        self.url = f"{scheme}://{host}:{port}/{token or secrets.token_urlsafe(12)}/"
        self._stream = PhoneStream()
        self.button = PhoneButton()
        """The page's mayday button."""

        self._ahead_ns = 0
        self._told_unreadable: set[str] = set()
        self._judged = False
        self._readings: queue.Queue[ImuSample | SpeedReading] = queue.Queue()

    def readings(self) -> Iterator[Reading]:
        """Yield samples as they come, and from time to time that none did, until closed."""
        server = uvicorn.Server(self._config())
        thread = threading.Thread(target=server.run, args=([self._socket],), name="phone")
        thread.start()
        try:
            while True:
                try:
                    yield self._readings.get(timeout=QUIET_S)
                except queue.Empty:
                    yield Quiet(self._now_ns())
        finally:
            server.should_exit = True
            thread.join()
            self._socket.close()

    def _config(self) -> uvicorn.Config:
        path = "/" + self.url.split("/", 3)[3]
        routes = [
            Route(path, _page),
            Route(f"{path}push", self._push, methods=["POST"]),
            WebSocketRoute(f"{path}stream", self._stream_on),
            self.button.route(f"{path}mayday"),
        ]
        return uvicorn.Config(
            Starlette(routes=routes, exception_handlers={404: _astray}),
            log_config=None,
            access_log=False,
            lifespan="off",
            ws="websockets-sansio",
            ws_max_size=MOST_BYTES,
            server_header=False,
            timeout_graceful_shutdown=GOODBYE_S,
            ssl_certfile=None if self._bundle is None else self._bundle.path(CERTIFICATE_FILE),
            ssl_keyfile=None if self._bundle is None else self._bundle.path(KEY_FILE),
        )

    def _set_clock(self, newest_ns: int) -> None:
        """Take the phone's newest reading to be of now, unless it is by the clock so far."""
        now_ns = self._now_ns()
        if abs(newest_ns + self._ahead_ns - now_ns) > ASTRAY_NS:
            self._ahead_ns = now_ns - newest_ns

    def _take(self, body: bytes | str) -> None:
        """Take in a message, all of it or, with an error, nothing.

        ``ValueError`` if it is none, ``queue.Full`` if there is no room.
        """
        try:
            push = decoded(body)
        except ValueError as error:
            _log.warning("a phone's message is refused", why=str(error))
            raise
        if self._readings.qsize() >= MOST_WAITING:
            _log.warning("a phone's message is refused: samples come faster than they are followed")
            raise queue.Full
        if not self._admits(push):
            return
        self._tell_unreadable(push)
        if push.payload:
            self._set_clock(max(reading.time for reading in push.payload))
        for speed in speeds_of(push):
            self._readings.put_nowait(speed._replace(time_ns=speed.time_ns + self._ahead_ns))
        samples = self._stream.take(push)
        self._tell_upside_down(samples)
        for sample in samples:
            moved = ImuSample(
                sample.time_ns + self._ahead_ns,
                sample.force_m_s2,
                sample.rate_rad_s,
                sample.field_ut,
            )
            self._readings.put_nowait(moved)

    def _admits(self, push: PhonePush) -> bool:
        """Whether a message is to be taken in; ``ValueError`` if it is of a phone left behind."""
        if self._stream.is_displaced(push):
            raise ValueError(DISPLACED)
        if self._stream.begins(push):
            _log.warning("another phone, or page, sends from now on: the one before is refused")
            self._judged = False
        if self._stream.is_next(push):
            return True
        _log.warning("a phone's message comes twice, or after a later one: it is passed over")
        return False

    def _tell_upside_down(self, samples: list[ImuSample]) -> None:
        """Say so if the first ``samples`` of a phone read as if its forces were downwards."""
        if self._judged or not samples:
            return
        self._judged = True
        if reads_upside_down(samples):
            _log.warning(UPSIDE_DOWN)

    def _tell_unreadable(self, push: PhonePush) -> None:
        for name in unreadable(push) - self._told_unreadable:
            self._told_unreadable.add(name)
            _log.warning("a phone's sensor tells no numbers x, y and z", sensor=name[:30])

    async def _push(self, request: Request) -> Response:
        body = bytearray()
        async for part in request.stream():
            body += part
            if len(body) > MOST_BYTES:
                _log.warning("a phone's message is refused: too much at once")
                return PlainTextResponse("too much at once: send it more often", 413)
        try:
            self._take(bytes(body))
        except ValueError as error:
            return PlainTextResponse(str(error), 400)
        except queue.Full:
            return PlainTextResponse("the agent is too slow: try again", 503)
        return PlainTextResponse("")

    async def _stream_on(self, phone: WebSocket) -> None:
        """Take messages until the phone hangs up, and answer each once it is taken."""
        await phone.accept()
        while (said := await phone.receive())["type"] == "websocket.receive":
            try:
                self._take(said.get("text") or said.get("bytes") or b"")
            except ValueError as error:
                words = DISPLACED if str(error) == DISPLACED else "not a phone's message"
                await phone.close(NOT_UNDERSTOOD, words)
                return
            except queue.Full:
                await phone.close(TRY_AGAIN, "the agent is too slow: try again")
                return
            with suppress(WebSocketDisconnect):
                await phone.send_text(TAKEN)


def open_phone(where: str, now_ns: Callable[[], int], bundle: Bundle | None) -> Source:
    """Return the source of a phone that comes to HOST:PORT; say where it is to come to."""
    server = PhoneServer(where, now_ns, bundle)
    _log.info("open this on the phone", page=server.url, http_push=f"{server.url}push")
    return Source(server.readings(), now_ns(), None, (server.button,))


def _listen(where: str) -> socket.socket:
    host, _, port = where.rpartition(":")
    if not (host and port.isdecimal() and int(port) <= HIGHEST_PORT):
        raise SourceError(f"phone-live:{where}: write HOST:PORT, as in 0.0.0.0:8443")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host.strip("[]"), int(port)), family=family)
    except OSError as error:
        raise SourceError(
            f"phone-live:{where}: cannot listen ({error.strerror}); use another address or port"
        ) from None


async def _astray(_: Request, __: Exception) -> Response:
    words = "nobody listens at this address: open the one that the agent told as it started"
    return PlainTextResponse(words, 404)


async def _page(_: Request) -> Response:
    return HTMLResponse(files(__package__).joinpath("static/phone.html").read_text("utf-8"))
