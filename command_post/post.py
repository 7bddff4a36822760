"""The post's shell: the bus in, the incident in the middle, the bus and the recording out.

One thread does it all in one order, so that a replay of the recording makes the same of it:
take a message from the inbox, record, handle, publish what comes of it. It is handled as of when it
came, however long it had to wait: how busy the post is leaves no trace in what it makes.
"""

from __future__ import annotations

import gc
import time
from collections import Counter
from collections.abc import Callable, Sequence
from threading import Event, Thread
from typing import NamedTuple

import structlog
from msgspec import structs

from command_post.company import Company
from command_post.desks.orders import OrderRepeats
from command_post.desks.site_desk import SiteDesk
from command_post.going_on import GoingOn, Guest, Guests
from command_post.incident import Incident
from command_post.last_messages import LastMessages
from command_post.metrics.figures import figures_of
from command_post.metrics.prometheus import Metrics
from command_post.nodes.freshness import NodeWatch
from command_post.nodes.notice_log import log_notices
from command_post.nodes.safekeeping import Safekeeping
from command_post.nodes.strangers import stranger_message, twin_remarks
from command_post.post_clock import PostClock
from command_post.reception import Reception
from command_post.recorder.recorded import Outgoing
from command_post.recorder.recording import RecordedIncident, Recorder
from command_post.resuming.checkpoint import Checkpoints, State
from command_post.resuming.taking_up import TakenUp, TakingUp
from command_post.roster import Roster, RosterSettings, make_roster
from command_post.station_notice import StationNotice
from command_post.voice import Voice
from shared.bus.fair_inbox import FairInbox
from shared.bus.interface import Bus, Received
from shared.clock import Clock
from shared.collector import Collector
from shared.gate import Gate
from shared.messages import StationTable
from shared.security.certificates import Identity
from shared.sender import Outbox, Sign
from shared.strangers import NOBODY, AtLinks, Strangers
from shared.time_service import time_answerer
from shared.topics import (
    TOPICS,
    Key,
    alive_key,
    everything_of,
    time_key,
)

INBOX_MESSAGES = 200_000
INBOX_BYTES = 64 << 20
MOST_AT_ONCE = 256
"""Messages that are handled before anybody else's are looked for."""

MOST_WAITING = 5_000
"""With so many messages in the inbox, no missing ones are asked for."""

SHOW_PERIOD_S = 0.25
LEAST_WAIT_S = 0.001

_log = structlog.stdlib.get_logger(__name__)


class _Heard(NamedTuple):
    """What was received, and when it came, by the clock that the post was given."""

    key: str
    payload: bytes
    came_ns: int


