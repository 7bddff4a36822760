"""What else was heard of a DAP about the time at which it fell silent (pure).

A box that nobody hears any more may have lost its link alone, and tie nobody to anything; or be
destroyed. Its radio tells which: other DAPs and responders' units hear it, or do so no more.
"""

from __future__ import annotations

from collections.abc import Iterator

from command_post.nodes.box_words import SILENT_NS
from shared.messages import DapInstallation, DapReading, Message, NeighbourHeard, NodeId
from shared.topics import Role
from shared.units import NS_PER_S

SHORTLY_NS = 60 * NS_PER_S
"""What happened so long before it fell silent may be why."""

SURE_NS = 2 * SILENT_NS
"""DAPs tell of one another every five seconds: after so long without a word there is none."""


class LastSigns:
    """Follows when DAPs' radios were heard, and by whom, and when they were taken up."""

    def __init__(self) -> None:
        self._heard_ns: dict[NodeId, dict[tuple[Role, NodeId], int]] = {}
        self._taken_up_ns: dict[NodeId, int] = {}
        self._said_ns: dict[tuple[Role, NodeId], int] = {}

    def take(self, role: Role, node_id: NodeId, message: Message, now_ns: int) -> None:
        """Note what a node says, heard at ``now_ns``."""
        self._said_ns[role, node_id] = now_ns
        match message:
            case NeighbourHeard() | DapReading():
                self._heard_ns.setdefault(message.dap_id, {})[role, node_id] = now_ns
            case DapInstallation(installer_id=None, position=None, at_rest=False):
                self._taken_up_ns[node_id] = now_ns

    def words(self, dap_id: NodeId, now_ns: int) -> Iterator[str]:
        """Yield what may be why a DAP is silent; nothing while it is not."""
        last_ns = self._said_ns.get(("dap", dap_id), now_ns)
        if now_ns - last_ns < SILENT_NS:
            return
        taken_up_ns = self._taken_up_ns.get(dap_id, -SHORTLY_NS)
        if 0 <= last_ns - taken_up_ns < SHORTLY_NS:
            yield f"taken up {(last_ns - taken_up_ns) / NS_PER_S:.0f} s before it fell silent"
        heard = self._heard_ns.get(dap_id, {})
        still = sorted(name for (_, name), at_ns in heard.items() if at_ns >= last_ns + SILENT_NS)
        before = sorted(
            node[1]
            for node, at_ns in heard.items()
            if at_ns >= last_ns - SILENT_NS and self._said_ns[node] >= last_ns + SURE_NS
        )
        if still:
            yield f"its radio is still heard by {still[0]}: only its link is lost"
        elif before:
            yield f"its radio is heard no more by {before[0]} either: it is off, or destroyed"
