"""Where a wearer's call for help goes out, and the post's answer comes in, on a thread of its own.

It hangs on no sensor, and on no link: what is said is in the journal first.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import Self

import structlog
from rich.console import Console

from edge_agent.mayday import MaydayCall, Saying
from edge_agent.mayday_controls import Control
from shared.bus.inbox import Inbox
from shared.bus.interface import Bus, Received
from shared.clock import Clock
from shared.codec import Refusal, decode, parse_key
from shared.gate import Gate
from shared.messages import Mayday, MaydayAnswer, NodeId
from shared.sender import Sender
from shared.topics import Key

POLL_S = 0.1
MOST_ANSWERS = 64

_log = structlog.stdlib.get_logger(__name__)


class MaydayDesk:
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
        self._linked = linked
        self._call = call
        self._sender = sender
        self._gate = gate
        self._clock = clock
        self._controls = tuple(controls)
        self._answers: Inbox[Received] = Inbox(MOST_ANSWERS)
        self._stop = threading.Event()
        # No daemon: it is inside Zenoh when it calls.
        self._thread = threading.Thread(target=self._run, name="mayday", daemon=False)
        bus.subscribe(str(Key(incident, "post", "*", "mayday_answer")), self._answers.put)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        for control in self._controls:
            control.close()

    def attend(self, wait_s: float = 0.0) -> None:
        """Heed the controls and what has come, within ``wait_s`` at most; say what is due."""
        for control in self._controls:
            for act, reason in control.requests(stands=self._call.stands):
                self._tell(self._call.take(act, reason, self._clock.now_ns()))
        self._say_due()
        for received in self._answers.get_all(wait_s):
            self._heed(received)

    def _run(self) -> None:
        while not self._stop.is_set():
            self.attend(POLL_S)

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

    def _heed(self, received: Received) -> None:
        key = parse_key(received.key)
        if isinstance(key, Refusal) or self._gate.doubt(*received) is not None:
            return
        answer = decode(key, received.payload)
        if isinstance(answer, MaydayAnswer):
            words = self._call.hear(key.node_id, answer, self._clock.now_ns())
            if words is not None:
                self._tell(words)

    def _tell(self, words: str) -> None:
        """Tell the wearer: a line on standard output, for whatever speaks or shows it."""
        Console().print(f"MAYDAY {words}", highlight=False, markup=False, soft_wrap=True)
        _log.warning("mayday", stands=words)
        for control in self._controls:
            control.tell(words)
