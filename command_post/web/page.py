"""Between the post and its page: what is shown goes one way, what people ask for the other."""

from __future__ import annotations

import threading
import time

from command_post.gateways.geojson import Feature, Scene, feature_collection
from command_post.roster import Roster
from command_post.roster_json import roster_json
from command_post.ways import Way
from command_post.web.board import Board, Changes
from shared.bus.inbox import Inbox
from shared.codec import encode
from shared.geodesy import Origin
from shared.messages import Message, NodeId
from shared.topics import TOPICS, Key

MOST_REQUESTS = 256
NS_PER_MS = 1_000_000

_TOPIC_OF = {topic.message: topic.name for topic in TOPICS.values()}


class Page:
    """What the post tells and is asked, by threads that know nothing of each other."""

    def __init__(self, incident: NodeId) -> None:
        self._incident = incident
        self._board = Board()
        self._lock = threading.Lock()
        self._requests: Inbox[tuple[str, bytes]] = Inbox(MOST_REQUESTS)
        self._last_number = 0
        self._now_ns = 0

    def published(self, key_text: str, payload: bytes) -> None:
        """Take in what the post has published."""
        with self._lock:
            self._board.publish(key_text, payload)

    def show(self, roster: Roster) -> None:
        """Take in the newest roster."""
        encoded = roster_json(roster)
        with self._lock:
            self._now_ns = roster.now_ns
            self._board.show(roster, encoded)

    def since(self, version: int) -> Changes:
        """Return what has changed since ``version`` of the board."""
        with self._lock:
            return self._board.since(version)

    def features(self, origin: Origin) -> Feature:
        """Return who and what is where, as GeoJSON."""
        with self._lock:
            whole, daps = self._board.since(0), self._board.daps
        return feature_collection(Scene(whole.tracks, whole.trails or {}, daps), origin)

    def way_out(self, responder_id: NodeId) -> Way | None:
        """Return the quickest way that somebody has out, if one was walked."""
        with self._lock:
            return self._board.way_out(responder_id)

    def rescue(self, responder_id: NodeId) -> tuple[NodeId, Way] | None:
        """Return who of the others is soonest there, and by what way, if there is any."""
        with self._lock:
            return self._board.rescue(responder_id)

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
        key = Key(self._incident, "post", name, _TOPIC_OF[type(message)])
        self._requests.put((str(key), encode(message)))

    def take_requests(self) -> list[tuple[str, bytes]]:
        """Return what people have asked for since, as messages under their keys."""
        return self._requests.get_all()
