"""Which numbers of each run have come: what is new, what is a repeat, what is missing (pure)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

MOST_BEYOND = 100_000
"""Numbers beyond a hole that are remembered one by one; further ones wait until it is filled."""


class Hole(NamedTuple):
    """Numbers of a run that have not come, from ``first`` to ``last``."""

    first: int
    last: int


class ReceivedNumbers:
    """The numbers of one run that have come, in any order and any number of times each.

    All up to ``up_to`` have come, or are known to be gone for good (``give_up``); so many beyond it
    stand alone. ``highest`` is the highest that is known to exist.
    """

    def __init__(self, up_to: int = 0) -> None:
        self.up_to = up_to
        self.highest = up_to
        self._beyond: set[int] = set()

    @classmethod
    def of_holes(cls, highest: int, holes: Sequence[Hole]) -> ReceivedNumbers:
        """Return that all up to ``highest`` have come but ``holes``, which are in their order."""
        numbers = cls(holes[0].first - 1 if holes else highest)
        numbers.highest = highest
        for hole, following in pairwise([*holes, Hole(highest + 1, highest)]):
            numbers._beyond.update(range(hole.last + 1, following.first))
        return numbers

    def is_new(self, number: int) -> bool:
        """Say whether ``number`` has not come yet, and could be taken."""
        known = number <= self.up_to or number in self._beyond
        return not known and (number == self.up_to + 1 or len(self._beyond) < MOST_BEYOND)

    def take(self, number: int) -> bool:
        """Take ``number`` in; say whether it is new."""
        if not self.is_new(number):
            return False
        self._beyond.add(number)
        self.highest = max(self.highest, number)
        self._close_up()
        return True

    def exist(self, number: int) -> None:
        """Note that the run goes on up to ``number`` at least."""
        self.highest = max(self.highest, number)

    def give_up(self, before: int) -> int:
        """Wait no longer for numbers below ``before``; return how many are missing for good."""
        if before <= self.up_to + 1:
            return 0
        had = sum(number < before for number in self._beyond)
        missing = before - 1 - self.up_to - had
        self._beyond = {number for number in self._beyond if number >= before}
        self.up_to = before - 1
        self.highest = max(self.highest, self.up_to)
        self._close_up()
        return missing

    def heed(self, kept_from: int, last_number: int, lost: Sequence[int]) -> int:
        """Take in what a journal holds, as a beat has it; return how many are gone for good.

        It goes up to ``last_number``, keeps none before ``kept_from``, and has ``lost`` some.
        """
        gone = self.give_up(min(kept_from, last_number + 1))
        self.exist(last_number)
        return gone + sum(number <= last_number and self.take(number) for number in lost)

    def forget(self, hole: Hole) -> None:
        """Hold ``hole``, of which all had come, for missing."""
        self._beyond.update(range(hole.last + 1, self.up_to + 1))
        self._beyond.difference_update(range(hole.first, hole.last + 1))
        self.up_to = min(self.up_to, hole.first - 1)

    def holes(self) -> Iterator[Hole]:
        """Yield what is missing up to ``highest``, lowest first."""
        first = self.up_to + 1
        for number in sorted(self._beyond):
            if number > first:
                yield Hole(first, number - 1)
            first = number + 1
        if first <= self.highest:
            yield Hole(first, self.highest)

    def hole_behind(self, number: int) -> Hole | None:
        """Return the lowest hole above ``number``, cut there; ``None`` if there is none."""
        first = max(self.up_to, number) + 1
        while first in self._beyond:
            first += 1
        if first > self.highest:
            return None
        return Hole(
            first, min((n for n in self._beyond if n > first), default=self.highest + 1) - 1
        )

    @property
    def missing(self) -> int:
        """How many are missing up to ``highest``."""
        return self.highest - self.up_to - len(self._beyond)

    def _close_up(self) -> None:
        while self.up_to + 1 in self._beyond:
            self.up_to += 1
            self._beyond.discard(self.up_to)
