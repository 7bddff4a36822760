"""What was solved of each crew, commit by commit, and what has to be solved again (pure).

A commit is a function of what had happened until its time and of the commits of the period before:
the crew's own, from which it starts, and those of crews that tell it where DAPs stand. It stays
while these stay; an event that comes late takes away its own crew's, and so what rests on them.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.mishaps import Mishaps
from command_post.fusion.team.anchors import anchored, cut
from command_post.fusion.team.crews import (
    Bonds,
    Crew,
    Crews,
    crew_log,
    crews_at,
    daps_of_earlier,
)
from command_post.fusion.team.culprits import made_without
from command_post.fusion.team.dap_places import places_of
from command_post.fusion.team.log import Installed, TeamLog
from command_post.fusion.team.making import Commit, Fresh, solved_crew
from command_post.fusion.team.period import Period
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import (
    NO_WAYS,
    Anchors,
    Solution,
    concerning,
    joined,
    overlaid,
)
from shared.units import NS_PER_S

KEPT = 90
KEPT_OF_A_CROWD = 30
KEPT_ELSEWHERE = 60
KEYFRAME_EVERY = 30
"""Older periods are kept now and then: an event as late has those between made again."""

SOUGHT_EVERY_S = 300.0
"""So seldom is it sought again what a crew's commits fail of."""


class _Made(NamedTuple):
    """A commit's solution, where the DAPs stood that its crew set down, and what is behind it."""

    solution: Solution
    places: Mapping[str, tuple[Installed, ...]]
    fresh: Fresh


