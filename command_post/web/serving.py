"""Serves HTTP on a thread of its own, to this machine or encrypted."""

from __future__ import annotations

import asyncio
import socket
import ssl
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from typing import NamedTuple, TypeAlias

import structlog
import uvicorn
from starlette.applications import Starlette

from command_post.listening import Address

GOODBYE_S = 1
"""Whoever is being answered has so long, once the server stops."""

MOST_CONNECTIONS = 256
MOST_UNDER_WAY_BYTES = 1 << 18
"""More is not sent ahead: whoever is slow would be told what was, before what is."""

LOCAL_NAMES = frozenset({"127.0.0.1", "localhost", "::1"})

Ends: TypeAlias = Callable[[], bool]
"""Says whether the server is to stop."""


InTurn: TypeAlias = Callable[[Callable[[], None]], None]
"""Has something done by the thread that serves, when its turn comes."""


class ServerKeys(NamedTuple):
    """The files (PEM) of what a server is known by."""

    certificate: str
    key: str

    def check(self) -> None:
        """Raise ``ValueError`` if nothing can be encrypted with them, and say what to do."""
        try:
            ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(self.certificate, self.key)
        except OSError as error:
            why = getattr(error, "reason", None) or error.strerror or str(error)
            raise ValueError(
                f"{self.certificate}, {self.key}: the page cannot be encrypted with them ({why}); "
                "copy the bundle anew"
            ) from None


_log = structlog.stdlib.get_logger(__name__)


@contextmanager
def served(
    app_of: Callable[[Ends], Starlette], address: Address, keys: ServerKeys | None
) -> Iterator[str]:
    """Serve what ``app_of`` returns at ``address`` until the block ends, and give its URL.

    It is encrypted by ``keys``, if there are any. Raises ``OSError`` if nobody can listen there.
    """
    with listening_at(address) as listening, serving_on(listening, app_of, keys):
        yield told_where(listening, address, keys)


@contextmanager
def serving_on(
    listening: socket.socket, app_of: Callable[[Ends], Starlette], keys: ServerKeys | None
) -> Iterator[InTurn]:
    """Serve what ``app_of`` returns to those who come to ``listening``, until the block ends."""
    server = _server(app_of, keys)
    serving: Future[asyncio.AbstractEventLoop] = Future()

    async def serve() -> None:
        serving.set_result(asyncio.get_running_loop())
        await server.serve([listening])

    def run() -> None:
        with asyncio.Runner(loop_factory=server.config.get_loop_factory()) as runner:
            runner.run(serve())

    def in_turn(done: Callable[[], None]) -> None:
        with suppress(RuntimeError):  # It serves no more.
            serving.result().call_soon_threadsafe(done)

    thread = threading.Thread(target=run, name="page")
    thread.start()
    try:
        yield in_turn
    finally:
        server.should_exit = True
        thread.join()


def told_where(listening: socket.socket, address: Address, keys: ServerKeys | None) -> str:
    """Return where a browser finds what is served there; say it in the log."""
    host = f"[{address.host}]" if ":" in address.host else address.host
    scheme = "http" if keys is None else "https"
    url = f"{scheme}://{host}:{listening.getsockname()[1]}/"
    _log.info("the page is served", url=url)
    return url


def listening_at(address: Address) -> socket.socket:
    """Return a socket that listens at ``address``. Raises ``OSError`` if nobody can."""
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    try:
        listening = socket.create_server((address.host, address.port), family=family)
    except OSError as error:
        raise OSError(
            f"--page {address.host}:{address.port}: cannot listen ({error.strerror}); "
            "use another port"
        ) from None
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, MOST_UNDER_WAY_BYTES)
    return listening


def _server(app_of: Callable[[Ends], Starlette], keys: ServerKeys | None) -> uvicorn.Server:
    server: uvicorn.Server | None = None
    app = app_of(lambda: server is not None and server.should_exit)
    server = uvicorn.Server(
        uvicorn.Config(
            app,
            log_config=None,
            access_log=False,
            lifespan="off",
            server_header=False,
            limit_concurrency=MOST_CONNECTIONS,
            timeout_graceful_shutdown=GOODBYE_S,
            ssl_certfile=None if keys is None else keys.certificate,
            ssl_keyfile=None if keys is None else keys.key,
        )
    )
    return server
