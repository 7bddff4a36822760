"""The commits of one period, by crew (pure)."""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field

from command_post.fusion.team.crews import Crew, Crews
from command_post.fusion.team.making import Commit


@dataclass
class Period:
    """A period's crews, their commits by leader, and who is to be looked at when, last first."""

    begin_ns: int
    crews: Crews
    to_do: list[tuple[int, Crew]]
    commits: dict[str, Commit] = field(default_factory=dict)

    def of(self, crew: Crew) -> list[Commit]:
        """Return the commits that have any of a crew's members, by rank."""
        if self.crews.is_everybody:
            return list(self.commits.values())
        leaders = {self.crews.leader_of.get(member) for member in crew.members}
        found = [made for leader, made in self.commits.items() if leader in leaders]
        return sorted(found, key=lambda made: made.crew.rank)

    def teller(self, dap_id: str) -> Commit | None:
        """Return the commit of the crew that had set down a DAP."""
        return self.commits.get(self.crews.owner.get(dap_id, ""))

    def lacks(self, made: Commit, time_ns: int, who: frozenset[str]) -> bool:
        """Whether a commit was made without what happened to ``who`` at ``time_ns``, and counts."""
        concerned = made.crew.is_everybody or not who.isdisjoint(made.crew.members)
        return concerned and self.begin_ns + made.crew.phase_ns >= time_ns

    def resting_on(
        self, time_ns: int, who: frozenset[str], wrong: AbstractSet[int]
    ) -> list[Commit]:
        """Return the commits that lack that, or were made of ``wrong`` ones, by serial number."""
        return [
            made
            for made in self.commits.values()
            if self.lacks(made, time_ns, who) or not wrong.isdisjoint(made.made_of)
        ]
