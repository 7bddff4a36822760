"""What a recording has beside the wire, to be looked at: the post's words as Foxglove draws them.

It is made of the wire bytes and is no evidence: whoever replays passes it over. It waits in memory
and goes into chunks of its own, which pack well and which nobody reads for anything else; a kill
takes what has waited.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

import msgspec

from command_post.desks.announcer import Outgoing
from command_post.gateways.foxglove import Drawing, FoxgloveBoard
from command_post.gateways.foxglove_schemas import drawable_schema, schema_name
from command_post.nodes.told import is_taken_up
from shared.codec import Refusal, message_of
from shared.geodesy import Origin
from shared.messages import DapInstallation, Message, OutsideWord
from shared.units import NS_PER_S

MOST_BYTES = 1 << 21
LONGEST_NS = 30 * NS_PER_S
"""So much is put into a chunk, or what has been drawn in so long."""


class Drawn(NamedTuple):
    """A message to be written: the name and the JSON Schema of its kind, and its JSON."""

    topic: str
    schema: str
    schema_data: bytes
    data: bytes
    time_ns: int


class Mirror:
    """Draws what is recorded, and keeps it until there is enough for a chunk."""

    def __init__(self, origin: Origin | None) -> None:
        """Without ``origin`` there is nothing for a map."""
        self._board = FoxgloveBoard(origin)
        self._drawn: list[Drawn] = []
        self._bytes = 0
        self._again = False

    def take(self, node_id: str, message: Message, time_ns: int, *, outgoing: bool) -> None:
        """Draw what somebody said, recorded at ``time_ns``: what the post makes (``outgoing``).

        Of what it receives, words from outside, and that an access point was taken up.
        """
        if isinstance(message, DapInstallation) and is_taken_up(message):
            self._add(self._board.take_up(node_id, time_ns))
        if not outgoing and not isinstance(message, OutsideWord):
            return
        if self._again:
            self._add(self._board.standing(time_ns))
            self._again = False
        self._add(self._board.take(message, time_ns))

    def recall(self, said: Iterable[Outgoing]) -> None:
        """Take in what stands of what the post said before a kill: it has been drawn."""
        for each in said:
            message = message_of(each.key, each.payload)
            if not isinstance(message, Refusal):
                deque(self._board.take(message, message.event_time_ns), maxlen=0)

    def draw_again(self) -> None:
        """Draw everything once more that stands, with what comes next: a new part begins."""
        self._again = True

    def _add(self, drawings: Iterable[Drawing]) -> None:
        for topic, drawing, at_ns in drawings:
            kind = type(drawing)
            data = msgspec.json.encode(drawing)
            self._drawn.append(Drawn(topic, schema_name(kind), drawable_schema(kind), data, at_ns))
            self._bytes += len(data)

    @property
    def is_due(self) -> bool:
        """Whether there is enough for a chunk."""
        if not self._drawn:
            return False
        since_ns = self._drawn[-1].time_ns - self._drawn[0].time_ns
        return self._bytes >= MOST_BYTES or not 0 <= since_ns < LONGEST_NS

    def take_all(self) -> list[Drawn]:
        """Return all that has been drawn since, each topic's in order."""
        # What is alike packs better side by side.
        drawn = sorted(self._drawn, key=lambda each: (each.schema, each.topic))
        self._drawn, self._bytes = [], 0
        return drawn
