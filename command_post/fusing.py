"""Has the fusion take events in turn, and says what comes of each (pure)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from command_post.desks.announcer import Announcer, Outgoing
from command_post.desks.command_desk import CommandDesk
from command_post.fusion.interface import Fusion
from command_post.fusion.time_line import Event
from command_post.fusion.track import Estimate
from command_post.handing_over import HandingOver
from command_post.nodes.dating import Dating
from command_post.nodes.doubt_watch import DoubtWatch
from command_post.nodes.notices import Notices
from command_post.nodes.set_aside import SetAside, fused
from command_post.nodes.teams import Teams, TeamWatch
from shared.messages import DapInstallation, Message


class Fusing:
    """Gives the tracker what is due, and says where everybody and every DAP is by then.

    What it doubts and who leaves their team goes to the commander's desk. An event that there is
    no handling is put aside, and nothing that was made before it is lost. ``dap_places`` is what
    was said last of where each DAP stands, by its id.
    """

    def __init__(
        self,
        tracker: Fusion,
        teams: Teams,
        *,
        desk: CommandDesk,
        announcer: Announcer,
        dating: Dating,
        set_aside: SetAside,
        notices: Notices,
    ) -> None:
        self._tracker = tracker
        self._handing_over = HandingOver(tracker)
        self._teams = TeamWatch(teams)
        self._doubts = DoubtWatch(notices)
        self._desk = desk
        self._announcer = announcer
        self._dating = dating
        self._set_aside = set_aside
        self.dap_places: dict[str, Outgoing] = {}

    @property
    def told_by_both(self) -> int:
        """How many passes both ends of a link told of."""
        return self._handing_over.told_by_both

    def faults(self, dap_id: str) -> list[str]:
        """Return why it is not known where a DAP stands, if that is so."""
        return self._handing_over.faults(dap_id)

    def fuse(self, events: Iterable[Event], until_ns: int) -> list[Outgoing]:
        """Fuse events in turn, telling between them of who is silent: up to ``until_ns``."""
        made: list[Outgoing] = []
        for event in events:
            self.tell_silent(min(event.dated.event_time_ns, until_ns), made)
            if self._set_aside.takes(event.key, what := fused(event)):
                with self._set_aside.survived(event.key, "fusing it", what):
                    self._fuse_one(event, made)
        return made

    def tell_silent(self, until_ns: int, made: list[Outgoing]) -> None:
        """Say in ``made`` where they may be by ``until_ns`` whose silence is due to be told."""
        due_ns = self._tracker.silent_due_ns
        if due_ns is not None and due_ns <= until_ns:
            with self._set_aside.passing("telling of who is silent"):
                self._tell(self._tracker.pass_time(until_ns), until_ns, made)

    def give(self, node_id: str, message: Message) -> None:
        """Let the tracker have what a node tells, and say nothing of it."""
        self._handing_over.give(node_id, message)
        if isinstance(message, DapInstallation) and node_id in self._handing_over.nowhere:
            self.dap_places.pop(node_id, None)

    def _fuse_one(self, event: Event, made: list[Outgoing]) -> None:
        """Let the tracker have one event, and say in ``made`` what it changed, before any fault."""
        message = event.dated
        time_ns = message.event_time_ns
        self.give(event.key.node_id, message)
        known = self._doubts.changed(self._tracker.doubts)
        if known is not None:
            made += self._desk.doubt(known, time_ns)
        changes = self._tracker.take_changes()
        self._set_aside.take(changes.mishaps)
        self._tell(changes.estimates, time_ns, made)
        for dap_id, dap in changes.daps:
            # The DAP knows its installation by the time that it gave itself.
            said_ns = self._dating.said_ns(dap_id, dap.installed_ns)
            self.dap_places[dap_id] = place = self._announcer.dap_place(dap_id, dap, said_ns)
            made.append(place)

    def _tell(
        self, estimates: Sequence[tuple[str, Estimate]], time_ns: int, made: list[Outgoing]
    ) -> None:
        """Say in ``made`` where responders are, and alert to who leaves their team."""
        for responder_id, estimate in estimates:
            made.append(self._announcer.track(responder_id, estimate))
            made += self._desk.leave(self._teams.take(responder_id, estimate), time_ns)