class Post:
    """Hears an incident over a bus, records it, and says what it makes of it."""

    def __init__(
        self,
        bus: Bus,
        incident: Incident,
        recorder: Recorder,
        clock: Clock,
        *,
        follows_exercise: bool,
        show: Callable[[Roster], None],
        gate: Gate | None = None,
        outbox: Outbox | None = None,
        meet: Callable[[Identity], object] = lambda _: None,
        sign: Sign | None = None,
        metrics: Metrics | None = None,
        guests: Sequence[Guest] = (),
        remarks: Sequence[str] = (),
        checkpoints: Checkpoints | None = None,
        stations: StationTable | None = None,
        at_links: AtLinks = NOBODY,
    ) -> None:
        """``follows_exercise``: take the time from the exercise's start once it is given.

        ``gate``: what lets messages in; without one, everybody is believed. ``outbox``: what seals
        what the post says. ``meet``: asks a node that comes who it is. ``sign``: signs what the
        post answers. ``metrics``: who is told of all that the post counts. ``guests``: who is
        told all that is published, and asks for what people want. ``remarks``: what the
        roster is to say of how it was begun. ``checkpoints``: keep the post's state now and then.
        ``stations``: whose radio is whose, to be told to DAPs and responders' units. ``at_links``:
        what this post's router refuses.
        """
        self._bus = bus
        self._incident = incident
        self._recorder = recorder
        self._show = show
        self._remarks = tuple(remarks)
        self._gate = gate or Gate()
        self._voice = Voice(bus, outbox, recorder.when_safe)
        self._sign = sign
        self._safekeeping = Safekeeping(self._gate, recorder)
        self._recorded = self._recorded_of(incident)
        self._inbox = FairInbox[_Heard](INBOX_MESSAGES, INBOX_BYTES)
        self._reception = Reception(self._gate, self._inbox)
        self._watch = NodeWatch()
        self._metrics = metrics
        self._going_on = GoingOn()
        self._guests = Guests(guests, self._going_on)
        self._strangers = Strangers()
        self._at_links = at_links
        name, post_id = incident.settings.incident, incident.settings.post_id
        self._company = Company(bus, name, post_id, meet, self._hear)
        own_keys = {str(Key(name, "post", post_id, topic)) for topic in TOPICS}
        self._clock = PostClock(clock, own_keys, follows_exercise=follows_exercise)
        self._to_say_again: Sequence[Outgoing] = ()
        self._checkpoints = checkpoints
        self._note_work = checkpoints.work if checkpoints is not None else lambda _: None
        self._repeats = OrderRepeats()
        self._stations = StationNotice(stations)
        self._sites = SiteDesk()

    def take_up(self, taking_up: TakingUp) -> TakenUp:
        """Go on with the incident where the recording, which is gone on with, was broken off.

        To be called before ``serve``.
        """
        taken = taking_up.take_up(self._clock.heed, self._publish)
        self._incident = taken.incident
        self._recorded = self._recorded_of(taken.incident)
        self._gate.remember(taken.remembered)
        self._clock.passed_ns = taken.last_ns
        self._remarks += (taken.words,) if taken.words is not None else ()
        self._incident.take_notices()
        self._recorder.mark_resumed(self._clock.now_ns(), taken.begun_from, taken.put_aside)
        for time_ns, key, payload in taken.made:
            self._recorder.put(key, payload, time_ns, outgoing=True)
        # Who waited for it may have missed it.
        self._to_say_again = [*self._incident.standing, *taken.made]
        return taken

    def _recorded_of(self, incident: Incident) -> RecordedIncident:
        return RecordedIncident(incident, self._recorder, self._safekeeping.lose)

    def serve(self, stop: Event) -> None:
        """Serve until ``stop`` is set, then finish the incident and say what was lost."""
        self._be_found()
        collector = self._collector()
        at_work = [
            Thread(target=self._going_on.running, args=(name, run, stop), name=name)
            for name, run in (("greeter", self._company.greet), ("collector", collector.run))
        ]
        for thread in at_work:
            thread.start()
        self._publish(self._to_say_again)
        last = LastMessages(stop)
        next_round_s = time.monotonic()
        while not stop.is_set():
            self._take_turn(last)
            if time.monotonic() >= next_round_s:
                self._go_round()
                next_round_s = time.monotonic() + SHOW_PERIOD_S
        self._bus.ask_no_more()
        self._finish(last)
        for thread in at_work:
            thread.join()
        _log.info("refill", counts=dict(collector.counts))
        self._tell_losses(last.unhandled)

    def _be_found(self) -> None:
        """Hear the incident, answer what time it is, and let everybody see that the post is there.

        Who sees it may say at once what it waited with.
        """
        incident, post_id = self._incident.settings.incident, self._incident.settings.post_id
        self._bus.subscribe(everything_of(incident), self._hear, self._inbox.wanted)
        self._company.watch()
        time_at_post = time_key(incident, post_id)
        self._bus.answer(time_at_post, time_answerer(self._clock, time_at_post, self._sign))
        self._bus.declare_alive(alive_key(incident, "post", post_id))

    def _collector(self) -> Collector:
        """Return who asks for what was missed, as long as the inbox has room for it."""
        return Collector(
            self._bus,
            self._incident.settings.incident,
            self._reception.missing,
            self._hear_again,
            has_room=lambda: len(self._inbox) < MOST_WAITING,
            is_seen=lambda run: not self._inbox.refilled_of(f"{run.role}/{run.node_id}"),
        )

    def _take_turn(self, last: LastMessages) -> None:
        """Handle what has come; if nothing has, what is due without."""
        heard = self._inbox.get_some(MOST_AT_ONCE, self._until_due_s())
        self._handle_all(heard, last)
        if not heard:
            self._pass_time()
        self._heed_guests()
        self._give_receipts()
        self._keep_state()

    def _go_round(self) -> None:
        """Do what is to be done now and then, each thing whatever becomes of the others."""
        rounds: tuple[tuple[str, Callable[[], None]], ...] = (
            ("repeating orders", self._repeat_orders),
            ("telling of the stations", self._tell_stations),
            ("advising where DAPs are wanted", self._advise_sites),
            ("showing the roster", self._tell_figures),
        )
        for what, do in rounds:
            with self._going_on.survived(what):
                do()
        # What is kept is kept for good: going through it for cycles would stall a crowd.
        gc.freeze()

    def _finish(self, last: LastMessages) -> None:
        """Handle what still waits, as long as there is time, and end the incident."""
        while len(self._inbox) and not last.is_over:
            self._handle_all(self._inbox.get_some(MOST_AT_ONCE), last)
        ended_ns = self._clock.now_ns()
        self._publish(self._recorded.finish(ended_ns))
        with self._going_on.survived("showing the roster"):
            self._show(self.roster(ended_ns))

    def roster(self, now_ns: int) -> Roster:
        """Return who is where at ``now_ns`` of the post's clock."""
        alive = self._company.alive
        nodes = self._watch.fresh(now_ns, alive, self._gate, self._reception.useless())
        roster = make_roster(
            self._incident, now_ns, RosterSettings(), alive, nodes, self._gate.turned
        )
        fault = self._recorder.status().fault
        of_recorder = () if fault is None else (fault,)
        failed = (*self._incident.remarks(now_ns), *self._going_on.remarks)
        twins = twin_remarks(self._at_links, self._incident)
        return roster._replace(remarks=(*self._remarks, *of_recorder, *twins, *failed))

    def _tell_figures(self) -> None:
        roster = self.roster(self._clock.now_ns())
        self._show(roster)
        self._guests.show(roster)
        if self._metrics is not None:
            figures = figures_of(
                roster, self._incident, self._gate, self._reception, self._inbox, self._recorder
            )
            self._metrics.show(figures)
        for stranger in self._strangers.noticed(self._at_links, self._gate.turned):
            self._take_own(*stranger_message(stranger, self._incident, roster.now_ns))

    def _give_receipts(self) -> None:
        with self._reception.at_gate:
            receipts = self._safekeeping.receipts(time.monotonic(), self._clock.now_ns())
        self._publish([self._incident.said(receipt) for receipt in receipts])

    def _keep_state(self) -> None:
        kept = self._checkpoints
        if kept is not None and kept.is_due and not self._safekeeping.has_lost:
            kept.keep(
                State(
                    self._incident,
                    self._gate.remembered(),
                    self._clock.exercise,
                    self._clock.passed_ns,
                )
            )

    def _hear(self, received: Received) -> None:
        self._inbox.put(_Heard(*received, self._clock.own.now_ns()))

    def _hear_again(self, received: Received) -> None:
        """Take in what was missed: it waits behind all that is said now."""
        self._inbox.put(_Heard(*received, self._clock.own.now_ns()), refilled=True)

    def _until_due_s(self) -> float:
        """Return for how many real seconds to wait for a message: until something is due."""
        due_ns = self._incident.due_ns
        if due_ns is None:
            return SHOW_PERIOD_S
        return min(max(self._clock.real_seconds_until(due_ns), LEAST_WAIT_S), SHOW_PERIOD_S)

    def _pass_time(self) -> None:
        now_ns = self._clock.now_ns()
        if now_ns > self._clock.passed_ns:
            self._clock.passed_ns = now_ns
            began_s = time.perf_counter()
            self._publish(self._recorded.pass_time(now_ns))
            self._note_work(time.perf_counter() - began_s)

    def _handle_all(self, messages: Sequence[_Heard], last: LastMessages) -> None:
        # They were taken of each sender in turn.
        for key, payload, came_ns in sorted(messages, key=lambda each: each.came_ns):
            received = Received(key, payload)
            last.unhandled += last.is_over
            if last.is_over or not self._lets_in(received):
                continue
            self._clock.heed(key, payload)
            refused = self._incident.refused
            now_ns = self._clock.handled_at_ns(self._clock.paced_ns(came_ns))
            self._watch.hear(key, payload, now_ns)
            began_s = time.perf_counter()
            self._publish(self._recorded.handle(key, payload, now_ns))
            took_s = time.perf_counter() - began_s
            if self._metrics is not None:
                self._metrics.handled(took_s)
            self._note_work(took_s)
            if self._incident.refused > refused:
                self._reception.blame(received)
        log_notices(self._incident.take_notices())

    def _lets_in(self, received: Received) -> bool:
        with self._going_on.survived("letting somebody in"):
            return not self._voice.is_own(received) and self._reception.lets_in(received)
        return False

    def _heed_guests(self) -> None:
        """Do what people ask for: they were let in where they did."""
        for key, payload in self._guests.take_requests():
            self._take_own(key, payload)

    def _take_own(self, key: str, payload: bytes) -> None:
        now_ns = self._clock.handled_at_ns(self._clock.now_ns())
        self._publish(self._recorded.handle(key, payload, now_ns))
        if key.endswith("/outside"):
            # What others say is not the post's word, and is shown beside it.
            self._guests.published(key, payload)

    def _publish(self, outgoing: Sequence[Outgoing]) -> None:
        for key, payload in self._voice.say(outgoing):
            if self._metrics is not None:
                self._metrics.published(key, payload, self._clock.now_ns())
            self._guests.published(key, payload)

    def _repeat_orders(self) -> None:
        """Say again what somebody who is alive has not acknowledged."""
        alive, now_ns = self._company.responders, self._clock.now_ns()
        for order in self._repeats.due(self._incident.orders, alive, now_ns):
            self._voice.say([self._incident.said(structs.replace(order, said_ns=now_ns))])

    def _advise_sites(self) -> None:
        """Say where a DAP is wanted, if that is due."""
        self._voice.say(self._sites.due(self._incident, self._clock.now_ns()))

    def _tell_stations(self) -> None:
        """Say whose radios are whose if it is due; the first time for the record as well."""
        now_ns = self._clock.now_ns()
        table = self._stations.due(time.monotonic(), now_ns, some_came=self._company.tell())
        if table is None:
            return
        (said,) = self._voice.say([self._incident.said(table)])
        if table.sequence == 0:
            self._publish(self._recorded.handle(*said, self._clock.handled_at_ns(now_ns)))

    def _tell_losses(self, unhandled: int) -> None:
        refused = Counter[tuple[str, str]](self._incident.refusals)
        refused.update(self._gate.turned)
        for (reason, node_id), count in sorted(refused.items()):
            _log.warning("refused in all", reason=reason, node_id=node_id, count=count)
        for what, count in sorted(self._incident.counts.items()):
            _log.info("fusion", what=what, count=count)
        self._reception.tell_losses(unhandled)
