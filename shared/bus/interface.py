"""What a program may ask of the network. Handlers run on the bus's thread: only enqueue."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import NamedTuple, Protocol, Self, TypeAlias

from shared.topics import Priority


class Received(NamedTuple):
    """Bytes as they were heard, under the key they came with."""

    key: str
    payload: bytes


Handler: TypeAlias = Callable[[Received], None]
Wanted: TypeAlias = Callable[[str, int], bool]
"""Says of a key and a number of bytes whether such a message is to be heard at all."""

AliveHandler: TypeAlias = Callable[[str, bool], None]
LinkHandler: TypeAlias = Callable[[], None]
Answerer: TypeAlias = Callable[[bytes], bytes | None]
"""Makes an answer of a request, which is empty where the key says all."""


class BusClosedError(RuntimeError):
    """Something was declared on a bus that has been closed."""


class Bus(Protocol):
    """A connection to the others. Leaving its ``with`` block closes it and all it declared."""

    def publish(self, key: str, payload: bytes, priority: Priority = "data") -> None:
        """Send ``payload`` live; it is dropped where the link cannot take it."""

    def subscribe(
        self, key_expression: str, handler: Handler, wanted: Wanted | None = None
    ) -> None:
        """Call ``handler`` with everything that is published under ``key_expression``.

        Save what is not ``wanted``, which is asked before the bytes are copied.
        """

    def answer(self, key: str, answerer: Answerer) -> None:
        """Answer queries for ``key`` with what ``answerer(request)`` returns; ``None`` is none."""

    def query(self, key_expression: str, timeout_s: float, request: bytes = b"") -> list[Received]:
        """Put ``request`` to all who answer under ``key_expression``; return what came in time."""

    def ask_no_more(self) -> None:
        """Break off the queries that wait for answers; nobody is asked from now on.

        For whoever stops: an answer that is on its way over a dead link is not to be waited for.
        """

    def declare_alive(self, key: str) -> None:
        """Hold a liveliness token under ``key`` until closed."""

    def watch_alive(self, key_expression: str, handler: AliveHandler) -> None:
        """Call ``handler(key, alive)`` for tokens held now, and as they come and go."""

    def on_link(self, handler: LinkHandler) -> None:
        """Call ``handler`` whenever a link has come that was not there: now one is heard."""

    def close(self) -> None:
        """Undeclare everything and close. Closing twice is harmless."""

    def __enter__(self) -> Self:
        """Return the open bus."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close."""
