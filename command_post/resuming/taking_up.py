"""Taking an incident up again after a kill, by the best way there is; if that fails, by the next.

From the state kept and what was recorded since, or from the state kept before that; from what was
told last, if it would take too long to handle all again; from all; from what is rare alone, with
nobody anywhere; from nothing. A post that does not begin is worth less than any of these.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import UTC, datetime
from functools import partial
from typing import NamedTuple, TypeAlias

import structlog

from command_post.incident import Incident
from command_post.resuming.checkpoint import Kept
from command_post.resuming.gist import RARE, Gist
from command_post.resuming.handling import Ends
from command_post.resuming.meanwhile import telling
from command_post.resuming.resume import Made, resume
from shared.codec import parse_key
from shared.gate import Gate, Remembered
from shared.mcap_reader import BegunFrom, RecordedMessage, Recording
from shared.topics import Key
from shared.units import NS_PER_S

SOON_HANDLED = 1500
"""So many moves are handled again as soon as anything: two minutes of twelve responders."""

NO_STATE_ENDS, RARE_ENDS, NOTHING_ENDS = 3, 4, 5
"""After so many starts in a row that ended amid handling, a state is not gone on from any more; nor
what was told last, or all; nor even what is rare. At two the message is put aside (``Handling``).
"""

Heed: TypeAlias = Callable[[str, bytes], object]
Say: TypeAlias = Callable[[Sequence[Made]], object]

_log = structlog.stdlib.get_logger(__name__)


class TakenUp(NamedTuple):
    """An incident that was taken up, and what a gate has to remember.

    ``last_ns`` is as of when anything was handled last. ``made`` is not in the recording. ``words``
    say what is lost, if anything is. ``put_aside`` names what is not handled.
    """

    incident: Incident
    remembered: Remembered
    last_ns: int
    made: list[Made]
    begun_from: BegunFrom
    words: str | None = None
    put_aside: Sequence[str] = ()


class TakingUp:
    """What there is to go on from: a ``recording``, its ``gist``, and ``states`` kept."""

    def __init__(
        self,
        recording: Recording,
        gist: Gist,
        states: Iterable[Kept],
        begin: Callable[[], Incident],
        attended: Callable[[Incident], Incident] = lambda incident: incident,
        ends: Ends | None = None,
    ) -> None:
        """``begin`` gives an incident that has heard nothing yet.

        A state's is used as ``attended`` makes it. ``ends`` says how earlier starts ended.
        """
        self._recording = recording
        self._gist = gist
        self._states = states
        self._begin = begin
        self._attended = attended
        self._ends = ends or Ends()

    def take_up(self, heed: Heed, say: Say) -> TakenUp:
        """Return the incident. ``heed`` is told what was received; ``say`` says what it is told."""
        for what, go in self._ways(heed, say):
            try:
                return go()._replace(put_aside=self._ends.put_aside)
            except Exception:
                # A fault of our own, or memory that does not suffice: the next takes less.
                _log.exception("the incident cannot be taken up so: it is tried otherwise", by=what)
        _log.error("the incident is begun from nothing: nothing else came to an end")
        words = "the post was killed, and begins from nothing: all comes again that is kept"
        return TakenUp(self._begin(), Gate().remembered(), 0, [], "nothing", words)

    def _ways(self, heed: Heed, say: Say) -> Iterator[tuple[str, Callable[[], TakenUp]]]:
        in_row = self._ends.in_row
        if in_row < NO_STATE_ENDS:
            for kept in self._states:
                yield "the state kept", partial(self._from_state, kept, heed)
        begun = self._begin()
        is_long = self._gist.moves >= SOON_HANDLED or in_row >= NO_STATE_ENDS
        if in_row < RARE_ENDS:
            if is_long and begun.settings.fusion.method == "team":
                yield "what was told last", partial(self._from_last_told, begun, heed)
            yield "all that is recorded", partial(self._from_all, heed, say)
        if in_row < NOTHING_ENDS:
            yield "what is rare", partial(self._from_rare, heed)

    def _from_state(self, kept: Kept, heed: Heed) -> TakenUp:
        state, gate = kept.state, Gate()
        incident = self._attended(state.incident)
        gate.remember(state.remembered)
        if state.exercise is not None:
            heed(*state.exercise)
        since = self._recording.since(*kept.place)
        taken = self._handled(incident, gate, heed, since)
        return taken._replace(last_ns=taken.last_ns or state.last_ns)

    def _from_all(self, heed: Heed, say: Say) -> TakenUp:
        told = [Made(each.log_time_ns, each.key, each.payload) for each in self._gist.told]
        return self._handled(self._begin(), Gate(), heed, telling(self._recording, told, say))

    def _handled(
        self, incident: Incident, gate: Gate, heed: Heed, recorded: Iterable[RecordedMessage]
    ) -> TakenUp:
        """Have ``incident`` handle again what is ``recorded``."""
        began_s = time.monotonic()

        def recall(key: str, payload: bytes) -> None:
            gate.recall(key, payload)
            heed(key, payload)

        resumed = resume(recorded, incident, recall)
        took_s = round(time.monotonic() - began_s, 1)
        _log.warning("taken up again", handled=resumed.handled, took_s=took_s)
        for damage in self._recording.report.damages:
            _log.warning("of the recording is lost", what=str(damage))
        if resumed.differing:
            _log.warning("made otherwise than it was recorded", count=resumed.differing)
        return TakenUp(incident, gate.remembered(), resumed.last_ns, resumed.unrecorded, "all")

    def _from_last_told(self, incident: Incident, heed: Heed) -> TakenUp:
        """Go on from what was told last; a replay of the whole does not make the same of it."""
        began_s = time.monotonic()
        last = self._gist.last_told()
        for each in last.to_handle:
            heed(each.key, each.payload)
            incident.recall(each.key, each.payload, each.log_time_ns)
        made = [Made(last.last_ns, *each) for each in incident.begin_from(last)]
        told_at = datetime.fromtimestamp(last.last_ns / NS_PER_S, UTC).astimezone()
        words = (
            f"the post was killed, and goes on from what it had told of everybody until "
            f"{told_at:%H:%M:%S}"
        )
        took_s = round(time.monotonic() - began_s, 1)
        _log.warning("taken up from what was told last", moves=last.moves, took_s=took_s)
        remembered = self._gist.remembered()
        return TakenUp(incident, remembered, last.last_ns, made, "last_told", words)

    def _from_rare(self, heed: Heed) -> TakenUp:
        """Begin anew with who is there, what was ordered and what is alerted to."""
        incident, last = self._begin(), self._gist.last_told()
        for each in last.to_handle:
            key = parse_key(each.key)
            if isinstance(key, Key) and key.topic in RARE:
                heed(each.key, each.payload)
                incident.handle(each.key, each.payload, each.log_time_ns)
        incident.go_on(last)
        words = "the post was killed, and could not go on: where everybody is begins anew"
        return TakenUp(incident, self._gist.remembered(), last.last_ns, [], "nothing", words)
