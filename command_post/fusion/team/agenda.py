"""Which crew is to be solved when (pure)."""

from __future__ import annotations

import math
from bisect import bisect_right

from command_post.fusion.team.commits import Commits
from command_post.fusion.team.crews import Crew, Crews
from command_post.fusion.team.settings import TeamSettings
from shared.units import NS_PER_S


class Agenda:
    """The ticks of all crews: spread over time, and the rarer the more responders there are."""

    def __init__(self, commits: Commits, settings: TeamSettings) -> None:
        self._commits = commits
        self._settings = settings
        self._tick_ns = round(settings.tick_s * NS_PER_S)
        self._period_ns = round(settings.commit_s * NS_PER_S)
        self._until_ns = -1
        self._next_ns = 0

    def ask_again(self) -> None:
        """Look anew at who is due, for the crews may have changed."""
        self._next_ns = 0

    def due_before(self, time_ns: int) -> list[tuple[int, Crew]]:
        """Return who is due since this was last asked, each at their last tick, by time."""
        last_ns = time_ns - 1
        if last_ns < self._next_ns:
            return []
        number = self._commits.number_at(last_ns)
        crews = self._commits.crews(number)
        if crews.is_everybody:
            due_ns = last_ns // self._tick_ns * self._tick_ns
            due = [(due_ns, crews.crews[0])] if due_ns > self._until_ns else []
            self._next_ns = due_ns + self._tick_ns
        else:
            begin_ns = self._commits.begin_ns(number)
            due = self._due(crews, begin_ns, last_ns)
            due = self._due_before_that(number, due) + due
            ticks = (each for crew in crews.crews for each in self._ticks(crew, crews, begin_ns))
            later = (each for each in ticks if each > last_ns)
            self._next_ns = min(later, default=begin_ns + self._period_ns)
        self._until_ns = max(self._until_ns, last_ns)
        return due

    def _due(self, crews: Crews, begin_ns: int, last_ns: int) -> list[tuple[int, Crew]]:
        """Return each crew's last tick of a period until then, as far as not told before."""
        found = []
        for crew in crews.crews:
            ticks = self._ticks(crew, crews, begin_ns)
            at = bisect_right(ticks, last_ns)
            if at and ticks[at - 1] > self._until_ns:
                found.append((ticks[at - 1], crew))
        return sorted(found)

    def _due_before_that(self, number: int, due: list[tuple[int, Crew]]) -> list[tuple[int, Crew]]:
        """Return who was still due in the period before, and is not again in this one."""
        begin_ns = self._commits.begin_ns(number)
        if self._until_ns >= begin_ns - 1:
            return []
        again = {member for _, crew in due for member in crew.members}
        before = self._due(
            self._commits.crews(number - 1), begin_ns - self._period_ns, begin_ns - 1
        )
        return [(due_ns, crew) for due_ns, crew in before if not again.issuperset(crew.members)]

    def _ticks(self, crew: Crew, crews: Crews, begin_ns: int) -> range:
        """Return the ticks of a crew in a period, one of which is its commit."""
        a_tick = self._settings.solved_a_second * self._settings.tick_s
        tick_ns = self._tick_ns
        if not crew.is_everybody:
            tick_ns *= max(math.ceil(crews.responders / a_tick), 1)
        tick_ns = min(tick_ns, self._period_ns)
        return range(begin_ns + crew.phase_ns % tick_ns, begin_ns + self._period_ns, tick_ns)
