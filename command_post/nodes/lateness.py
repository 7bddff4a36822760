"""What comes too late to be fused, and how far back nothing is needed any more (pure).

A late event is put where it belongs in time, and all since is fused again. That cannot go on for
ever: what has to be kept for it would grow without end. What comes later than the settings allow is
recorded, counted and told of; afterwards, from the recording, it is fused with all the rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from msgspec import structs

from command_post.fusion.settings import FusionSettings
from command_post.fusion.time_line import Event
from command_post.nodes.senders import Node
from shared.messages import DapInstallation
from shared.units import NS_PER_S

FORGOTTEN_EVERY_NS = 60 * NS_PER_S
TOLD_NS = 60 * NS_PER_S
"""So long is it said of a node that something of it came too late."""


class _Late(NamedTuple):
    messages: int
    last_ns: int


class Lateness:
    """Holds back what happened longer ago than the fusion goes back, if it has such a limit.

    With ``keeps_all`` nothing is ever forgotten, and what came too late is set aside for
    afterwards. ``count`` is how much came too late in all.
    """

    def __init__(self, settings: FusionSettings, *, keeps_all: bool) -> None:
        is_limited = settings.method == "team"
        self._most_ns = round(settings.team.lateness_s * NS_PER_S) if is_limited else None
        self._keeps_all = keeps_all
        self._late: dict[Node, _Late] = {}
        self._installed_ns: dict[str, int] = {}
        """When each DAP was set down or taken up last."""

        self._begun_ns: dict[Node, int] = {}
        """What happened until then counts already, by whom it is of: what was told last is kept."""

        self._forgot_ns = 0
        self._set_aside: list[Event] = []
        self.count = 0

    @property
    def words(self) -> str:
        """What is to be said of a node of whom something comes too late."""
        minutes = (self._most_ns or 0) / (60 * NS_PER_S)
        return f"it tells of more than {minutes:.0f} min ago: recorded, and not on the map"

    def begin(self, begun_ns: Mapping[Node, int]) -> None:
        """Hold all to be known that happened until then, by the node that tells it."""
        self._begun_ns = dict(begun_ns)

    def admitted(self, event: Event, now_ns: int) -> Event | None:
        """Return the event as it is to be fused; ``None`` if it comes too late.

        That a DAP stands is no less true for having been so for long: if it is news, it stands from
        now on, where it was told to or is passed.
        """
        begun_ns = self._begun_ns.get((event.key.role, event.key.node_id), -1)
        is_late = event.time_ns <= begun_ns or (
            self._most_ns is not None and event.time_ns < now_ns - self._most_ns
        )
        if isinstance(event.message, DapInstallation):
            known_ns = self._installed_ns.get(event.key.node_id, -1)
            if is_late and event.time_ns > known_ns:
                event, is_late = _standing(event, event.message, now_ns), False
            elif event.time_ns == known_ns:
                is_late = False
            self._installed_ns[event.key.node_id] = max(event.time_ns, known_ns)
        if not is_late:
            return event
        self.count += 1
        node = (event.key.role, event.key.node_id)
        before = self._late[node].messages if node in self._late else 0
        self._late[node] = _Late(before + 1, now_ns)
        if self._keeps_all:
            self._set_aside.append(event)
        return None

    def take_set_aside(self) -> list[Event]:
        """Return what came too late and was set aside since this was last asked."""
        taken, self._set_aside = self._set_aside, []
        return taken

    def is_first(self, event: Event) -> bool:
        """Say whether nothing else of the node of ``event`` came too late."""
        return self._late[(event.key.role, event.key.node_id)].messages == 1

    def faults(self, node: Node, now_ns: int) -> list[str]:
        """Return in words what of a node came too late of late."""
        late = self._late.get(node)
        if late is None or now_ns - late.last_ns > TOLD_NS:
            return []
        return [f"{late.messages} messages too late: {self.words}"]

    def forget_ns(self, now_ns: int) -> int | None:
        """Return, now and then, until when nothing is needed any more that happened."""
        if self._most_ns is None or self._keeps_all:
            return None
        if now_ns < self._forgot_ns + FORGOTTEN_EVERY_NS:
            return None
        self._forgot_ns = now_ns
        return now_ns - self._most_ns - FORGOTTEN_EVERY_NS


def _standing(event: Event, said: DapInstallation, now_ns: int) -> Event:
    """Return that a DAP stands, from now on: who set it down is where it was no more."""
    if said.installer_id is not None:
        said = structs.replace(said, installer_id=None, at_rest=said.position is None)
    return Event(event.key, said, now_ns)
