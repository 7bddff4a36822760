"""What a gate knows of what has come, as plain data that any version can read (pure)."""

from __future__ import annotations

from collections import Counter

import msgspec

from shared.gate import JournalRun, LiveRuns, Remembered
from shared.received_numbers import Hole, ReceivedNumbers
from shared.topics import Role


class JournalNotes(msgspec.Struct, array_like=True, frozen=True):
    """Of a journal's run: all up to ``highest`` have come but ``holes``; ``gone`` never will."""

    role: Role
    node_id: str
    run: bytes
    highest: int
    holes: list[Hole]
    gone: int


class LiveNotes(msgspec.Struct, array_like=True, frozen=True):
    """Of a key that is in no journal: the newest number of each run, the last heard at the end.

    That one has spoken since ``since_ns``, as it dates it.
    """

    key: str
    numbers: list[tuple[bytes, int]]
    since_ns: int = 0


class GateNotes(msgspec.Struct, array_like=True, frozen=True):
    """All that a gate remembers."""

    journals: list[JournalNotes]
    live: list[LiveNotes]


def noted(remembered: Remembered) -> GateNotes:
    """Return notes of what is ``remembered``, which may go on changing."""
    journals = [
        JournalNotes(*journal, numbers.highest, list(numbers.holes()), remembered.gone[journal])
        for journal, numbers in remembered.journals.items()
    ]
    live = [LiveNotes(key, of.numbers, of.since_ns) for key, of in remembered.live.items()]
    return GateNotes(journals, live)


def recalled(notes: GateNotes) -> Remembered:
    """Return what was noted, for a gate of its own."""
    journals = {JournalRun(each.role, each.node_id, each.run): each for each in notes.journals}
    return Remembered(
        {run: ReceivedNumbers.of_holes(of.highest, of.holes) for run, of in journals.items()},
        {of.key: LiveRuns(of.numbers, of.since_ns) for of in notes.live},
        Counter({run: of.gone for run, of in journals.items() if of.gone}),
    )
