"""What all crews together hold to be wrong with nodes (pure)."""

from __future__ import annotations

from command_post.fusion.interface import Doubt
from command_post.fusion.team.crews import EVERYBODY, Crew
from shared.topics import Role


class StandingDoubts:
    """The doubts of each crew, by who leads it, and of all."""

    def __init__(self) -> None:
        self._by_leader: dict[str, tuple[Doubt, ...]] = {}
        self.told: tuple[Doubt, ...] = ()
        """All that stand: the same object as long as none comes or goes."""

    def keep(self, crew: Crew, doubts: tuple[Doubt, ...]) -> None:
        """Keep what is doubted by a crew, instead of what it or those it is made of doubted."""
        gone = {EVERYBODY, crew.leader, *crew.members}
        rest = {leader: each for leader, each in self._by_leader.items() if leader not in gone}
        self._by_leader = {**rest, crew.leader: doubts} if doubts else rest
        told = tuple(doubt for _, each in sorted(self._by_leader.items()) for doubt in each)
        if told != self.told:
            self.told = told

    def words_of(self, role: Role, node_id: str) -> list[str]:
        """Return what is held to be wrong with a node, in words."""
        node = (role, node_id)
        return [each.words for each in self.told if (each.role, each.node_id) == node]
