"""Where a wearer who carries DAPs is told to set one down, and the post that they were told."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import NamedTuple

import structlog
from rich.console import Console

from shared.drop_adviser import Advice, DropAdviser
from shared.messages import DropAdvice, NodeId, OdometryIncrement
from shared.sender import Sender

_log = structlog.stdlib.get_logger(__name__)


class Beacon(NamedTuple):
    """A reading of a DAP's signal strength (dBm) at the unit, on the product's scale."""

    time_ns: int
    dap_id: NodeId
    rssi_dbm: float


class DropDesk:
    """Lets the adviser know of movements and DAPs heard, and passes on what it advises.

    ``boxes`` are what the wearer carries in. Movements come on one thread; DAPs may be heard on
    another, that of the unit's radio.
    """

    def __init__(self, sender: Sender, boxes: int, tell: Callable[[Advice], None]) -> None:
        self._sender = sender
        self._adviser = DropAdviser(boxes)
        self._one_at_a_time = threading.Lock()
        self._tell = tell

    def hear(self, beacon: Beacon) -> None:
        """Take in how loud a DAP is."""
        with self._one_at_a_time:
            self._adviser.hear(*beacon)

    def move(self, increment: OdometryIncrement) -> None:
        """Take in a movement; tell the wearer and the post what follows from it, if anything."""
        with self._one_at_a_time:
            advice = self._adviser.move(
                increment.event_time_ns,
                (increment.d_north_m, increment.d_east_m, increment.d_down_m),
                increment.activity,
            )
            boxes = self._adviser.boxes
        self._pass_on(advice, boxes)

    def heed(self, now_ns: int, reason: str) -> None:
        """Take in that the post finds a DAP wanted here; pass it on to the wearer if it is new."""
        with self._one_at_a_time:
            advice = self._adviser.heed(now_ns, f"the post: {reason}")
            boxes = self._adviser.boxes
        self._pass_on(advice, boxes)

    def _pass_on(self, advice: Advice | None, boxes: int) -> None:
        if advice is None:
            return
        self._tell(advice)
        self._sender.send(
            DropAdvice(
                event_time_ns=advice.time_ns,
                sequence=self._sender.next_sequence(DropAdvice),
                urgency=advice.urgency,
                reason=advice.reason,
                boxes_left=boxes,
            )
        )


def tell_wearer_to_set_down(advice: Advice) -> None:
    """Tell the wearer: a line on standard output, for whatever speaks or shows it."""
    Console().print(
        f"SET A DAP DOWN: {advice.reason}", highlight=False, markup=False, soft_wrap=True
    )
    _log.info("advice", urgency=round(advice.urgency, 2), reason=advice.reason)
