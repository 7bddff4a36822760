"""What time it is at the post: who answers that, and who asks, over and over, on a thread.

An answer says at what pace the post's clock runs, so that nobody who has not yet heard of an
exercise, or takes no part in it, measures one against the other. Where there are keys the post
signs it: whoever relays it could turn a clock otherwise. It repeats the question's time, so that
an older one is of no use.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Collection, Mapping
from typing import NamedTuple

import msgspec

from shared.bus.interface import Answerer, Bus
from shared.clock import PacedClock
from shared.clock_sync import ClockOffset, Exchange, OffsetEstimator
from shared.gate import Verifier
from shared.messages import NodeId, TimeNs
from shared.own_thread import OwnThread
from shared.seal import Seal, to_be_signed
from shared.sender import Sign
from shared.topics import Key, time_key

QUICK_PERIOD_S = 0.3
QUICK_EXCHANGES = 6
"""So many at first are quick: one of them has a short round trip."""

PERIOD_S = 4.0
ASK_TIMEOUT_S = 1.0
MOST_POSTS = 64
PATIENCE = 5
"""A post that leaves so many questions unanswered is no longer kept to if another answers."""


class TimeQuestion(msgspec.Struct, frozen=True, array_like=True, gc=False):
    """When a node asked, by its own clock."""

    asked_ns: TimeNs


class TimeAnswer(msgspec.Struct, frozen=True, array_like=True, gc=False):
    """The question's time again, and the post's when it heard and answered it, at its ``pace``.

    ``signature`` is over the key and the answer without it.
    """

    asked_ns: TimeNs
    heard_ns: TimeNs
    answered_ns: TimeNs
    pace: float
    signature: bytes = b""


class StatedOffset(NamedTuple):
    """How far the clock of ``post_id`` is ahead of a node's, as far as the node knows."""

    post_id: NodeId
    offset: ClockOffset


_encode = msgspec.msgpack.Encoder().encode
_questions = msgspec.msgpack.Decoder(TimeQuestion)
_answers = msgspec.msgpack.Decoder(TimeAnswer)


def time_answerer(clock: PacedClock, key: str = "", sign: Sign | None = None) -> Answerer:
    """Return what answers with the time of ``clock``; what is no question has no answer.

    With ``sign`` it signs what it answers under ``key``.
    """

    def answer(request: bytes) -> bytes | None:
        """Say when the question was heard and when it is answered."""
        heard_ns = clock.now_ns()
        try:
            asked_ns = _questions.decode(request).asked_ns
        except (msgspec.MsgspecError, UnicodeDecodeError):
            return None
        answer = TimeAnswer(asked_ns, heard_ns, clock.now_ns(), clock.pace)
        if sign is not None:
            signature = sign(to_be_signed(key, _encode(answer)))
            answer = msgspec.structs.replace(answer, signature=signature)
        return _encode(answer)

    return answer


class TimeAsker(OwnThread):
    """Asks the incident's posts for the time, and keeps to one: a node has one offset.

    ``clock`` is what the node dates by. In a ``with`` block it asks on a thread of its own, a few
    times quickly and then every few real seconds, whatever the clock's pace.
    """

    def __init__(
        self,
        bus: Bus,
        incident: NodeId,
        clock: PacedClock,
        verifier: Verifier | None = None,
    ) -> None:
        """``verifier``: knows the posts' keys; without one, any answer is believed."""
        super().__init__("time")
        self._bus = bus
        self._keys = time_key(incident, "*")
        self._clock = clock
        self._verifier = verifier
        self._lock = threading.Lock()
        self._post = _Asked("", clock.pace)
        self._told: dict[NodeId, _Told] = {}

    def stated(self) -> StatedOffset | None:
        """Return what is known now; ``None`` while nothing is."""
        with self._lock:
            post, offset = self._post, self._post.estimator.at(self._clock.now_ns())
        if offset is None or post.pace != self._clock.pace:
            return None
        return StatedOffset(post.post_id, offset)

    def post_time_ns(self, post_id: NodeId) -> TimeNs | None:
        """Return what time it is at a post by its last answer; ``None`` before it has answered.

        It may be behind by as long as an answer is under way, and is at whatever pace that post's
        clock runs.
        """
        with self._lock:
            told = self._told.get(post_id)
        if told is None:
            return None
        return told.answered_ns + round((time.monotonic_ns() - told.at_ns) * told.pace)

    def ask(self) -> bool:
        """Ask once; say whether there was an answer that could be used."""
        pace, asked_ns = self._clock.pace, self._clock.now_ns()
        replies = self._bus.query(self._keys, ASK_TIMEOUT_S, _encode(TimeQuestion(asked_ns)))
        back_ns, at_ns = self._clock.now_ns(), time.monotonic_ns()
        answers = {
            reply.key.split("/")[-2]: answer
            for reply in replies
            if (answer := _read(reply.payload)) is not None
            and self._is_signed(reply.key, answer)
            and answer.asked_ns == asked_ns
        }
        told = {
            post_id: _Told(answer.answered_ns, answer.pace, at_ns)
            for post_id, answer in answers.items()
        }
        with self._lock:
            self._told = told if len(self._told) >= MOST_POSTS else {**self._told, **told}
        if pace != self._clock.pace:
            return False
        exchanges = {
            post_id: Exchange(asked_ns, answer.heard_ns, answer.answered_ns, back_ns)
            for post_id, answer in answers.items()
            if answer.pace == pace
        }
        with self._lock:
            return self._choose(exchanges, pace).take(exchanges)

    def _is_signed(self, key: str, answer: TimeAnswer) -> bool:
        """Say whether the post of ``key`` has signed ``answer``, where that is to be so."""
        if self._verifier is None:
            return True
        incident, _, post_id, topic = key.split("/")[2:]
        asked = Key(incident, "post", post_id, topic)
        said = _encode(msgspec.structs.replace(answer, signature=b""))
        return self._verifier.verdict(asked, key, Seal(b"", 0, answer.signature, said)) is None

    def _choose(self, answered: Collection[NodeId], pace: float) -> _Asked:
        """Return the post to keep to: another only once the last one is silent for long."""
        post = self._post
        given_up = post.unanswered >= PATIENCE and post.post_id not in answered
        if answered and (given_up or not post.post_id or post.pace != pace):
            self._post = _Asked(min(answered), pace)
        return self._post

    def _run(self) -> None:
        asked = 0
        while not self._stop.is_set():
            asked += self.ask()
            self._stop.wait(QUICK_PERIOD_S if asked < QUICK_EXCHANGES else PERIOD_S)


class _Told(NamedTuple):
    """What a post's clock read, and its pace, when the steady clock of this process read so."""

    answered_ns: TimeNs
    pace: float
    at_ns: int


class _Asked:
    """A post that is asked, by a clock of one pace."""

    def __init__(self, post_id: NodeId, pace: float) -> None:
        self.post_id = post_id
        self.pace = pace
        self.estimator = OffsetEstimator()
        self.unanswered = 0

    def take(self, exchanges: Mapping[NodeId, Exchange]) -> bool:
        exchange = exchanges.get(self.post_id)
        self.unanswered = self.unanswered + 1 if exchange is None else 0
        return exchange is not None and self.estimator.take(exchange)


def _read(payload: bytes) -> TimeAnswer | None:
    try:
        return _answers.decode(payload)
    except (msgspec.MsgspecError, UnicodeDecodeError):
        return None
