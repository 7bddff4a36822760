"""The commits that are live, and behind them those that are made anew, a few at a time (pure).

What comes an hour late makes an hour of commits wrong. Made anew at once, with twelve responders,
all others would have to wait for minutes. So the live ones stay, and go on with what has come late;
at each tick some of a second line are made, from where it belongs in time; once that is as far, it
is the live one. From then on all is to the bit as if nothing had been late. How many are made at a
tick goes by what happened alone, so that a replay makes the same of it.
"""

from __future__ import annotations

from typing import NamedTuple

from command_post.fusion.team.commits import Commits
from command_post.fusion.team.crews import Bonds
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import Anchors

AT_ONCE_WORK = 288
"""As much is made anew at once, as ``Crew.work`` has it: two commits of twelve responders."""

TICK_WORK = 96
"""So much, or a single commit, at a tick."""

CROWD_WORK = 32
"""So much of a crowd's, two commits of a crew, at once as at a tick: they have several a second."""


class _Late(NamedTuple):
    """What came late: when it happened, whom it concerns, and whether it may change the crews."""

    time_ns: int
    who: frozenset[str]
    bonds: bool


class Lines:
    """Keeps the line of commits that is ``live``, and has another made when much is wrong with it.

    What comes late meanwhile, and would lead that other one back, waits for the next.
    """

    def __init__(self, log: TeamLog, bonds: Bonds, settings: TeamSettings) -> None:
        self.live = Commits(log, bonds, settings)
        self._anew: Commits | None = None
        self._waiting: list[_Late] = []
        self._unneeded_ns = -1
        """What happened before is needed no more, once nothing is made anew."""

    def note(self, time_ns: int) -> None:
        """Note that something happened at ``time_ns``."""
        self.live.note(time_ns)
        if self._anew is not None:
            self._anew.note(time_ns)

    def forget(self, time_ns: int, who: frozenset[str], *, bonds: bool) -> None:
        """Have made anew, now or by and by, what an event at ``time_ns`` makes wrong."""
        late = _Late(time_ns, who, bonds)
        if self.live.work_since(time_ns, who, bonds=bonds) <= self._most(AT_ONCE_WORK):
            self.live.forget(time_ns, who, bonds=bonds)
            if self._anew is not None:
                self._anew.forget(time_ns, who, bonds=bonds)
        elif self._anew is not None and time_ns < self._anew.made_until_ns:
            self._waiting.append(late)
        else:
            self._begin([late])

    def catch_up(self, until_ns: int) -> bool:
        """Make the live commits until ``until_ns``, and some of those that are made anew.

        Say whether these are the live ones from now on.
        """
        made_ns = self.live.made_until_ns
        self.live.catch_up(until_ns)
        # Both at one tick would be a long wait.
        return self.live.made_until_ns == made_ns and self._go_on(until_ns, self._most(TICK_WORK))

    def settle(self, until_ns: int) -> None:
        """Make all that is to be made anew."""
        self.live.catch_up(until_ns)
        while self._waiting or self._anew is not None:
            self._go_on(until_ns, None)

    def forget_before(self, time_ns: int) -> tuple[Anchors, int] | None:
        """Drop what is not needed, as ``Commits`` does, once nothing is being made anew."""
        self._unneeded_ns = max(self._unneeded_ns, time_ns)
        if self._anew is not None:
            return None
        needed_ns = min((late.time_ns for late in self._waiting), default=self._unneeded_ns)
        return self.live.forget_before(min(self._unneeded_ns, needed_ns))

    def _most(self, work: int) -> int:
        return min(work, CROWD_WORK) if self.live.is_crowd else work

    def _begin(self, several: list[_Late]) -> None:
        self._anew = self._anew or self.live.copied()
        for time_ns, who, bonds in several:
            self._anew.forget(time_ns, who, bonds=bonds)

    def _go_on(self, until_ns: int, most_work: int | None) -> bool:
        """Make some of what is made anew; say whether that is the live line by now."""
        if self._anew is None and self._waiting:
            waiting, self._waiting = self._waiting, []
            self._begin(waiting)
        if self._anew is None or not self._anew.catch_up(until_ns, most_work):
            return False
        self.live, self._anew = self._anew, None
        return True
