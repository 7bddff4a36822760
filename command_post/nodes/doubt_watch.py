"""What the fusion doubts of nodes, as it changes (pure)."""

from __future__ import annotations

from command_post.desks.alert_desk import Known
from command_post.fusion.interface import Doubt
from command_post.nodes.notices import DOUBT, Notices
from shared.topics import Role


class DoubtWatch:
    """Tells of each doubt once, and of all that stand whenever these change."""

    def __init__(self, notices: Notices) -> None:
        self._notices = notices
        self._told: set[tuple[str, Role, str]] = set()
        self._doubts: tuple[Doubt, ...] = ()

    def changed(self, doubts: tuple[Doubt, ...]) -> list[Known] | None:
        """Return all that is doubted by now, unless it was the same before."""
        if self._doubts is doubts:
            return None
        self._doubts = doubts
        for doubt in doubts:
            kind = (doubt.kind, doubt.role, doubt.node_id)
            if kind not in self._told:
                self._told.add(kind)
                detail = f"{doubt.role}: {doubt.words} ({doubt.certainty:.0%} certain)"
                self._notices.tell(f"{DOUBT}{doubt.kind}", doubt.node_id, detail)
        return [Known(one.kind, one.role, one.node_id, one.words) for one in doubts]