class Commits:
    """The commits of all crews: each at its phase of every period that follows one with events.

    Period ``number`` begins at that many times ``commit_s``.
    """

    def __init__(self, log: TeamLog, bonds: Bonds, settings: TeamSettings) -> None:
        self._log = log
        self._bonds = bonds
        self._settings = settings
        self._period_ns = round(settings.commit_s * NS_PER_S)
        self._numbers: list[int] = []
        self._periods: dict[int, Period] = {}
        self._crews: dict[int, Crews] = {}
        self._first = 0
        self._kept_since = 0
        self._made = 0
        self._fresh: Fresh | None = None
        self._keeps_past = True
        self._sought_ns: dict[str, int] = {}
        """As of when it was sought last what a crew's commits fail of, by leader."""

        self.mishaps = Mishaps()
        self.until_ns = -1
        """Until when the commits have been made."""

    def __getstate__(self) -> dict[str, Any]:
        """Return what is to be kept elsewhere: of what is long past, keyframes."""
        made = sorted(self._periods)
        first = max(bisect_left(made, self._first) - KEPT_ELSEWHERE, 0)
        kept = {
            number
            for number, before in zip(made[:first], [-1, *made], strict=False)
            if number // KEYFRAME_EVERY != before // KEYFRAME_EVERY
        } | set(made[first:])
        state = self.__dict__.copy()
        state["_periods"] = {n: each for n, each in self._periods.items() if n in kept}
        if first:
            # The one before the first of them is not there to make that again.
            state["_kept_since"] = max(self._kept_since, made[first] + 1)
        return state

    def copied(self) -> Commits:
        """Return another line of the same commits, of the same log, that goes its own way."""
        other = Commits(self._log, self._bonds, self._settings)
        other.__dict__.update(self.__dict__)
        other._numbers = self._numbers.copy()
        other._crews = self._crews.copy()
        other._periods = {
            number: replace(period, to_do=period.to_do.copy(), commits=period.commits.copy())
            for number, period in self._periods.items()
        }
        return other

    @property
    def made_until_ns(self) -> int:
        """When the first period begins whose commits are not all made."""
        return self.begin_ns(self._first)

    def work_since(self, time_ns: int, who: frozenset[str], *, bonds: bool) -> int:
        """Return how much it would be to make anew what an event makes wrong: see ``forget``."""
        number, since = self.number_at(self.until_ns), self.number_at(time_ns)
        crews = self.crews(number)
        if bonds or crews.is_everybody:
            periods = max(number - since, 0)
            return periods * sum(crew.work for crew in crews.crews) if periods else 0
        work, wrong = 0, set[int]()
        for at in sorted(n for n in self._periods if n >= since):
            for made in self._periods[at].resting_on(time_ns, who, wrong):
                wrong.add(made.serial)
                work += made.crew.work
        return work

    @property
    def is_crowd(self) -> bool:
        """Whether there are several crews by now."""
        return not self.crews(self.number_at(self.until_ns)).is_everybody

    def number_at(self, time_ns: int) -> int:
        """Return the number of the period that ``time_ns`` is in."""
        return time_ns // self._period_ns

    def begin_ns(self, number: int) -> int:
        """Return when a period begins."""
        return number * self._period_ns

    def crews(self, number: int) -> Crews:
        """Return the crews of a period, by what had happened until it begins."""
        if number not in self._crews:
            # Before it is added: who asks may ask for one that is earlier than all.
            if len(self._crews) >= KEPT:
                del self._crews[min(self._crews)]
            until_ns = self.begin_ns(number)
            self._crews[number] = crews_at(self._bonds, self._log.daps, until_ns, self._settings)
        return self._crews[number]

    def note(self, time_ns: int) -> None:
        """Note that something happened at ``time_ns``."""
        number = self.number_at(time_ns) + 1
        at = bisect_left(self._numbers, number)
        if self._numbers[at : at + 1] != [number]:
            self._numbers.insert(at, number)

    def forget(self, time_ns: int, who: frozenset[str], *, bonds: bool) -> None:
        """Drop what an event at ``time_ns``, noted already, makes wrong by coming late.

        ``who`` are the responders whom it concerns; ``bonds`` says that it may change the crews.
        """
        if bonds:
            for number in [n for n in self._crews if self.begin_ns(n) >= time_ns]:
                del self._crews[number]
        since = self.number_at(time_ns)
        if since < self._kept_since:
            since = 1 + max((n for n in self._periods if n < since), default=-1)
            self._kept_since = since
            self._periods = {n: each for n, each in self._periods.items() if n < since}
        for number in [n for n in self._periods if n >= since]:
            self._forget_in(number, time_ns, who)
        self._first = min(self._first, since)

    def forget_before(self, time_ns: int) -> tuple[Anchors, int] | None:
        """Drop the commits that are not needed if nothing comes any more from before ``time_ns``.

        Return what later ones begin from, and since when; ``None`` if all are needed. Ways from
        before that are not kept from now on.
        """
        most = min(self.number_at(time_ns), self._first)
        first = max((number for number in self._periods if number < most), default=None)
        if first is None:
            return None
        self._periods = {n: each for n, each in self._periods.items() if n >= first}
        del self._numbers[: bisect_left(self._numbers, first)]
        self._keeps_past = False
        commits = self._periods[first].commits.values()
        return overlaid([made.solution.anchors for made in commits]), self.begin_ns(first)

    def _forget_in(self, number: int, time_ns: int, who: frozenset[str]) -> None:
        period = self._periods[number]
        period.crews = self.crews(number)
        period.to_do = self._agenda(number)
        still = {crew.leader: crew for crew in period.crews.crews}
        for leader, made in tuple(period.commits.items()):
            if still.get(leader) != made.crew or period.lacks(made, time_ns, who):
                del period.commits[leader]

    def _agenda(self, number: int) -> list[tuple[int, Crew]]:
        begin_ns = self.begin_ns(number)
        due = ((begin_ns + crew.phase_ns, crew) for crew in self.crews(number).crews)
        return sorted(due, reverse=True)

    def catch_up(self, until_ns: int, most_work: int | None = None) -> bool:
        """Make the commits that are missing until ``until_ns``; say whether all are made.

        Where there is a ``most_work``, it is left at that once as much has been done.
        """
        self.until_ns = max(self.until_ns, until_ns)
        work = 0
        for number in self._numbers[bisect_left(self._numbers, self._first) :]:
            if self.begin_ns(number) > until_ns:
                break
            if number not in self._periods:
                self._periods[number] = Period(
                    self.begin_ns(number), self.crews(number), self._agenda(number)
                )
            period = self._periods[number]
            while period.to_do and period.to_do[-1][0] <= until_ns:
                if most_work is not None and work >= most_work:
                    return False
                work += self._look_at(number, *period.to_do.pop())
            if period.to_do:
                break
            self._first = number + 1
            self._thin_out()
        return True

    def _thin_out(self) -> None:
        made = sorted(self._periods)
        is_crowd = not self._periods[made[-1]].crews.is_everybody if made else False
        first = max(len(made) - (KEPT_OF_A_CROWD if is_crowd else KEPT), 0)
        if not first:
            return
        for number, before in zip(made[:first], [-1, *made], strict=False):
            if number // KEYFRAME_EVERY == before // KEYFRAME_EVERY:
                del self._periods[number]
        self._kept_since = max(self._kept_since, made[first])

    def before(self, crew: Crew, time_ns: int) -> Solution:
        """Return what a crew's solution at ``time_ns`` starts from."""
        number = self.number_at(time_ns)
        period = self._periods.get(number)
        own = period.commits.get(crew.leader) if period is not None else None
        if own is not None and own.crew == crew:
            return own.solution
        return joined([each.solution for each in self._previous(number, crew)])

    def log_of(self, crew: Crew, time_ns: int) -> TeamLog:
        """Return what a crew is solved from at ``time_ns``."""
        number = self.number_at(time_ns)
        tellers = self._tellers(number, crew, time_ns)
        told = {dap_id: made.places[dap_id] for dap_id, made in tellers.items()}
        return self._crew_log(number, crew, time_ns, told)

    def _crew_log(
        self, number: int, crew: Crew, time_ns: int, told: Mapping[str, tuple[Installed, ...]]
    ) -> TeamLog:
        most = self._settings.crew_most
        return crew_log(self._log, self._bonds, self.crews(number), crew, time_ns, told, most)

    def published(
        self, crew: Crew, time_ns: int, daps: Mapping[str, InstalledDap]
    ) -> dict[str, InstalledDap]:
        """Return those DAPs that a crew has to tell of: its own, the first crew nobody's too."""
        if crew.is_everybody:
            return {dap_id: self._with_installer(dap_id, dap) for dap_id, dap in daps.items()}
        crews = self.crews(self.number_at(time_ns))
        first = crews.crews[0].leader
        return {
            dap_id: self._with_installer(dap_id, dap._replace(installer_id=None))
            for dap_id, dap in daps.items()
            if crews.owner.get(dap_id, first) == crew.leader
        }

    def _with_installer(self, dap_id: str, dap: InstalledDap) -> InstalledDap:
        """Return a DAP with who set it down, if that is not known of where it was anchored."""
        if dap.installer_id is not None:
            return dap
        said = (e for e in self._log.daps[dap_id] if e.time_ns == dap.installed_ns)
        return dap._replace(installer_id=next((each.installer_id for each in said), None))

    def fresh(self, crew: Crew, time_ns: int) -> Fresh | None:
        """Return what a crew's commit at ``time_ns`` was made of, if that was the last one made."""
        if self._fresh is None or self._fresh.time_ns != time_ns:
            return None
        return self._fresh if crew.members[0] in self._fresh.log.responders else None

    def _previous(self, number: int, crew: Crew) -> list[Commit]:
        period = self._last_before(number)
        return [] if period is None else period.of(crew)

    def _last_before(self, number: int) -> Period | None:
        at = bisect_left(self._numbers, number)
        while at and self._numbers[at - 1] not in self._periods:
            at -= 1
        return self._periods[self._numbers[at - 1]] if at else None

    def _tellers(self, number: int, crew: Crew, until_ns: int) -> dict[str, Commit]:
        period = self._last_before(number)
        if period is None or crew.is_everybody:
            return {}
        daps = daps_of_earlier(self._bonds, self.crews(number), crew, until_ns)
        tellers = {dap_id: period.teller(dap_id) for dap_id in daps}
        return {
            dap_id: made
            for dap_id, made in tellers.items()
            if made is not None and dap_id in made.places
        }

    def _look_at(self, number: int, time_ns: int, crew: Crew) -> int:
        """Make a crew's commit, unless it is there and was made of the same; return the work."""
        period = self._periods[number]
        previous = self._previous(number, crew)
        tellers = self._tellers(number, crew, time_ns)
        made_of = tuple(each.serial for each in (*previous, *tellers.values()))
        made = period.commits.get(crew.leader)
        if made is not None and made.made_of == made_of:
            return 0
        told = {dap_id: each.places[dap_id] for dap_id, each in tellers.items()}
        before = joined([each.solution for each in previous])
        done = self._made_of_sound(number, crew, time_ns, told, before)
        self._fresh = None if done is None else done.fresh
        if done is not None:
            solution, places = done.solution, done.places
        elif previous:
            # It could not be solved: the one before stands.
            solution = before
            places = {dap_id: stood for each in previous for dap_id, stood in each.places.items()}
        else:
            period.commits.pop(crew.leader, None)
            return crew.work
        period.commits[crew.leader] = Commit(self._made, crew, solution, places, made_of)
        self._made += 1
        return crew.work

    def _made_of_sound(
        self, number: int, crew: Crew, time_ns: int, told: Mapping[str, tuple[Installed, ...]],
        before: Solution,
    ) -> _Made | None:  # fmt: skip
        """Return a crew's commit; where it fails, without the event that it fails of."""

        def make(until_ns: int) -> _Made | None:
            return self._made_as_of(number, crew, until_ns, told, before)

        with self.mishaps.survived(f"solving {len(crew.members)} responders"):
            return make(time_ns)
        sought_ns = self._sought_ns.get(crew.leader)
        if sought_ns is not None and abs(time_ns - sought_ns) < SOUGHT_EVERY_S * NS_PER_S:
            return None
        self._sought_ns[crew.leader] = time_ns
        log = self._crew_log(number, crew, time_ns, told)
        found = made_without(make, self._log, log, before.time_ns, time_ns)
        if found is None:
            return None
        made, culprits = found
        for role, node_id, words in culprits:
            self.mishaps.put_aside(f"{words}: nobody could be solved with it", role, node_id)
        return made

    def _made_as_of(
        self, number: int, crew: Crew, time_ns: int, told: Mapping[str, tuple[Installed, ...]],
        before: Solution,
    ) -> _Made | None:  # fmt: skip
        """Return a crew as it is solved with all until ``time_ns``; ``None`` if it is not."""
        log = self._crew_log(number, crew, time_ns, told)
        begin = concerning(before, log)
        log = cut(log, begin.anchors, time_ns, self._settings)
        done = solved_crew(crew, log, time_ns, begin, self._settings)
        if done is None:
            return None
        solution, fresh = done
        solution = anchored(
            number, fresh.log, fresh.solved, fresh.heights, solution, begin, self._settings,
            of_crowd=not crew.is_everybody,
        )  # fmt: skip
        if not self._keeps_past:
            solution = solution._replace(past=NO_WAYS)
        own = {d for d in log.daps if self.crews(number).owner.get(d) == crew.leader}
        return _Made(solution, places_of(fresh.solved, fresh.heights, own), fresh)
