"""The post's shell: the bus in, the incident in the middle, the bus and the recording out.

One thread does it all in one order, so that a replay of the recording makes the same of it:
take a message from the inbox, read the clock once, record, handle, publish what comes of it.
"""

from __future__ import annotations

import gc
import time
from collections import Counter, OrderedDict
from collections.abc import Callable, Sequence
from threading import Event, Thread

import structlog

from command_post.incident import Incident
from command_post.recording import Outgoing, RecordedIncident, Recorder
from command_post.roster import Roster, RosterSettings, make_roster
from shared.bus.inbox import Inbox
from shared.bus.interface import Bus, Received
from shared.clock import Clock, PacedClock
from shared.codec import Refusal, decode, parse_key
from shared.gate import Gate
from shared.messages import ExerciseStart
from shared.time_service import time_answerer
from shared.topics import (
    TOPICS,
    Key,
    Priority,
    Role,
    alive_key,
    all_alive_of,
    everything_of,
    time_key,
)
from shared.units import NS_PER_S

INBOX_MESSAGES = 200_000
MOST_ON_THE_WAY = 20_000
SHOW_PERIOD_S = 0.25
ASK_TIMEOUT_S = 0.5
MOST_AHEAD_NS = 60 * NS_PER_S
LONGEST_EXERCISE_NS = 24 * 3600 * NS_PER_S

_ASKED: dict[Role, str] = {"responder": "start", "dap": "installation"}
"""What is said rarely, by whom: whoever comes late asks for it."""

_log = structlog.stdlib.get_logger(__name__)


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
    ) -> None:
        """``follows_exercise``: take the time from the exercise's start once it is given.

        ``gate``: what lets messages in; without one, everybody is believed.
        """
        self._bus = bus
        self._incident = incident
        self._recorder = recorder
        self._recorded = RecordedIncident(incident, recorder)
        self._clock = PacedClock(clock)
        self._follows_exercise = follows_exercise
        self._show = show
        self._gate = gate or Gate()
        self._inbox: Inbox[Received] = Inbox(INBOX_MESSAGES)
        self._alive: set[tuple[Role, str]] = set()
        self._joined: Inbox[Key] = Inbox(1000)
        name, post_id = incident.settings.incident, incident.settings.post_id
        self._own_keys = {str(Key(name, "post", post_id, topic)) for topic in TOPICS}
        self._said: OrderedDict[Received, None] = OrderedDict()
        """What was published last: the bus hands a node's own messages back to it."""

    def serve(self, stop: Event) -> None:
        """Serve until ``stop`` is set, then finish the incident and say what was lost."""
        settings = self._incident.settings
        self._bus.subscribe(everything_of(settings.incident), self._inbox.put)
        self._bus.watch_alive(all_alive_of(settings.incident), self._note_alive)
        self._bus.answer(time_key(settings.incident, settings.post_id), time_answerer(self._clock))
        self._bus.declare_alive(alive_key(settings.incident, "post", settings.post_id))
        greeter = Thread(target=self._greet, args=(stop,), name="greeter")
        greeter.start()
        next_show_s = time.monotonic()
        while not stop.is_set():
            self._handle_all(self._inbox.get_all(SHOW_PERIOD_S))
            if time.monotonic() >= next_show_s:
                self._show(self.roster(self._clock.now_ns()))
                next_show_s = time.monotonic() + SHOW_PERIOD_S
                # What is kept is kept for good: going through it for cycles would stall a crowd.
                gc.freeze()
        ended_ns = self._clock.now_ns()
        self._handle_all(self._inbox.get_all())
        self._publish(self._recorded.finish(ended_ns))
        self._show(self.roster(ended_ns))
        greeter.join()
        self._tell_losses()

    def roster(self, now_ns: int) -> Roster:
        """Return who is where at ``now_ns`` of the post's clock."""
        return make_roster(self._incident, now_ns, RosterSettings(), tuple(self._alive))

    def _handle_all(self, messages: Sequence[Received]) -> None:
        for received in messages:
            key, payload = received
            if received in self._said or self._gate.admit(key, payload) is not None:
                continue
            if self._follows_exercise and key not in self._own_keys:
                self._follow(key, payload)
            self._publish(self._recorded.handle(key, payload, self._clock.now_ns()))
        for notice in self._incident.take_notices():
            _log.warning(notice.detail, reason=notice.reason, node_id=notice.node_id)

    def _publish(self, outgoing: Sequence[Outgoing]) -> None:
        for message in outgoing:
            self._said[Received(message.key, message.payload)] = None
            if len(self._said) > MOST_ON_THE_WAY:
                self._said.popitem(last=False)
            self._bus.publish(message.key, message.payload, _priority(message.key))

    def _follow(self, key: str, payload: bytes) -> None:
        """Set the clock by an ``ExerciseStart``."""
        parsed = parse_key(key)
        if isinstance(parsed, Refusal) or parsed.topic != "exercise":
            return
        start = decode(parsed, payload)
        if not isinstance(start, ExerciseStart):
            return
        since_ns = self._clock.now_ns() - start.event_time_ns
        if not -MOST_AHEAD_NS <= since_ns <= LONGEST_EXERCISE_NS:
            _log.warning("an exercise's start at no likely time is passed over", key=key)
            return
        # The first start counts: whoever gives another must not turn the post's clock.
        self._follows_exercise = False
        self._clock.run_from(start.event_time_ns, start.speed)
        _log.info("exercise", scenario=start.scenario, seed=start.seed, speed=start.speed)

    def _note_alive(self, key: str, is_alive: bool) -> None:
        incident, role, node_id = key.split("/")[2:5]
        for node_role, topic in _ASKED.items():
            if role != node_role:
                continue
            if is_alive:
                self._alive.add((node_role, node_id))
                self._joined.put(Key(incident, node_role, node_id, topic))
            else:
                self._alive.discard((node_role, node_id))

    def _greet(self, stop: Event) -> None:
        """Ask each node that comes for what it said before it was heard, until ``stop`` is set.

        The answers go the way of everything heard; what was heard before is dropped as repeated.
        """
        while not stop.is_set():
            key = self._joined.get(SHOW_PERIOD_S)
            for received in self._bus.query(str(key), ASK_TIMEOUT_S) if key is not None else ():
                self._inbox.put(received)

    def _tell_losses(self) -> None:
        refused = Counter[tuple[str, str]](self._incident.refusals)
        refused.update(self._gate.turned)
        for (reason, node_id), count in sorted(refused.items()):
            _log.warning("refused in all", reason=reason, node_id=node_id, count=count)
        for what, count in sorted(self._incident.counts.items()):
            _log.info("fusion", what=what, count=count)
        if self._inbox.dropped:
            _log.error("the post fell behind and lost messages", count=self._inbox.dropped)


def _priority(key: str) -> Priority:
    return TOPICS[key.rpartition("/")[2]].priority
