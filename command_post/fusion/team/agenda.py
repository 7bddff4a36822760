"""Which crew is to be solved when (pure)."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from typing import NamedTuple

from command_post.fusion.team.crews import Crew, Crews
from command_post.fusion.team.lines import Lines
from command_post.fusion.team.settings import TeamSettings
from shared.units import NS_PER_S

BUSY_SHARE = 0.7
"""Of a period, that its ticks share among them."""


class Due(NamedTuple):
    """A crew that is to be solved at ``at_ns``, as of ``time_ns``."""

    at_ns: int
    time_ns: int
    crew: Crew


class _Plan(NamedTuple):
    """All ticks of a period's crews, by when they are to be made."""

    crews: Crews
    ticks: list[Due]


class Agenda:
    """The ticks of all crews: spread over time, and the rarer the more responders there are.

    As of when a crew is solved is its own matter, so that no late word of others moves it. Where
    many crews' times are near each other they are solved one after another with a while between, in
    which what was heard meanwhile is answered: nobody waits for more than one crew's solution.
    """

    def __init__(self, lines: Lines, settings: TeamSettings) -> None:
        self._lines = lines
        self._settings = settings
        self._tick_ns = round(settings.tick_s * NS_PER_S)
        self._period_ns = round(settings.commit_s * NS_PER_S)
        self._plans: dict[int, _Plan] = {}
        self._next_ns = 0
        self.until_ns = -1
        """Until when it has been asked."""

    def ask_again(self) -> None:
        """Look anew at who is due, for the crews may have changed."""
        self._next_ns = 0

    def due_before(self, time_ns: int) -> list[Due]:
        """Return who is due since this was last asked, each at their last tick, by time."""
        last_ns = time_ns - 1
        if last_ns < self._next_ns:
            return []
        number = self._lines.live.number_at(last_ns)
        crews = self._lines.live.crews(number)
        if crews.is_everybody:
            due_ns = last_ns // self._tick_ns * self._tick_ns
            due = [Due(due_ns, due_ns, crews.crews[0])] if due_ns > self.until_ns else []
            self._next_ns = due_ns + self._tick_ns
        else:
            due = self._due(number, last_ns)
            due = self._due_before_that(number, due) + due
            ticks = self._plan(number).ticks
            at = bisect_right(ticks, last_ns, key=_at_ns)
            self._next_ns = (
                ticks[at].at_ns if at < len(ticks) else self._lines.live.begin_ns(number + 1)
            )
        self.until_ns = max(self.until_ns, last_ns)
        return due

    def _due(self, number: int, last_ns: int) -> list[Due]:
        """Return each crew's last tick of a period until then, as far as not told before."""
        ticks = self._plan(number).ticks
        first, end = (bisect_right(ticks, each, key=_at_ns) for each in (self.until_ns, last_ns))
        return sorted({due.crew.leader: due for due in ticks[first:end]}.values())

    def _due_before_that(self, number: int, due: list[Due]) -> list[Due]:
        """Return who was still due in the period before, and is not again in this one."""
        begin_ns = self._lines.live.begin_ns(number)
        if self.until_ns >= begin_ns - 1:
            return []
        again = {member for _, _, crew in due for member in crew.members}
        before = self._due(number - 1, begin_ns - 1)
        return [each for each in before if not again.issuperset(each.crew.members)]

    def _plan(self, number: int) -> _Plan:
        crews = self._lines.live.crews(number)
        plan = self._plans.get(number)
        if plan is None or plan.crews is not crews:
            begin_ns = self._lines.live.begin_ns(number)
            ticks = sorted(
                (time_ns, crew)
                for crew in crews.crews
                for time_ns in self._ticks(crew, crews.responders, begin_ns)
            )
            plan = self._plans[number] = _Plan(crews, list(self._one_by_one(ticks, begin_ns)))
            self._plans = {n: each for n, each in self._plans.items() if n >= number - 1}
        return plan

    def _ticks(self, crew: Crew, responders: int, begin_ns: int) -> range:
        """Return the ticks of a crew in a period, one of which is its commit."""
        tick_ns = self._tick_ns
        if not crew.is_everybody:
            in_a_tick = self._settings.solved_a_second * self._settings.tick_s
            tick_ns *= max(math.ceil(responders / in_a_tick), 1)
        tick_ns = min(tick_ns, self._period_ns)
        return range(begin_ns + crew.phase_ns % tick_ns, begin_ns + self._period_ns, tick_ns)

    def _one_by_one(self, ticks: list[tuple[int, Crew]], begin_ns: int) -> Iterator[Due]:
        """Yield ticks in their order, each once the one before has had its share of the time.

        That goes by how many it solves, all ticks together having ``BUSY_SHARE`` of the period.
        """
        members = max(sum(len(crew.members) for _, crew in ticks), 1)
        free_ns, last_ns = begin_ns, begin_ns + self._period_ns - 1
        for time_ns, crew in ticks:
            at_ns = min(max(time_ns, free_ns), last_ns)
            yield Due(at_ns, time_ns, crew)
            free_ns = at_ns + round(BUSY_SHARE * self._period_ns * len(crew.members) / members)


def _at_ns(due: Due) -> int:
    return due.at_ns
