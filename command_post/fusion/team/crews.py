"""Who is solved with whom: responders who share evidence are one crew, of a bounded size (pure).

Whoever passed the same DAP, set it down, or met one another belongs together: what is learnt of one
says something of the other. A DAP whose place was told ties nobody to anybody. Crews only grow, and
no further than ``crew_most``, so that solving one takes a bounded time; what crews beyond that
share, the one that began later takes as the other told it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple, TypeVar

from command_post.fusion.team.log import Installed, TeamLog, found_by_passes
from command_post.fusion.team.settings import TeamSettings
from shared.units import NS_PER_S

EVERYBODY = ""
"""The leader's name of a team so small that it is solved as one."""

HASHES = 2**32
PHASES = 15.0 / 16.0

_Key = TypeVar("_Key")


class Crew(NamedTuple):
    """Responders who are solved together, by id, and at which point of each commit's period.

    ``leader`` is the one who began first, at ``began_ns``: what becomes of others changes neither.
    """

    leader: str
    began_ns: int
    members: tuple[str, ...]
    phase_ns: int

    @property
    def is_everybody(self) -> bool:
        """Whether these are all there are."""
        return self.leader == EVERYBODY

    @property
    def work(self) -> int:
        """How much a commit of it is, about: of a small team, everybody's headings are tried."""
        return len(self.members) ** 2 if self.is_everybody else len(self.members)

    @property
    def rank(self) -> tuple[int, str]:
        """What crews are ordered by: who began first."""
        return self.began_ns, self.leader


class Crews(NamedTuple):
    """All crews at a moment, by rank, and each responder's.

    ``owner`` names the crew whose member set a DAP down.
    """

    crews: tuple[Crew, ...]
    leader_of: Mapping[str, str]
    owner: Mapping[str, str]

    @property
    def is_everybody(self) -> bool:
        """Whether the team is so small that it is one crew."""
        return self.crews[0].is_everybody

    @property
    def responders(self) -> int:
        """How many there are in all."""
        return len(self.leader_of)


class Bonds:
    """Who was first heard when, passed which DAP first when, and met whom first when.

    Each ``note_…`` says whether that is news.
    """

    def __init__(self) -> None:
        self.began_ns: dict[str, int] = {}
        self.passed_ns: dict[str, dict[str, int]] = {}
        self.met_ns: dict[tuple[str, str], int] = {}
        self._faint: set[tuple[str, str]] = set()

    def note_began(self, responder_id: str, time_ns: int) -> bool:
        """Note that a responder started or moved."""
        return _note(self.began_ns, responder_id, time_ns)

    def note_passed(self, responder_id: str, dap_id: str, time_ns: int) -> bool:
        """Note that a responder passed a DAP."""
        return _note(self.passed_ns.setdefault(responder_id, {}), dap_id, time_ns)

    def note_faint(self, responder_id: str, dap_id: str) -> None:
        """Note that a DAP heard a responder from afar, which ties nobody to anybody."""
        self._faint.add((responder_id, dap_id))

    def note_met(self, one_id: str, other_id: str, time_ns: int) -> bool:
        """Note that two responders met."""
        one, other = sorted((one_id, other_id))
        return _note(self.met_ns, (one, other), time_ns)

    def began_until(self, until_ns: int) -> int:
        """Return how many had begun by then."""
        return sum(time_ns <= until_ns for time_ns in self.began_ns.values())

    def concerned(self, dap_id: str, installs: Iterable[Installed]) -> frozenset[str]:
        """Return whom a DAP concerns: who passed it, near or far, set it down, or began first."""
        passed = {who for who, daps in self.passed_ns.items() if dap_id in daps}
        passed |= {who for who, faint_id in self._faint if faint_id == dap_id}
        by = {each.installer_id for each in installs if each.installer_id is not None}
        first = sorted(self.began_ns, key=lambda who: (self.began_ns[who], who))[:1]
        return frozenset({*passed, *by, *first})

    def daps_passed(self, crew: Crew, until_ns: int) -> set[str]:
        """Return the DAPs that any of a crew had passed by then."""
        return {
            dap_id
            for member in crew.members
            for dap_id, time_ns in self.passed_ns.get(member, {}).items()
            if time_ns <= until_ns
        }


def _note(times_ns: dict[_Key, int], key: _Key, time_ns: int) -> bool:
    known_ns = times_ns.get(key)
    if known_ns is not None and known_ns <= time_ns:
        return False
    times_ns[key] = time_ns
    return True


def crews_at(
    bonds: Bonds, daps: Mapping[str, list[Installed]], until_ns: int, settings: TeamSettings
) -> Crews:
    """Return the crews by what had happened until ``until_ns``: everybody, where they are few."""
    began = sorted((time_ns, who) for who, time_ns in bonds.began_ns.items() if time_ns <= until_ns)
    names = [who for _, who in began]
    if len(names) <= settings.crew_most:
        whole = Crew(EVERYBODY, 0, tuple(sorted(names)), 0)
        return Crews((whole,), dict.fromkeys(names, EVERYBODY), {})
    union = _Union(names, settings.crew_most)
    shared = sorted(_shared(bonds, daps, {who: time_ns for time_ns, who in began}, until_ns))
    at_place: dict[tuple[str, ...], list[str]] = {}
    for _, place, who in shared:
        others = at_place.setdefault(place, [])
        if not any(union.unite(who, other) for other in others):
            others.append(who)
    crews = tuple(
        Crew(
            members[0],
            bonds.began_ns[members[0]],
            tuple(sorted(members)),
            _phase_ns(members[0], settings),
        )
        for members in union.groups()
    )
    leader_of = {member: crew.leader for crew in crews for member in crew.members}
    owner = {
        dap_id: leader_of[each.installer_id]
        for dap_id, installs in daps.items()
        for each in installs
        if each.time_ns <= until_ns and each.installer_id in leader_of
    }
    return Crews(crews, leader_of, owner)


