"""What a node states of its clock: it asks the post, and notes what of its journal it dated."""

from __future__ import annotations

from pathlib import Path
from typing import Self

from shared.bus.interface import Bus
from shared.clock import PacedClock, SystemClock
from shared.clock_spans import ClockSpans, DatedSpan, boot_id
from shared.gate import Verifier
from shared.messages import ClockStatement, NodeId, TimeNs
from shared.outbox import JournalledOutbox
from shared.time_service import TimeAsker


class NodeTime:
    """Asks what time it is at the post, within a ``with`` block, and says what follows."""

    def __init__(
        self,
        bus: Bus,
        incident: NodeId,
        clock: PacedClock,
        outbox: JournalledOutbox,
        journal: Path,
        verifier: Verifier | None = None,
    ) -> None:
        """``clock``: what the node dates by, of its own ``SystemClock``.

        Notes are kept beside the ``journal`` of ``outbox``. ``verifier`` knows the posts' keys.
        """
        self._clock = clock
        self._asker = TimeAsker(bus, incident, clock, verifier)
        own = SystemClock()
        kept = outbox.holdings()
        self._spans = None
        if kept:
            span = DatedSpan(
                first_number=kept[0].last_number + 1,
                begun_ns=own.now_ns(),
                boot=boot_id(),
                base_ns=own.base_ns,
            )
            beside = journal.with_name(f"{journal.name}.clock")
            self._spans = ClockSpans(beside, kept[0].run, span)

    def __enter__(self) -> Self:
        self._asker.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._asker.__exit__()

    def post_time_ns(self, post_id: NodeId) -> TimeNs | None:
        """Return what time it is at a post; ``None`` while it has not said so."""
        return self._asker.post_time_ns(post_id)

    def statement(self, run: bytes) -> ClockStatement | None:
        """Return what is known of the clock, and of what dated the journal with that ``run``.

        ``None`` while nothing is. The time line of an exercise in a hurry is the same for all
        processes: there nothing is said of earlier ones.
        """
        stated = self._asker.stated()
        if stated is None:
            return None
        spans = () if self._spans is None or self._clock.pace != 1.0 else (
            self._spans.stated(run, stated.offset, self._clock.now_ns())
        )  # fmt: skip
        return ClockStatement(
            post_id=stated.post_id,
            offset_ns=stated.offset.offset_ns,
            uncertainty_ns=stated.offset.uncertainty_ns,
            drift=stated.offset.drift,
            spans=spans,
        )
