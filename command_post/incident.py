"""The incident as the post sees it: bytes in, estimates out (pure).

Live, in replay and in rehearsal the same calls are made with the same arguments, and the same
bytes come out. Nothing happens between two calls.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from types import MappingProxyType

from command_post.desks.announcer import Announcer, Outgoing
from command_post.desks.command_desk import CommandDesk
from command_post.desks.orders import Orders
from command_post.fusing import Fusing
from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.interface import Afterwards
from command_post.fusion.methods import make_fusion
from command_post.fusion.time_line import Event, TimeLine
from command_post.fusion.track import Estimate
from command_post.handing_over import FUSED, is_ones_own
from command_post.incident_settings import IncidentSettings
from command_post.known_keys import KnownKeys
from command_post.nodes.dating import Dating
from command_post.nodes.lateness import Lateness
from command_post.nodes.node_clock import KnownClock
from command_post.nodes.notices import Notice, Notices, named_in
from command_post.nodes.senders import Senders
from command_post.nodes.set_aside import Attendant, SetAside, heard
from command_post.nodes.told import LastMovement, RaisedAlarm, Told, why_nowhere
from command_post.nodes.told_until import ToldUntil
from command_post.resuming import begin_anew
from command_post.resuming.last_told import LastTold
from shared.codec import Refusal, decode
from shared.messages import (
    AlarmKind,
    Alert,
    DapInstallation,
    Message,
    NodeHealth,
    Order,
    Receipt,
    SiteAdvice,
    StationTable,
    Supplies,
)
from shared.seal import Seal, read_seal
from shared.topics import Key, Role

__all__ = ["MOST_NODES", "Incident", "IncidentSettings"]

MOST_NODES = 4096
_NOT_THE_POST = "not_the_post"


class Incident:
    """Decodes what is heard, orders it, fuses it, and says what comes of it.

    ``refusals`` counts what was not taken, per (reason, node): bytes that are no message, keys
    that are not ours, another incident's keys (``foreign_incident``), what somebody else says
    under this post's keys (``not_the_post``), and nodes beyond the first 4096
    (``too_many_nodes``). A key so malformed that it names no node counts under ``?``.

    What a node with a wrong clock says is put on the post's time line (see ``Dating``).
    """

    def __init__(self, settings: IncidentSettings, *, keeps_all: bool = True) -> None:
        """Unless it ``keeps_all`` it forgets what is of no use live, and knows less afterwards."""
        self.settings = settings
        self._hold_ns = settings.hold_ns
        self._notices = Notices()
        self._keys = KnownKeys()
        self._heard_ns: dict[tuple[Role, str], int] = {}
        self._told = Told()
        self._senders = Senders(settings.hold_ns, settings.post_id)
        self._told_until = ToldUntil(self._senders)
        self._dating = Dating(self._senders)
        self._lateness = Lateness(settings.fusion, keeps_all=keeps_all)
        self._time_line = TimeLine(settings.hold_ns, settings.time_line.capacity)
        self._tracker = make_fusion(settings.fusion)
        self._set_aside = SetAside(self._notices, ("post", settings.post_id))
        self._announcer = Announcer(settings.incident, settings.post_id)
        self._desk = CommandDesk(settings, self._announcer)
        self._fusing = Fusing(
            self._tracker, settings.teams, desk=self._desk, announcer=self._announcer,
            dating=self._dating, set_aside=self._set_aside, notices=self._notices,
        )  # fmt: skip
        self._recalled: list[Event] | None = None
        """What was due of what is being recalled."""

    def attended(self, by: Attendant | None, fatal: Collection[str]) -> None:
        """Have somebody attend, and what is ``fatal`` put aside: see ``SetAside``."""
        self._set_aside.attended(by, fatal)

    @property
    def estimates(self) -> Mapping[str, Estimate]:
        """The newest estimate of every responder, by id."""
        return self._tracker.estimates

    @property
    def daps(self) -> Mapping[str, InstalledDap]:
        """The DAPs that stand, by id."""
        return self._tracker.daps

    @property
    def dap_places(self) -> Mapping[str, Outgoing]:
        """What was said last of where each DAP stands, by its id."""
        return MappingProxyType(self._fusing.dap_places)

    @property
    def origin(self) -> Outgoing | None:
        """Where on the Earth the incident is, as it was said last."""
        return self._desk.origin

    @property
    def standing(self) -> list[Outgoing]:
        """What was said last of where the incident is, and of where each DAP stands."""
        placed = [] if self.origin is None else [self.origin]
        return [*placed, *self._fusing.dap_places.values()]

    @property
    def heard_ns(self) -> Mapping[tuple[Role, str], int]:
        """When each responder and DAP was last heard, on the post's clock."""
        return MappingProxyType(self._heard_ns)

    @property
    def alarms(self) -> Mapping[str, Mapping[AlarmKind, RaisedAlarm]]:
        """The newest of each kind of alarm, by responder; ``cancelled`` ones are still there."""
        return MappingProxyType(self._told.alarms)

    @property
    def health(self) -> Mapping[str, NodeHealth]:
        """What each responder's unit last said of its sensor."""
        return MappingProxyType(self._told.health)

    @property
    def movements(self) -> Mapping[str, LastMovement]:
        """The newest movement heard of each responder."""
        return MappingProxyType(self._told.movements)

    @property
    def supplies(self) -> Mapping[tuple[Role, str], Supplies]:
        """What each node that tells has left."""
        return MappingProxyType(self._told.supplies)

    @property
    def orders(self) -> Orders:
        """What has been ordered, and who has not acknowledged it."""
        return self._desk.orders

    @property
    def alerts(self) -> Mapping[int, Alert]:
        """What the commander has been alerted to, by number; see ``AlertDesk``."""
        return self._desk.alerts

    @property
    def refusals(self) -> Counter[tuple[str, str]]:
        """How much of what was not taken, per reason and node."""
        return self._notices.refusals

    @property
    def refused(self) -> int:
        """How much was not taken in all."""
        return self._notices.refused

    @property
    def counts(self) -> Counter[str]:
        """What was dropped, late, guessed or without effect; see ``TimeLine`` and ``Tracker``.

        ``moved_in_time`` are the events of nodes with wrong clocks, ``begun_anew`` the times that
        the numbers under a key began anew, ``told_by_both`` the passes of DAPs that both ends of a
        link told of, ``too_late`` what happened too long ago to be fused.
        """
        own = Counter(
            moved_in_time=self._dating.moved_in_time,
            begun_anew=self._senders.begun_anew,
            told_by_both=self._fusing.told_by_both,
            too_late=self._lateness.count,
        )
        return self._time_line.counts + self._tracker.counts + own

    def faults(self, role: Role, node_id: str, now_ns: int) -> list[str]:
        """Return what is wrong with a node at ``now_ns``, in words.

        That is its clock or its id, what of it could not be handled, and what the fusion doubts of
        it; of a DAP also what its box said of itself, and that it stands nowhere.
        """
        node = (role, node_id)
        doubted = [
            f"{doubt.words} ({doubt.certainty:.0%})"
            for doubt in self._tracker.doubts
            if (doubt.role, doubt.node_id) == node
        ]
        late = self._lateness.faults(node, now_ns) + self._set_aside.faults(node, now_ns)
        of_box = self._faults_of_dap(node_id, now_ns) if role == "dap" else []
        return of_box + self._senders.faults(role, node_id, now_ns) + late + doubted

    def remarks(self, now_ns: int) -> list[str]:
        """Return what is wrong at ``now_ns`` that is no responder's nor DAP's matter."""
        post_id = self.settings.post_id
        doubled = self._notices.refusals[_NOT_THE_POST, post_id]
        words = f"another post goes by {post_id} too ({doubled} messages): end one"
        return [words] * bool(doubled) + self._set_aside.remarks(now_ns)

    def _faults_of_dap(self, dap_id: str, now_ns: int) -> list[str]:
        silent_ns = now_ns - self._heard_ns.get(("dap", dap_id), now_ns)
        return self._told.of_box(dap_id, silent_ns, now_ns) + self._fusing.faults(dap_id)

    def clock(self, role: Role, node_id: str) -> KnownClock | None:
        """Return how far a node's clock is known to be off; ``None`` if nothing is known of it."""
        return self._senders.clock(role, node_id)

    def take_notices(self) -> list[Notice]:
        """Return what is to be told for the first time since this was last asked."""
        return self._notices.take()

    def handle(self, key: str, payload: bytes, now_ns: int) -> list[Outgoing]:
        """Take in bytes received under ``key`` at ``now_ns``; return what is to be published.

        What was due before comes first, whether ``pass_time`` was called meanwhile or not.
        Never raises for what was received: what there is no handling is put aside, counted and
        told of (``SetAside``). Raw samples, signal strengths and truth are checked
        and counted like everything else, and not fused; so is what another post says, but for a
        commander's word of where somebody is.
        """
        made = self.pass_time(now_ns)
        parsed = self._keys.parsed(key)
        if isinstance(parsed, Refusal):
            self._notices.refuse(parsed.reason, named_in(key), parsed.detail)
        elif self._is_own(parsed):
            self._notices.refuse(_NOT_THE_POST, parsed.node_id, "somebody else uses its keys")
        elif self._set_aside.takes(parsed, what := heard(key, payload)):
            take = self._take_from_post if parsed.role == "post" else self._take
            with self._set_aside.survived(parsed, "hearing it", what):
                made += take(parsed, payload, now_ns)
        return made + self.pass_time(now_ns)

    def pass_time(self, now_ns: int) -> list[Outgoing]:
        """Fuse what is due by ``now_ns``, no earlier than of the last call; return what to publish.

        What comes of it is what the next ``handle`` would have made first.
        """
        until_ns = now_ns - self._hold_ns
        made = self._fuse(self._time_line.release(now_ns), until_ns)
        self._fusing.tell_silent(until_ns, made)
        before_ns = self._lateness.forget_ns(now_ns)
        if before_ns is not None:
            with self._set_aside.passing("forgetting"):
                self._tracker.forget(before_ns)
        desk_due_ns = self._desk.due_ns
        if desk_due_ns is not None and desk_due_ns <= now_ns:
            with self._set_aside.passing("looking who is silent"):
                made += self._desk.pass_time(now_ns)
        self._set_aside.tell(now_ns)
        return made

    @property
    def due_ns(self) -> int | None:
        """When something is due next, were nothing heard until then."""
        due_ns = self._tracker.silent_due_ns
        if due_ns is not None:
            due_ns += self._hold_ns
        for each_ns in (self._time_line.due_ns, self._desk.due_ns):
            if each_ns is not None and (due_ns is None or each_ns < due_ns):
                due_ns = each_ns
        return due_ns

    def said(self, message: Order | Receipt | StationTable | SiteAdvice) -> Outgoing:
        """Return what the post itself has to say as it is to be published."""
        return self._announcer.outgoing(message)

    def recall(self, key: str, payload: bytes, now_ns: int) -> None:
        """Take in what was handled before; none of it is fused. To be ended by ``begin_from``."""
        self._recalled = self._recalled or []
        self.handle(key, payload, now_ns)

    def begin_from(self, last: LastTold) -> list[Outgoing]:
        """Go on from what was told last; return what comes of what happened since."""
        heard, self._recalled = self._recalled or [], None
        daps = begin_anew.daps_told(last, heard)
        self._tracker.begin_from(begin_anew.ways_told(last, heard), daps)
        self.go_on(last)
        self._lateness.begin(begin_anew.begun_ns(last))
        self._fusing.dap_places = begin_anew.places_told(last, daps)
        return self._fuse(begin_anew.still_to_fuse(heard, last, daps), 0)

    def go_on(self, last: LastTold) -> None:
        """Number what is said next, and hold alerts, as they were told last."""
        self._announcer.go_on(last.next_sequences)
        self._desk.restore(last.alerts)

    def afterwards(self) -> Afterwards | None:
        """Return everybody's way with all that is known by now, if the method can say that."""
        for event in self._lateness.take_set_aside():
            with self._set_aside.survived(event.key, "fusing it"):
                self._fusing.give(event.key.node_id, event.dated)
        found = self._tracker.afterwards()
        self._set_aside.take(self._tracker.take_changes().mishaps)
        self._set_aside.tell(0)
        return found

    def finish(self, now_ns: int) -> list[Outgoing]:
        """Release everything that is held back; return what is to be published."""
        made = self.pass_time(now_ns)
        for event in self._dating.rest():
            self._put(event, now_ns)
        made += self._fuse(self._time_line.release_all(), now_ns + self._hold_ns)
        self._set_aside.tell(now_ns)
        return made

    def _is_own(self, key: Key) -> bool:
        """Whether only this post says such things: its table is handled, to be on the record."""
        if key.role != "post" or key.topic == "stations":
            return False
        return (key.incident, key.node_id) == (self.settings.incident, self.settings.post_id)

    def _take_from_post(self, key: Key, payload: bytes, now_ns: int) -> list[Outgoing]:
        message = decode(key, payload)
        if isinstance(message, Refusal):
            self._notices.refuse(message.reason, key.node_id, message.detail)
        elif key.incident == self.settings.incident:
            if key.topic in FUSED:
                with self._set_aside.survived(key, "dating it"):
                    self._put(Event(key, message, message.event_time_ns), now_ns)
            known = [node_id for role, node_id in self._heard_ns if role == "responder"]
            return self._desk.take(key.node_id, message, known, now_ns)
        return []

    def _take(self, key: Key, payload: bytes, now_ns: int) -> list[Outgoing]:
        """Take in what a node says; return what is alerted to at once."""
        message = decode(key, payload)
        if isinstance(message, Refusal):
            self._notices.refuse(message.reason, key.node_id, message.detail)
            return []
        node = (key.role, key.node_id)
        if key.incident != self.settings.incident:
            self._notices.refuse("foreign_incident", key.node_id, f"of {key.incident!r}")
        elif not is_ones_own(key, message):
            self._notices.refuse("not_ones_own", key.node_id, "tells where somebody else is")
        elif node not in self._heard_ns and len(self._heard_ns) >= MOST_NODES:
            self._notices.refuse("too_many_nodes", key.node_id, f"{MOST_NODES} are heard already")
        else:
            if key.role == "responder" and node not in self._heard_ns:
                self._desk.orders.meet(key.node_id)
            self._heard_ns[node] = now_ns
            # Whatever fails of the one, the other must not miss a mayday for it.
            with self._set_aside.survived(key, "dating it"):
                self._take_dated(key, message, now_ns, read_seal(payload))
            return self._desk.hear(node, message, now_ns)
        return []

    def _take_dated(self, key: Key, message: Message, now_ns: int, seal: Seal | None) -> None:
        """Take in what a node of this incident says, and when that was on the post's clock."""
        for found in self._senders.hear(key, message, now_ns, seal):
            self._notices.tell(found.kind, key.node_id, f"{key.role}: {found.words}")
        if isinstance(message, DapInstallation) and (why := why_nowhere(message)) is not None:
            reason = "at_rest" if message.at_rest else "taken_up"
            self._notices.tell(reason, key.node_id, f"dap: {why}")
        self._told.take(key.role, key.node_id, message, now_ns)
        if key.role == "responder":
            told = self._told_until.hear(key, message, seal)
            if told is not None:
                self._tracker.heard(key.node_id, min(told.time_ns, now_ns), told.beat_s)
        events = self._dating.date(key, message, now_ns, seal) if key.topic in FUSED else []
        for event in (*self._dating.dated_by_now(key, now_ns), *events):
            self._put(event, now_ns)

    def _put(self, event: Event, now_ns: int) -> None:
        """Have an event wait for its turn, unless it comes too late to be fused."""
        admitted = self._lateness.admitted(event, now_ns)
        if admitted is not None:
            if admitted is not event:
                self._dating.redate(admitted)
            self._time_line.put(admitted, now_ns)
        elif self._lateness.is_first(event):
            detail = f"{event.key.role}: {self._lateness.words}"
            self._notices.tell("too_late", event.key.node_id, detail)

    def _fuse(self, events: list[Event], until_ns: int) -> list[Outgoing]:
        """Fuse events in turn, up to ``until_ns``, unless they are recalled only."""
        if self._recalled is None:
            return self._fusing.fuse(events, until_ns)
        self._recalled += events
        return []