def _shared(
    bonds: Bonds, daps: Mapping[str, list[Installed]], began_ns: Mapping[str, int], until_ns: int
) -> Iterator[tuple[int, tuple[str, ...], str]]:
    """Yield what may be shared: since when, what, and by whom, each as far as it had happened."""
    first = {
        dap_id: next((each for each in installs if not each.is_taken_up), None)
        for dap_id, installs in daps.items()
    }
    set_down = {
        dap_id: installed
        for dap_id, installed in first.items()
        if installed is not None and installed.position is None and installed.time_ns <= until_ns
    }
    for dap_id, installed in set_down.items():
        by = installed.installer_id or ""
        if by in began_ns:
            yield max(installed.time_ns, began_ns[by]), ("dap", dap_id), by
    for who, begin_ns in began_ns.items():
        for dap_id, passed_ns in bonds.passed_ns.get(who, {}).items():
            if dap_id in set_down and passed_ns <= until_ns:
                time_ns = max(passed_ns, begin_ns, set_down[dap_id].time_ns)
                yield time_ns, ("dap", dap_id), who
    for (one, other), met_ns in bonds.met_ns.items():
        if one in began_ns and other in began_ns and met_ns <= until_ns:
            time_ns = max(met_ns, began_ns[one], began_ns[other])
            yield time_ns, ("meeting", one, other), one
            yield time_ns, ("meeting", one, other), other


def _phase_ns(leader: str, settings: TeamSettings) -> int:
    """Return as of when a crew is solved within each period: spread by a hash of its name.

    Not in the last of it, so that those who had to wait for others are solved within it too.
    """
    digest = hashlib.blake2b(leader.encode(), digest_size=4).digest()
    return int.from_bytes(digest) * round(PHASES * settings.commit_s * NS_PER_S) // HASHES


class _Union:
    """Sets of names that grow together up to a size; each is led by its first in order."""

    def __init__(self, names: list[str], most: int) -> None:
        self._number = {name: number for number, name in enumerate(names)}
        self._members = [[name] for name in names]
        self._lead = list(range(len(names)))
        self._most = most

    def unite(self, one: str, other: str) -> bool:
        """Make the sets of two one; ``False`` if that would be too large."""
        first, second = sorted((self._lead[self._number[one]], self._lead[self._number[other]]))
        if first == second:
            return True
        if len(self._members[first]) + len(self._members[second]) > self._most:
            return False
        for name in self._members[second]:
            self._lead[self._number[name]] = first
        self._members[first] += self._members[second]
        self._members[second] = []
        return True

    def groups(self) -> Iterator[list[str]]:
        """Yield the sets, each with its leader first, in the order of their leaders."""
        return (members for members in self._members if members)


def crew_log(
    log: TeamLog, bonds: Bonds, crews: Crews, crew: Crew, until_ns: int,
    told: Mapping[str, tuple[Installed, ...]], crew_most: int,
) -> TeamLog:  # fmt: skip
    """Return what a crew is solved from: its members, and the DAPs that concern them.

    A DAP that another crew set down stands where ``told`` has it, or where their own passes put it.
    The crew that began first has all DAPs that are nobody's, too. Of a team that has just become
    too large for one crew the rest wait until the crews are made.
    """
    if crew.is_everybody and bonds.began_until(until_ns) <= crew_most:
        return log
    own = TeamLog()
    own.responders = {member: log.responders[member] for member in crew.members}
    passed = bonds.daps_passed(crew, until_ns)
    for dap_id in sorted(log.daps):
        owner = crews.owner.get(dap_id, crews.crews[0].leader)
        if owner == crew.leader:
            own.daps[dap_id] = log.daps[dap_id]
        elif dap_id in passed:
            installs = log.daps[dap_id]
            own.daps[dap_id] = _told_of(installs, told.get(dap_id, ()))
    own.dap_heights = {
        dap_id: heights for dap_id, heights in log.dap_heights.items() if dap_id in own.daps
    }
    return own


def _told_of(installs: list[Installed], told: tuple[Installed, ...]) -> list[Installed]:
    """Return another crew's DAP where it is ``told`` to have stood, or where passes put it."""
    if told:
        taken_up = [each for each in installs if each.is_taken_up]
        return sorted([*told, *taken_up], key=lambda each: each.time_ns)
    return [
        found_by_passes(each) if each.position is None and not each.is_taken_up else each
        for each in installs
    ]


def daps_of_earlier(bonds: Bonds, crews: Crews, crew: Crew, until_ns: int) -> list[str]:
    """Return the DAPs that a crew passed and one that began before it set down.

    Places are told one way only, so that nothing comes back to a crew as if others had found it.
    """
    if crew.is_everybody:
        return []
    owner = {dap_id: crews.owner.get(dap_id) for dap_id in bonds.daps_passed(crew, until_ns)}
    owners = set(owner.values())
    earlier = {
        each.leader for each in crews.crews if each.leader in owners and each.rank < crew.rank
    }
    return sorted(dap_id for dap_id, leader in owner.items() if leader in earlier)
