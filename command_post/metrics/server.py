"""Where the post's figures can be read over HTTP: ``/metrics`` and ``/roster``.

On this machine without further ado; beyond it only encrypted, and only by those to whom the
authority has given a certificate.
"""

from __future__ import annotations

import socket
import ssl
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import NamedTuple

import structlog
from prometheus_client import CONTENT_TYPE_LATEST

from command_post.listening import Address, listening_address
from command_post.metrics.prometheus import Metrics
from shared.security.bundle import AUTHORITY_FILE, CERTIFICATE_FILE, KEY_FILE, Bundle

PATIENCE_S = 5.0
"""How long whoever asks may take to say what for."""

MOST_ASKING = 16

_log = structlog.stdlib.get_logger(__name__)


class Page(NamedTuple):
    """What is answered under a path."""

    content_type: str
    make: Callable[[], bytes]


def metrics_address(text: str, bundle: Bundle | None) -> Address:
    """Return the address in ``--metrics HOST:PORT``.

    Raises ``ValueError`` for a malformed one, and for one beyond this machine without ``bundle``.
    """
    address = listening_address("--metrics", text, "127.0.0.1:9464")
    if bundle is None and not address.is_local:
        raise ValueError(
            f"--metrics {text!r}: beyond this machine figures are only told encrypted, to those "
            "with a certificate; give --keys as well, or use 127.0.0.1:PORT"
        )
    return address


@contextmanager
def told(address: Address | None, bundle: Bundle | None) -> Iterator[Metrics | None]:
    """Give what is to be told how the post fares, and serve it; ``None`` without an address."""
    if address is None:
        yield None
        return
    metrics = Metrics()
    pages = {
        "/metrics": Page(CONTENT_TYPE_LATEST, metrics.exposition),
        "/roster": Page("application/json", metrics.roster),
    }
    with served(address, pages, bundle) as where:
        _log.info("figures are told", host=where.host, port=where.port)
        yield metrics


@contextmanager
def served(address: Address, pages: Mapping[str, Page], bundle: Bundle | None) -> Iterator[Address]:
    """Serve ``pages`` until the block ends; give where, with the port that was really given.

    Beyond this machine with TLS, and client certificates by the authority of ``bundle``. Raises
    ``OSError`` if nobody can listen there.
    """
    context = None if bundle is None or address.is_local else _tls(bundle)
    try:
        server = _Server(address, pages, context)
    except OSError as error:
        raise OSError(
            f"--metrics {address.host}:{address.port}: cannot listen ({error.strerror}); "
            "use another port"
        ) from None
    thread = threading.Thread(target=server.serve_forever, args=(0.2,), name="metrics")
    thread.start()
    try:
        yield Address(address.host, server.server_address[1])
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def _tls(bundle: Bundle) -> ssl.SSLContext:
    context = ssl.create_default_context(
        ssl.Purpose.CLIENT_AUTH, cafile=bundle.path(AUTHORITY_FILE)
    )
    context.load_cert_chain(bundle.path(CERTIFICATE_FILE), bundle.path(KEY_FILE))
    context.verify_mode = ssl.CERT_REQUIRED
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    return context


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False

    def __init__(
        self, address: Address, pages: Mapping[str, Page], context: ssl.SSLContext | None
    ) -> None:
        self.pages = pages
        self._context = context
        self._places = threading.BoundedSemaphore(MOST_ASKING)
        self.address_family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
        super().__init__((address.host, address.port), _Handler)

    def get_request(self) -> tuple[socket.socket, object]:
        """Take a connection; the handshake is left to its own thread."""
        taken, where = super().get_request()
        if self._context is not None:
            taken = self._context.wrap_socket(
                taken, server_side=True, do_handshake_on_connect=False
            )
        return taken, where

    def process_request(self, request: object, client_address: object) -> None:
        """Answer in a thread, if there are not too many already."""
        if self._places.acquire(blocking=False):
            super().process_request(request, client_address)  # type: ignore[arg-type]
        else:
            self.shutdown_request(request)  # type: ignore[arg-type]

    def process_request_thread(self, request: object, client_address: object) -> None:
        """Answer, and make room for the next."""
        try:
            super().process_request_thread(request, client_address)  # type: ignore[arg-type]
        finally:
            self._places.release()

    def handle_error(self, request: object, client_address: object) -> None:  # noqa: ARG002
        """Note that somebody could not be answered: no certificate, or gone."""
        _log.info("somebody who asked for figures was not answered", who=str(client_address))


class _Handler(BaseHTTPRequestHandler):
    timeout = PATIENCE_S
    server: _Server

    def do_GET(self) -> None:
        """Answer with the page, if there is one."""
        page = self.server.pages.get(self.path)
        if page is None:
            self.send_error(HTTPStatus.NOT_FOUND, f"there is {', '.join(self.server.pages)}")
            return
        body = page.make()
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", page.content_type)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Log to ours, quietly."""
        _log.debug("asked for figures", what=format % args)
