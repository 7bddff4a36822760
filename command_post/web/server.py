"""Serves the page until the post stops: to this machine, or encrypted to those who sign in."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import structlog
import uvicorn

from command_post.listening import Address, listening_address
from command_post.web.app import Site, make_app
from command_post.web.page import Page
from command_post.web.people import LOCAL_NAME, Door, Person, load_people
from shared.geodesy import Origin
from shared.messages import NodeId
from shared.security.bundle import CERTIFICATE_FILE, KEY_FILE, Bundle

GOODBYE_S = 1
"""Whoever is being answered has so long, once the post stops."""

MOST_CONNECTIONS = 256
_LOCAL_NAMES = frozenset({"127.0.0.1", "localhost", "::1"})

_log = structlog.stdlib.get_logger(__name__)


def page_address(text: str, bundle: Bundle | None, people: Path | None) -> Address:
    """Return the address in ``--page HOST:PORT``.

    Raises ``ValueError`` for a malformed one, and for one beyond this machine without keys to
    encrypt with and ``people`` who sign in.
    """
    address = listening_address("--page", text, "127.0.0.1:8080")
    if not address.is_local and (bundle is None or people is None):
        raise ValueError(
            f"--page {text!r}: beyond this machine the page is encrypted and people sign in; give "
            "--keys and --people as well, or use 127.0.0.1:PORT"
        )
    return address


@contextmanager
def page_served(
    address: Address | None,
    incident: NodeId,
    post_id: NodeId,
    bundle: Bundle | None,
    people: Path | None,
    origin: Origin | None,
) -> Iterator[Page | None]:
    """Serve a page at ``address`` until the block ends, and give it; ``None`` without an address.

    Raises ``OSError`` if nobody can listen there, ``ConfigError`` for people that cannot be read,
    and ``ValueError`` where one of them goes by the post's name.
    """
    if address is None:
        yield None
        return
    page = Page(incident)
    door = None if people is None else Door(_named(people, post_id), time.monotonic())
    secure = bundle is not None and not address.is_local
    hosts = _LOCAL_NAMES if address.is_local else frozenset[str]()
    site = Site(incident, post_id, page, door, secure=secure, hosts=hosts, origin=origin)
    listening = _listen(address)
    server = _server(site, bundle if secure else None)
    stop = threading.Event()
    threads = [
        threading.Thread(target=server.run, args=([listening],), name="page"),
        threading.Thread(target=page.keep_up, args=(stop,), name="page-keeper"),
    ]
    for thread in threads:
        thread.start()
    port = listening.getsockname()[1]
    host = f"[{address.host}]" if ":" in address.host else address.host
    _log.info("the page is served", url=f"http{'s' if secure else ''}://{host}:{port}/")
    try:
        yield page
    finally:
        server.should_exit = True
        stop.set()
        for thread in threads:
            thread.join()
        listening.close()


def _named(path: Path, post_id: NodeId) -> dict[NodeId, Person]:
    people = load_people(path).people
    for taken in (post_id, LOCAL_NAME):
        if taken in people:
            raise ValueError(f"{path}: {taken!r} is taken; give that person another name")
    return people


def _listen(address: Address) -> socket.socket:
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    try:
        return socket.create_server((address.host, address.port), family=family)
    except OSError as error:
        raise OSError(
            f"--page {address.host}:{address.port}: cannot listen ({error.strerror}); "
            "use another port"
        ) from None


def _server(site: Site, bundle: Bundle | None) -> uvicorn.Server:
    server: uvicorn.Server | None = None
    app = make_app(site, lambda: server is not None and server.should_exit)
    server = uvicorn.Server(
        uvicorn.Config(
            app,
            log_config=None,
            access_log=False,
            lifespan="off",
            server_header=False,
            limit_concurrency=MOST_CONNECTIONS,
            timeout_graceful_shutdown=GOODBYE_S,
            ssl_certfile=None if bundle is None else bundle.path(CERTIFICATE_FILE),
            ssl_keyfile=None if bundle is None else bundle.path(KEY_FILE),
        )
    )
    return server
