"""What of the nodes' journals is safe in the post's recording, and who is to be told so (pure)."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count
from typing import NamedTuple, Protocol

from shared.gate import Gate, JournalRun, numbering
from shared.messages import Receipt, SafeUpTo
from shared.received_numbers import Hole

NEWS_PERIOD_S = 2.0
REPEAT_PERIOD_S = 30.0
MOST_IN_A_RECEIPT = 256


class Disk(Protocol):
    """What takes messages, and has them safe some time later."""

    @property
    def taken(self) -> int:
        """How many it has taken."""

    @property
    def safe(self) -> int:
        """How many of them, the first ones, would survive a power cut."""

    @property
    def has_room(self) -> bool:
        """Whether it works, and is not behind."""

    @property
    def begun_anew(self) -> int:
        """How often all that was safe was gone."""


class _Mark(NamedTuple):
    """What of each journal had come without a gap when the disk had taken so many messages."""

    taken: int
    up_to: Mapping[JournalRun, int]


class Safekeeping:
    """Says what is safe once the disk has it, and has what the disk had to drop come again."""

    def __init__(self, gate: Gate, disk: Disk) -> None:
        self._gate = gate
        self._disk = disk
        self._mark: _Mark | None = None
        self._safe: Mapping[JournalRun, int] = {}
        self._told: Mapping[JournalRun, int] = {}
        self._told_s = self._repeated_s = -REPEAT_PERIOD_S
        self._lost: dict[JournalRun, list[Hole]] = {}
        self._begun_anew = disk.begun_anew
        self._sequence = count()

    @property
    def has_lost(self) -> bool:
        """Whether the gate holds for come what the disk does not have."""
        return bool(self._lost)

    def lose(self, key_text: str, payload: bytes) -> None:
        """Note that what the gate has let in finds no room on the disk."""
        numbered = numbering(key_text, payload)
        if numbered is not None:
            journal, number = numbered
            holes = self._lost.setdefault(journal, [])
            if holes and holes[-1].last == number - 1:
                holes[-1] = holes[-1]._replace(last=number)
            else:
                holes.append(Hole(number, number))

    def receipts(self, now_s: float, now_ns: int) -> list[Receipt]:
        """Return what is to be told at ``now_ns``, which is ``now_s`` of any steady time.

        To be called now and then, after all that the gate has let in has been given to the disk.
        """
        self._look()
        if now_s >= self._repeated_s + REPEAT_PERIOD_S:
            self._repeated_s = now_s
            return self._tell(dict(self._safe), now_s, now_ns)
        if now_s < self._told_s + NEWS_PERIOD_S:
            return []
        news = {run: number for run, number in self._safe.items() if self._told.get(run) != number}
        return self._tell(news, now_s, now_ns)

    def _look(self) -> None:
        if self._begun_anew != self._disk.begun_anew:
            self._begun_anew = self._disk.begun_anew
            self._mark = None
            for journal, numbers in self._gate.journals():
                self._lost[journal] = [Hole(1, numbers.highest)]
        if self._mark is not None and self._disk.safe >= self._mark.taken:
            self._safe, self._mark = self._mark.up_to, None
        if self._lost and self._disk.has_room:
            for journal, holes in self._lost.items():
                self._gate.forget(journal, holes)
            self._lost.clear()
        # As long as the gate holds for come what has been lost, it cannot tell what is safe.
        if self._mark is None and not self._lost:
            come = {journal: each.up_to for journal, each in self._gate.journals() if each.up_to}
            self._mark = _Mark(self._disk.taken, come)

    def _tell(self, news: dict[JournalRun, int], now_s: float, now_ns: int) -> list[Receipt]:
        if not news:
            return []
        self._told, self._told_s = self._safe, now_s
        safe = [
            SafeUpTo(role=run.role, node_id=run.node_id, run=run.run.hex(), number=number)
            for run, number in news.items()
        ]
        return [
            Receipt(
                event_time_ns=now_ns,
                sequence=next(self._sequence),
                safe=tuple(safe[first : first + MOST_IN_A_RECEIPT]),
            )
            for first in range(0, len(safe), MOST_IN_A_RECEIPT)
        ]
