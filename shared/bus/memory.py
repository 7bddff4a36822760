"""The bus inside one process: for tests, and for programs that run together without a network."""

from __future__ import annotations

import threading
from typing import Generic, NamedTuple, Self, TypeVar

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
from shared.bus.key_expression import check_key, check_key_expression, matches
from shared.topics import Priority

H = TypeVar("H")


class _Declared(NamedTuple, Generic[H]):
    """What a bus wants to be called for."""

    bus: MemoryBus
    expression: str
    handler: H


class MemoryNetwork:
    """What the buses of one process are connected to."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.subscribers: list[_Declared[Handler]] = []
        self.answerers: list[_Declared[Answerer]] = []
        self.watchers: list[_Declared[AliveHandler]] = []
        self.tokens: list[_Declared[None]] = []

    def connect(self) -> MemoryBus:
        """Return a new bus on this network."""
        return MemoryBus(self)


class MemoryBus:
    """A ``Bus`` that delivers at once: handlers have run when ``publish`` returns.

    They run in the publisher's thread, for its own messages too. What a handler publishes is
    delivered before the next handler is called.
    """

    def __init__(self, network: MemoryNetwork) -> None:
        self._network = network
        self._guard = HandlerGuard()
        self._closed = False
        self._asks = True

    @property
    def handler_failures(self) -> int:
        """How often one of this bus's handlers has raised."""
        return self._guard.failures

    def publish(self, key: str, payload: bytes, priority: Priority = "data") -> None:  # noqa: ARG002
        """Hand ``payload`` to every handler subscribed to ``key``; to none once closed."""
        check_key(key)
        if self._closed:
            return
        received = Received(key, payload)
        for handler in self._handlers(self._network.subscribers, key):
            handler(received)

    def subscribe(
        self, key_expression: str, handler: Handler, wanted: Wanted | None = None
    ) -> None:
        """Call ``handler`` with everything that is published under ``key_expression``.

        Save what is not ``wanted``.
        """
        check_key_expression(key_expression)

        def receive(received: Received) -> None:
            if wanted is None or wanted(received.key, len(received.payload)):
                handler(received)

        guarded = self._guard.wrap(receive, f"subscriber to {key_expression}")
        self._declare(self._network.subscribers, key_expression, guarded)

    def answer(self, key: str, answerer: Answerer) -> None:
        """Answer queries for ``key`` with what ``answerer(request)`` returns; ``None`` is none."""
        check_key(key)
        guarded = self._guard.wrap(answerer, f"answerer of {key}")
        self._declare(self._network.answerers, key, guarded)

    def query(
        self,
        key_expression: str,
        timeout_s: float,  # noqa: ARG002
        request: bytes = b"",
    ) -> list[Received]:
        """Put ``request`` to all who answer under ``key_expression``; to none once closed."""
        check_key_expression(key_expression)
        if self._closed or not self._asks:
            return []
        with self._network.lock:
            asked = [a for a in self._network.answerers if matches(key_expression, a.expression)]
        answers = ((answerer.expression, answerer.handler(request)) for answerer in asked)
        return [Received(key, payload) for key, payload in answers if payload is not None]

    def ask_no_more(self) -> None:
        """Ask nobody from now on."""
        self._asks = False

    def declare_alive(self, key: str) -> None:
        """Hold a liveliness token under ``key`` until closed."""
        check_key(key)
        known = self._declare(self._network.tokens, key, None)
        if all(token.expression != key for token in known):
            self._tell(key, alive=True)

    def watch_alive(self, key_expression: str, handler: AliveHandler) -> None:
        """Call ``handler(key, alive)`` for tokens held now, and as they come and go."""
        check_key_expression(key_expression)
        guarded = self._guard.wrap(handler, f"watcher of {key_expression}")
        with self._network.lock:
            self._declare(self._network.watchers, key_expression, guarded)
            alive = {token.expression for token in self._network.tokens}
        for key in sorted(alive):
            if matches(key_expression, key):
                guarded(key, True)

    def on_link(self, handler: LinkHandler) -> None:
        """Call nobody: the link is there from the first to the last."""

    def close(self) -> None:
        """Undeclare everything; those who watch see the tokens go. Closing twice is harmless."""
        network = self._network
        with network.lock:
            self._closed = True
            own = {token.expression for token in network.tokens if token.bus is self}
            self._undeclare(network.subscribers)
            self._undeclare(network.answerers)
            self._undeclare(network.watchers)
            self._undeclare(network.tokens)
            gone = own.difference(token.expression for token in network.tokens)
        for key in sorted(gone):
            self._tell(key, alive=False)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _declare(
        self, declared: list[_Declared[H]], expression: str, handler: H
    ) -> list[_Declared[H]]:
        """Add to ``declared``; return what was there before."""
        with self._network.lock:
            if self._closed:
                raise BusClosedError(f"{expression}: nothing can be declared, the bus is closed")
            before = list(declared)
            declared.append(_Declared(self, expression, handler))
            return before

    def _undeclare(self, declared: list[_Declared[H]]) -> None:
        declared[:] = [entry for entry in declared if entry.bus is not self]

    def _handlers(self, declared: list[_Declared[H]], key: str) -> list[H]:
        with self._network.lock:
            return [entry.handler for entry in declared if matches(entry.expression, key)]

    def _tell(self, key: str, *, alive: bool) -> None:
        for handler in self._handlers(self._network.watchers, key):
            handler(key, alive)
