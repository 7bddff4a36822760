"""One pass of a DAP, told by both ends of the link, counts once (pure).

The DAP hears the responder, and the responder's unit hears the DAP: the same radios at the same
moment say the same. Which of them is heard of first, counts.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from typing import Literal, TypeAlias

from shared.messages import NodeId
from shared.units import NS_PER_S

SAME_PASS_NS = 5 * NS_PER_S
MOST_PAIRS = 20_000
KEPT = 8

Side: TypeAlias = Literal["dap", "responder"]


class BothWays:
    """Remembers of each DAP and responder when either end told last of a pass."""

    def __init__(self) -> None:
        self.repeated = 0
        """How many passes were told by the other side as well."""

        self._told: OrderedDict[tuple[NodeId, NodeId], deque[tuple[int, Side]]] = OrderedDict()

    def is_told(self, side: Side, dap_id: NodeId, responder_id: NodeId, time_ns: int) -> bool:
        """Say whether the other side has told of that pass; note it if not."""
        pair = (dap_id, responder_id)
        told = self._told.setdefault(pair, deque(maxlen=KEPT))
        self._told.move_to_end(pair)
        if any(by != side and abs(time_ns - at_ns) <= SAME_PASS_NS for at_ns, by in told):
            self.repeated += 1
            return True
        told.append((time_ns, side))
        if len(self._told) > MOST_PAIRS:
            self._told.popitem(last=False)
        return False
