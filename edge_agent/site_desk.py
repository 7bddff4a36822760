"""Where the post's word comes in that a DAP is wanted where the wearer is."""

from __future__ import annotations

from collections.abc import Callable

from edge_agent.desk import Desk
from edge_agent.drop_desk import DropDesk
from shared.clock import Clock
from shared.gate import Gate
from shared.messages import NodeId, SiteAdvice, TimeNs
from shared.node import Node
from shared.topics import Key
from shared.units import NS_PER_S

FRESH_NS = 5 * NS_PER_S
"""What was said so much longer ago was of another place."""


class SiteDesk(Desk):
    """Hands what the post ``post_id`` says of this unit's place to who advises its wearer."""

    def __init__(
        self,
        node: Node,
        post_id: NodeId,
        drop_desk: DropDesk,
        post_time_ns: Callable[[NodeId], TimeNs | None],
    ) -> None:
        """``post_time_ns``: what time it is at a post, as far as that is known."""
        super().__init__(node.bus, node.incident, "site", Gate(node.verifier))
        self._responder_id = node.node_id
        self._clock: Clock = node.clock
        self._post_id = post_id
        self._drop_desk = drop_desk
        self._post_time_ns = post_time_ns

    def attend(self, wait_s: float = 0.0) -> None:
        """Heed what has come, within ``wait_s`` at most."""
        for key, message in self._heard(wait_s):
            if isinstance(message, SiteAdvice) and self._is_meant(key, message):
                self._drop_desk.heed(self._clock.now_ns(), message.reason)

    def _is_meant(self, key: Key, advice: SiteAdvice) -> bool:
        if key.node_id != self._post_id or advice.responder_id != self._responder_id:
            return False
        now_ns = self._post_time_ns(self._post_id)
        return now_ns is not None and now_ns - advice.event_time_ns <= FRESH_NS
