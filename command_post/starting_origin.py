"""The origin that the command line gives: said once, as by a guest of the post."""

from __future__ import annotations

import time

from command_post.desks.command_desk import START_ID
from command_post.roster import Roster
from shared.codec import encode
from shared.geodesy import Origin
from shared.messages import NodeId
from shared.topics import Key


class StartingOrigin:
    """Asks the post once to take an origin; what people set since counts more."""

    def __init__(self, incident: NodeId, origin: Origin) -> None:
        message = origin.as_message(time.time_ns(), 0)
        key = Key(incident, "post", START_ID, "origin")
        self._requests = [(str(key), encode(message))]

    def published(self, key_text: str, payload: bytes) -> None:
        """Pass: it follows nothing."""

    def show(self, roster: Roster) -> None:
        """Pass: it shows nothing."""

    def take_requests(self) -> list[tuple[str, bytes]]:
        """Return the request, the first time."""
        requests, self._requests = self._requests, []
        return requests
