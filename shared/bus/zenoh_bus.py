"""The bus over Zenoh, the only room that knows it: routers at post and DAPs, agents as clients.

The settings (``zenoh_settings``) are measured ones. Live data is put with congestion control DROP,
since a blocking put stalls for seconds on a half-open link and then loses the rest without a word.
Zenoh's own log, which can only go to standard output, is turned on in ``refused_links`` alone; what
its handlers raise comes through ``logging``.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import NamedTuple, Protocol, Self

import structlog
import zenoh

from shared.bus.guard import HandlerGuard
from shared.bus.interface import (
    AliveHandler,
    Answerer,
    BusClosedError,
    Handler,
    LinkHandler,
    Received,
    Wanted,
)
from shared.bus.key_expression import check_key, check_key_expression
from shared.bus.zenoh_links import LinkKeeper, configuration, has_link, leave
from shared.bus.zenoh_settings import (
    Mode,
    check_dialled,
    check_endpoint,
    session_settings,
)
from shared.security.bundle import Bundle
from shared.topics import Priority

log = structlog.stdlib.get_logger(__name__)

CLOSE_S = 1.0
LOCATORS_S = 2.0

_PRIORITIES: dict[Priority, zenoh.Priority] = {
    "high": zenoh.Priority.INTERACTIVE_HIGH,
    "data": zenoh.Priority.DATA,
    "low": zenoh.Priority.DATA_LOW,
}


class _Undeclarable(Protocol):
    def undeclare(self) -> None: ...


def open_zenoh(
    mode: Mode,
    connect: Sequence[str] = (),
    listen: Sequence[str] = (),
    bundle: Bundle | None = None,
) -> ZenohBus:
    """Open a bus that dials the endpoints ``connect`` and, as a router, listens on ``listen``.

    Endpoints read ``tls/HOST:PORT``, and without a ``bundle`` of keys ``tcp/HOST:PORT``; port 0
    listens on a free one, which ``locators`` tells. A router dials until it is answered, a client
    keeps to one of its routers, with a link to another in reserve, and changes when that one is
    gone: anything may start first, and end and come back.

    Raises ``ValueError`` for an endpoint that is malformed, or that leaves this machine without a
    ``bundle``, and for a bundle that cannot listen. Raises ``OSError`` where listening fails.
    """
    for endpoint in connect:
        check_dialled(endpoint, bundle)
    for endpoint in listen:
        check_endpoint(endpoint, bundle)
    if mode == "client" and (listen or not connect):
        raise ValueError("a client dials routers and listens to nobody: give it only 'connect'")
    if bundle is not None and listen and bundle.identity.role == "responder":
        raise ValueError(f"{bundle.folder}: a responder's keys; only posts and DAPs listen")
    return ZenohBus(mode, connect, listen, bundle)


class ZenohBus:
    """A ``Bus`` over the network; ``open_zenoh`` makes one.

    Handlers and answerers run on Zenoh's threads: they must only enqueue, or return what is at
    hand, and not call the bus. Any other thread may call it, save that a daemon thread must not
    declare. Without a session (a client before it finds a router) what is published is dropped
    and counted, queries find nobody, and declarations wait; afterwards links may break and come
    back, to the same router or another, and all is declared anew. Close clients before the routers
    they dial.
    """

    def __init__(
        self,
        mode: Mode,
        connect: Sequence[str],
        listen: Sequence[str],
        bundle: Bundle | None = None,
    ) -> None:
        settings = session_settings(mode, connect, listen, bundle)
        self._settings = settings
        self._guard = HandlerGuard()
        self._lock = threading.RLock()
        self._closing = threading.Event()
        self._asking = zenoh.CancellationToken()
        self._session: zenoh.Session | None = None
        self._declarations: list[Callable[[zenoh.Session], _Undeclarable]] = []
        self._declared: list[_Undeclarable] = []
        self._on_link: list[LinkHandler] = []
        self._publishers: dict[tuple[str, Priority], zenoh.Publisher] = {}
        self._unsent = 0
        # No daemon: the threads Zenoh makes for callbacks take after the one that declares them,
        # and a daemon still inside Zenoh when the interpreter ends aborts the process.
        keeper = LinkKeeper(
            settings, connect,
            is_linked=self.connected, adopt=self._adopt, has_linked=self._tell_linked,
        )  # fmt: skip
        self._keeper = threading.Thread(
            target=keeper.run, args=(self._closing,), name="zenoh-keep", daemon=False
        )
        if mode == "client":
            self._keeper.start()
        else:
            self._adopt(_open_router(configuration(settings), listen))

    @property
    def handler_failures(self) -> int:
        """How often a handler has raised."""
        return self._guard.failures

    @property
    def unsent(self) -> int:
        """How many messages were dropped because there was no session to publish them in."""
        return self._unsent

    def connected(self) -> bool:
        """Return whether a link to another node is up at this moment."""
        return has_link(self._session)

    def locators(self) -> tuple[str, ...]:
        """Return the endpoints a router listens on, with the ports it was really given."""
        session = self._session
        if session is None:
            return ()
        found: list[str] = []
        for reply in session.get(f"@/{session.zid()}/router", timeout=LOCATORS_S):
            if reply.ok is not None:
                found += json.loads(reply.ok.payload.to_bytes())["locators"]
        return tuple(found)

    def publish(self, key: str, payload: bytes, priority: Priority = "data") -> None:
        """Send ``payload`` live; dropped where a link cannot take it, and without a session.

        Never blocks. Raises ``ValueError`` for a malformed key, and nothing else.
        """
        publisher = self._publishers.get((key, priority)) or self._publisher(key, priority)
        if publisher is not None:
            with suppress(zenoh.ZError):
                publisher.put(payload)
                return
        with self._lock:
            self._unsent += 1

    def subscribe(
        self, key_expression: str, handler: Handler, wanted: Wanted | None = None
    ) -> None:
        """Call ``handler`` with everything that is published under ``key_expression``.

        Save what is not ``wanted``, which is asked before the bytes are copied, and what is longer
        than ``zenoh_settings.LONGEST_MESSAGE_BYTES``, which Zenoh drops by itself.
        """
        check_key_expression(key_expression)

        def hear(sample: zenoh.Sample) -> None:
            key, payload = str(sample.key_expr), sample.payload
            if wanted is None or wanted(key, len(payload)):
                handler(Received(key, payload.to_bytes()))

        guarded = self._guard.wrap(hear, f"subscriber to {key_expression}")

        def receive(sample: zenoh.Sample) -> None:
            if not self._closing.is_set():
                guarded(sample)

        self._declare(lambda session: session.declare_subscriber(key_expression, receive))

    def answer(self, key: str, answerer: Answerer) -> None:
        """Answer queries for ``key`` with what ``answerer(request)`` returns; ``None`` is none."""
        check_key(key)
        guarded = self._guard.wrap(answerer, f"answerer of {key}")

        def reply(query: zenoh.Query) -> None:
            with query:
                payload = None if self._closing.is_set() else guarded(_request(query))
                if payload is not None:
                    query.reply(key, payload)

        self._declare(lambda session: session.declare_queryable(key, reply))

    def query(self, key_expression: str, timeout_s: float, request: bytes = b"") -> list[Received]:
        """Put ``request`` to all who answer under ``key_expression``; return what came in time.

        Returns at once where nobody answers; whoever asks again should wait a little.
        """
        check_key_expression(key_expression)
        with self._lock:
            session, asking = self._session, self._asking
        if session is None:
            return []
        answers: list[Received] = []
        with suppress(zenoh.ZError):  # closed meanwhile
            for reply in _ask(session, key_expression, timeout_s, request, asking):
                if reply.ok is not None:
                    answers.append(Received(str(reply.ok.key_expr), reply.ok.payload.to_bytes()))
                elif reply.err is not None:
                    log.debug("no answer", key=key_expression, why=reply.err.payload.to_string())
        return answers

    def ask_no_more(self) -> None:
        """Break off the queries that wait for answers; nobody is asked from now on."""
        with self._lock:
            self._asking.cancel()  # type: ignore[no-untyped-call]

    def declare_alive(self, key: str) -> None:
        """Hold a liveliness token under ``key`` until closed."""
        check_key(key)
        self._declare(lambda session: session.liveliness().declare_token(key))

    def watch_alive(self, key_expression: str, handler: AliveHandler) -> None:
        """Call ``handler(key, alive)`` for tokens held now, and as they come and go.

        While this node is cut off, those beyond the cut are not alive.
        """
        check_key_expression(key_expression)
        guarded = self._guard.wrap(handler, f"watcher of {key_expression}")

        def hear(sample: zenoh.Sample) -> None:
            if not self._closing.is_set():
                guarded(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        self._declare(
            lambda session: session.liveliness().declare_subscriber(
                key_expression, hear, history=True
            )
        )

    def on_link(self, handler: LinkHandler) -> None:
        """Call ``handler`` whenever a client has found a router, the same again or another."""
        self._on_link.append(self._guard.wrap(handler, "who waits for a link"))

    def close(self) -> None:
        """Undeclare everything and close, within 2 s. Closing twice is harmless."""
        with self._lock:
            if self._closing.is_set():
                return
            self._closing.set()
            former = self._take_out()
        former.end()
        if self._keeper.is_alive():
            self._keeper.join(CLOSE_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _adopt(self, session: zenoh.Session) -> bool:
        """Declare in ``session`` what has been asked for, and use it; not if closed meanwhile.

        The former session is left, and who still waits in it for answers goes without.
        """
        with self._lock:
            if self._closing.is_set():
                return False
            former = self._take_out()
            self._declared = [declare(session) for declare in self._declarations]
            self._session = session
            if not self._asking.is_cancelled:
                self._asking.cancel()  # type: ignore[no-untyped-call]
                self._asking = zenoh.CancellationToken()
        log.info("session open", zid=str(session.zid()))
        former.undeclare()
        if former.session is not None:
            leave(former.session)
        return True

    def _tell_linked(self) -> None:
        for handler in self._on_link:
            handler()

    def _declare(self, declare: Callable[[zenoh.Session], _Undeclarable]) -> None:
        with self._lock:
            if self._closing.is_set():
                raise BusClosedError("nothing can be declared, the bus is closed")
            self._declarations.append(declare)
            if self._session is not None:
                self._declared.append(declare(self._session))

    def _publisher(self, key: str, priority: Priority) -> zenoh.Publisher | None:
        """Declare a publisher, once for each key and priority; ``None`` without a session."""
        check_key(key)
        with self._lock:
            if self._session is None or self._closing.is_set():
                return None
            publisher = self._session.declare_publisher(
                key,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=_PRIORITIES[priority],
            )
            return self._publishers.setdefault((key, priority), publisher)

    def _take_out(self) -> _Former:
        """Return the session and what is declared in it; from now on there is none.

        Publishers end with their session: somebody may just be publishing, and then Zenoh refuses
        to undeclare.
        """
        with self._lock:
            former = _Former(self._session, self._declared[::-1])
            self._session = None
            self._publishers = {}
            self._declared = []
            return former


class _Former(NamedTuple):
    """A session that is used no more."""

    session: zenoh.Session | None
    declared: list[_Undeclarable]

    def end(self) -> None:
        """Undeclare everything and close, within ``CLOSE_S``.

        A half-open link with full buffers would hold Zenoh's close for 10 s: such a link is left
        to itself, and to the lease at its other end.
        """
        closer = threading.Thread(target=self._close, name="zenoh-close", daemon=True)
        closer.start()
        closer.join(CLOSE_S)
        if closer.is_alive():
            log.warning("a link does not take our goodbye and is left to itself")

    def undeclare(self) -> None:
        """Let nobody be called any more; a callback would hold up the end of the program."""
        for declared in self.declared:
            with suppress(zenoh.ZError):
                declared.undeclare()

    def _close(self) -> None:
        self.undeclare()
        if self.session is not None:
            with suppress(zenoh.ZError):
                self.session.close()  # type: ignore[no-untyped-call]


def _open_router(settings: zenoh.Config, listen: Sequence[str]) -> zenoh.Session:
    try:
        return zenoh.open(settings)
    except zenoh.ZError as error:
        reason = str(error).partition(" at /")[0]
        raise OSError(f"cannot listen on {', '.join(listen)}: {reason}; use another port") from None


def _ask(
    session: zenoh.Session,
    key_expression: str,
    timeout_s: float,
    request: bytes,
    asking: zenoh.CancellationToken,
) -> zenoh.Handler[zenoh.Reply]:
    """Ask all, and keep every reply: by default Zenoh keeps one for each key."""
    return session.get(
        key_expression,
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
        timeout=timeout_s,
        payload=request,
        cancellation_token=asking,
    )


def _request(query: zenoh.Query) -> bytes:
    return b"" if query.payload is None else query.payload.to_bytes()
