"""Whom to ask next for what is missing, and when (pure).

Journals are asked in turn, one request at a time, each for as much as its pace allows. A journal is
gone through from its lowest hole to its highest, and then, if some is missing still, again; when a
whole round has changed nothing the next one waits, longer every time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from shared.gate import JournalRun, Missing
from shared.pacing import Pace
from shared.received_numbers import Hole
from shared.topics import Role

GRACE_S = 0.2
"""What is missing may be on its way: a beat may overtake what it tells of."""

FIRST_WAIT_S = 0.25
LONGEST_WAIT_S = 60.0
MOST_EMPTY = 8
"""After so many replies without anything, ever more numbers are passed over at a time."""

MOST_VAIN_ROUNDS = 12
"""A journal that gave nothing so often is not asked any more, until something is new of it."""


class Ask(NamedTuple):
    """A request to make: for the first ``rows`` of what is missing."""

    missing: Missing
    rows: int

    @property
    def hole(self) -> Hole:
        """The numbers that are asked for."""
        first, last = self.missing.hole
        return Hole(first, min(last, first + self.rows - 1))


class RefillPlan:
    """Chooses requests, and learns from what comes of them. Times are seconds of any one clock."""

    def __init__(self) -> None:
        self._journals: dict[JournalRun, _Refill] = {}

    @property
    def behind(self) -> dict[JournalRun, int]:
        """Up to which number each journal has been asked for in its round."""
        return {journal: refill.behind for journal, refill in self._journals.items()}

    def next(
        self,
        missing: Sequence[Missing],
        now_s: float,
        is_seen: Callable[[JournalRun], bool] = lambda _: True,
    ) -> Ask | None:
        """Return the request to make now, of what is ``missing`` beyond ``behind``, if any is due.

        ``missing`` names every journal that has a hole; what is remembered of others is forgotten.
        Of a journal of which not all that has come ``is_seen``, no other round is begun: it would
        ask for what only waits its turn.
        """
        known = self._journals
        self._journals = {
            each.journal: known.get(each.journal) or _Refill(now_s + GRACE_S) for each in missing
        }
        known = self._journals
        asked = [m for m in missing if known[m.journal].goes_on(m) or is_seen(m.journal)]
        for each in asked:
            known[each.journal].look_at(each, now_s)
        due = [each for each in asked if known[each.journal].due_s <= now_s]
        if not due:
            return None
        chosen = min(due, key=lambda each: self._journals[each.journal].asked_s)
        refill = self._journals[chosen.journal]
        refill.asked_s = now_s
        return Ask(chosen, refill.pace.rows)

    def replied(self, ask: Ask, highest: int | None, rows: int, duration_s: float) -> float:
        """Take in a reply of ``rows`` up to number ``highest``; return how long to pause, in s.

        ``highest`` is ``None`` where the reply had nothing of what was asked for.
        """
        refill = self._journals[ask.missing.journal]
        refill.empty = refill.empty + 1 if highest is None else 0
        refill.behind = _beyond_nothing(ask, refill.empty) if highest is None else highest
        refill.unanswered = 0
        refill.pace.replied(refill.asked_s + duration_s, duration_s, rows)
        return refill.pace.pause_s

    def unanswered(self, ask: Ask) -> float:
        """Take in that no reply came in time; return how long to pause, in seconds."""
        refill = self._journals[ask.missing.journal]
        refill.pace.unanswered()
        refill.due_s = refill.asked_s + _wait_s(refill.unanswered)
        refill.unanswered += 1
        return refill.pace.pause_s

    def came_back(self, role: Role, node_id: str) -> None:
        """Note that a node is heard again after a silence: it may be asked at once."""
        for journal, refill in self._journals.items():
            if (journal.role, journal.node_id) == (role, node_id):
                refill.due_s = 0.0
                refill.unanswered = refill.vain_rounds = 0


class _Refill:
    """How the refill of one journal stands."""

    def __init__(self, due_s: float) -> None:
        self.pace = Pace()
        self.behind = 0
        self.asked_s = 0.0
        self.due_s = due_s
        self.unanswered = 0
        self.empty = 0
        """How many replies in a row had nothing."""

        self.vain_rounds = 0
        self._missing_before = 0
        """How many were missing when the round began."""

    def goes_on(self, missing: Missing) -> bool:
        """Say whether anything is missing beyond what this round has asked for."""
        return missing.hole.first > self.behind

    def look_at(self, missing: Missing, now_s: float) -> None:
        """Begin another round if nothing is missing beyond what this one has asked for."""
        is_new = missing.in_all > self._missing_before
        if is_new and self.vain_rounds:
            self.vain_rounds, self.due_s = 0, 0.0
        if self.goes_on(missing):
            self._missing_before = max(self._missing_before, missing.in_all)
            return
        in_vain = missing.in_all >= self._missing_before
        self.vain_rounds = self.vain_rounds + 1 if in_vain else 0
        self.behind, self.empty, self._missing_before = 0, 0, missing.in_all
        self.due_s = now_s + _wait_s(self.vain_rounds)
        if self.vain_rounds > MOST_VAIN_ROUNDS:
            self.due_s = float("inf")


def _beyond_nothing(ask: Ask, empty: int) -> int:
    """Return up to where a journal may be taken to have nothing, after so many empty replies.

    A node may claim any number: to go through all of them would take for ever.
    """
    first, last = ask.missing.hole
    return min(last, first - 1 + (ask.rows << max(0, empty - MOST_EMPTY)))


def _wait_s(times: int) -> float:
    return min(FIRST_WAIT_S * 2.0**times, LONGEST_WAIT_S)
