"""Where a wearer's call for help goes out, and the post's answer comes in, on a thread of its own.

It hangs on no sensor, and on no link: what is said is in the journal first.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import structlog
from rich.console import Console

from edge_agent.desk import Desk
from edge_agent.mayday import MaydayCall, Saying
from edge_agent.mayday_controls import Control
from shared.bus.interface import Bus
from shared.clock import Clock
from shared.gate import Gate
from shared.messages import Mayday, MaydayAnswer, NodeId
from shared.sender import Sender

_log = structlog.stdlib.get_logger(__name__)


class MaydayDesk(Desk):
    """Says what the wearer calls by their controls, again and again, and tells them who heard."""

    def __init__(
        self,
        bus: Bus,
        incident: NodeId,
        call: MaydayCall,
        sender: Sender,
        gate: Gate,
        clock: Clock,
        controls: Sequence[Control],
        linked: Callable[[], bool] = lambda: True,
    ) -> None:
        """``controls`` are closed in the end; ``linked``: whether there is anybody to hear."""
        super().__init__(bus, incident, "mayday_answer", gate)
        self._linked = linked
        self._call = call
        self._sender = sender
        self._clock = clock
        self._controls = tuple(controls)

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        for control in self._controls:
            control.close()

    def attend(self, wait_s: float = 0.0) -> None:
        """Heed the controls and what has come, within ``wait_s`` at most; say what is due."""
        for control in self._controls:
            for act, reason in control.requests(stands=self._call.stands):
                self._tell(self._call.take(act, reason, self._clock.now_ns()))
        self._say_due()
        for key, message in self._heard(wait_s):
            if isinstance(message, MaydayAnswer):
                words = self._call.hear(key.node_id, message, self._clock.now_ns())
                if words is not None:
                    self._tell(words)

    def _say_due(self) -> None:
        saying = self._call.due(time.monotonic(), linked=self._linked())
        if saying is not None:
            self._sender.send(self._message(saying))

    def _message(self, saying: Saying) -> Mayday:
        return Mayday(
            event_time_ns=saying.since_ns,
            sequence=self._sender.next_sequence(Mayday),
            phase=saying.phase,
            called_ns=saying.called_ns,
            reason=saying.reason,
        )

    def _tell(self, words: str) -> None:
        """Tell the wearer: a line on standard output, for whatever speaks or shows it."""
        Console().print(f"MAYDAY {words}", highlight=False, markup=False, soft_wrap=True)
        _log.warning("mayday", stands=words)
        for control in self._controls:
            control.tell(words)
