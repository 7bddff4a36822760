"""Between what the post says and who looks at it: what is shown one way, what is asked the other.

What the post says is left here; whoever looks makes something of it. A search for a way takes long,
and holds up neither who leaves something nor those who only watch.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from command_post.gateways.geojson import Feature, Scene, feature_collection
from command_post.roster import Roster
from command_post.ways import Way
from command_post.web.board import Board, Changes
from command_post.web.handover import Handover
from command_post.web.pathfinder import Pathfinder
from command_post.web.pipe import ALIVE
from shared.bus.inbox import Inbox
from shared.codec import encode
from shared.messages import Message, NodeId
from shared.topics import TOPIC_OF, Key
from shared.units import NS_PER_MS

MOST_REQUESTS = 256
KEEP_UP_S = 0.5
"""So often at least is taken in what the post has left, whether anybody looks or not."""


class Page:
    """What the post tells and is asked, by threads that know nothing of each other."""

    def __init__(self, incident: NodeId) -> None:
        self._incident = incident
        self._board = Handover(Board())
        self._paths = Handover(Pathfinder())
        self._lock = threading.Lock()
        self._requests: Inbox[tuple[str, bytes]] = Inbox(MOST_REQUESTS)
        self._last_number = 0
        self._now_ns = 0

    def published(self, key_text: str, payload: bytes) -> None:
        """Take in what the post has published."""
        self._board.published(key_text, payload)
        self._paths.published(key_text, payload)

    def show(self, roster: Roster) -> None:
        """Take in the newest roster."""
        self._now_ns = roster.now_ns
        self._board.show(roster)
        self._paths.show(roster)

    def keep_up(self, stop: threading.Event, kept_up: Callable[[], None]) -> None:
        """Take in what was left, although nobody may look, until ``stop`` is set.

        Calls ``kept_up`` each time that is done.
        """
        while not stop.wait(KEEP_UP_S):
            self.take_in()
            kept_up()

    def take_in(self) -> None:
        """Take in what was left, at the expense of whoever calls this."""
        with self._board.now():
            pass
        with self._paths.now():
            pass

    def since(self, version: int) -> Changes:
        """Return what has changed since ``version`` of the board."""
        with self._board.now() as board:
            return board.since(version)

    def features(self) -> Feature | None:
        """Return who and what is where, as GeoJSON; ``None`` while nobody knows where that is."""
        with self._board.now() as board:
            whole, daps, origin = board.since(0), board.daps, board.origin
        if origin is None:
            return None
        return feature_collection(Scene(whole.tracks, whole.trails or {}, daps), origin)

    def way_out(self, responder_id: NodeId) -> Way | None:
        """Return the quickest way that somebody has out, if one was walked."""
        with self._paths.now() as paths:
            return paths.way_out(responder_id)

    def rescue(self, responder_id: NodeId) -> tuple[NodeId, Way] | None:
        """Return who of the others is soonest there, and by what way, if there is any."""
        with self._paths.now() as paths:
            return paths.rescue(responder_id)

    @property
    def waiting(self) -> int:
        """How many messages of the post wait to be taken in."""
        return max(self._board.waiting, self._paths.waiting)

    @property
    def dropped(self) -> int:
        """How many messages of the post the page has not taken in time."""
        return self._board.dropped

    @property
    def now_ns(self) -> int:
        """What the post's clock read when it last told."""
        return self._now_ns

    def next_number(self) -> int:
        """Return a number for a request that none before it had, in this process or another."""
        with self._lock:
            self._last_number = max(self._last_number + 1, time.time_ns() // NS_PER_MS)
            return self._last_number

    def ask(self, name: NodeId, message: Message) -> None:
        """Have the post do what ``name`` asks for in ``message``."""
        key = Key(self._incident, "post", name, TOPIC_OF[type(message)].name)
        self._requests.put((str(key), encode(message)))

    def say_alive(self) -> None:
        """Have the post know that nothing here is stuck."""
        self._requests.put(ALIVE)

    def take_requests(self, timeout_s: float = 0.0) -> list[tuple[str, bytes]]:
        """Return what people have asked for since, as messages under their keys.

        Waits for it as long as ``timeout_s``.
        """
        return self._requests.get_all(timeout_s)
