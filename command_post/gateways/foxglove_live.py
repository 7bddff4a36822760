"""Foxglove looking in on a running post: the channels of its recording over a WebSocket.

Foxglove's own library serves them; it has no sign-in, so it is for this machine alone, and nothing
can be said by it. Who is slow misses the oldest, and the post waits for nobody: it leaves what it
says, and a thread draws it.
"""

from __future__ import annotations

import importlib.util
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import msgspec
import structlog

from command_post.gateways.at_work import at_work
from command_post.gateways.foxglove import Drawing, FoxgloveBoard
from command_post.gateways.foxglove_schemas import (
    Drawable,
    GeoJSON,
    Log,
    drawable_schema,
    schema_name,
)
from command_post.listening import Address, listening_address
from command_post.roster import Roster
from shared.bus.inbox import Inbox
from shared.codec import Refusal, message_of
from shared.geodesy import Origin

if TYPE_CHECKING:
    import foxglove

MOST_WAITING = 10_000
"""Messages that are left for the thread; the oldest make room."""

BACKLOG = 2048
"""Messages that wait for a client; the oldest make room."""

LOOK_S = 0.2
AGAIN_S = 3.0
"""Everything is drawn again as it stands so often: who has just come has missed it."""

_DRAWN = frozenset({"origin", "track", "dap_place", "alert", "order", "outside"})

_log = structlog.stdlib.get_logger(__name__)


def foxglove_address(text: str) -> Address:
    """Return the address in ``--foxglove HOST:PORT``.

    Raises ``ValueError`` for a malformed one, for one beyond this machine, and without the library.
    """
    address = listening_address("--foxglove", text, "127.0.0.1:8765")
    if not address.is_local:
        raise ValueError(
            f"--foxglove {text!r}: nobody signs in there, so it is for this machine alone; use "
            "127.0.0.1:PORT, and from elsewhere a tunnel: ssh -L 8765:127.0.0.1:8765 HOST"
        )
    if importlib.util.find_spec("foxglove") is None:
        raise ValueError("--foxglove: its library is missing: pip install 'clew[foxglove]'")
    return address


class FoxgloveDoor:
    """Draws what the post says for whoever looks in."""

    def __init__(self, address: Address, incident: str, origin: Origin | None) -> None:
        """Listen at ``address``. Raises ``OSError`` if nobody can listen there."""
        import foxglove  # noqa: PLC0415

        self._foxglove = foxglove
        self._context = foxglove.Context()
        self._channels: dict[str, foxglove.Channel] = {}
        self._board = FoxgloveBoard(origin)
        self._left: Inbox[tuple[str, bytes] | frozenset[str]] = Inbox(MOST_WAITING)
        self._stop = threading.Event()
        try:
            self._server = foxglove.start_server(
                name=f"Clew {incident}", host=address.host, port=address.port,
                context=self._context, message_backlog_size=BACKLOG,
            )  # fmt: skip
        except RuntimeError as error:
            raise OSError(
                f"--foxglove {address.host}:{address.port}: cannot listen ({error}); "
                "use another port"
            ) from error
        # They can be asked for before there is anything on them.
        self._channel("/log", Log)
        if origin is not None:
            self._channel("/map", GeoJSON)
        self.port = self._server.port
        _log.info("Foxglove may look in", url=f"ws://{address.host}:{self.port}")

    @property
    def watched(self) -> frozenset[str]:
        """The topics that somebody looks at."""
        channels = list(self._channels.items())
        return frozenset(topic for topic, channel in channels if channel.has_sinks())

    def published(self, key_text: str, payload: bytes) -> None:
        """Take in what the post has published."""
        if key_text.rpartition("/")[2] in _DRAWN:
            self._left.put((key_text, payload))

    def show(self, roster: Roster) -> None:
        """Take in the newest roster: it tells which access points were taken up."""
        self._left.put(frozenset(row.dap_id for row in roster.daps if row.position is not None))

    def take_requests(self) -> list[tuple[str, bytes]]:
        """Return what was asked for: nothing can be."""
        return []

    def stop(self) -> None:
        """Have ``run`` return soon."""
        self._stop.set()

    def run(self) -> None:
        """Draw until stopped, then let everybody go."""
        again_s = time.monotonic() + AGAIN_S
        while not self._stop.is_set():
            for left in self._left.get_all(LOOK_S):
                if isinstance(left, frozenset):
                    for name in sorted(self._board.daps - left):
                        self._draw(self._board.take_up(name, time.time_ns()))
                else:
                    self._take(*left)
            if time.monotonic() >= again_s:
                again_s = time.monotonic() + AGAIN_S
                if self.watched:
                    self._draw(self._board.standing(time.time_ns()))
        self._server.stop()

    def _take(self, key_text: str, payload: bytes) -> None:
        message = message_of(key_text, payload)
        if not isinstance(message, Refusal):
            self._draw(self._board.take(message, time.time_ns()))

    def _draw(self, drawings: Iterable[Drawing]) -> None:
        for topic, drawing, time_ns in drawings:
            self._channel(topic, type(drawing)).log(msgspec.json.encode(drawing), log_time=time_ns)

    def _channel(self, topic: str, kind: type[Drawable]) -> foxglove.Channel:
        if topic not in self._channels:
            schema = self._foxglove.Schema(
                name=schema_name(kind), encoding="jsonschema", data=drawable_schema(kind)
            )
            self._channels[topic] = self._foxglove.Channel(
                topic, schema=schema, message_encoding="json", context=self._context
            )
        return self._channels[topic]


@contextmanager
def foxglove_served(
    address: Address | None, incident: str, origin: Origin | None
) -> Iterator[FoxgloveDoor | None]:
    """Let Foxglove look in until the block ends; ``None`` without an address.

    Raises ``OSError`` if nobody can listen there.
    """
    if address is None:
        yield None
        return
    door = FoxgloveDoor(address, incident, origin)
    with at_work(door, "foxglove"):
        yield door
