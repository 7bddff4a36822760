"""What time it is at the post: its own clock's, or an exercise's once that was started."""

from __future__ import annotations

from collections.abc import Collection

import structlog

from shared.bus.interface import Received
from shared.clock import Clock, PacedClock
from shared.codec import Refusal, decode, parse_key
from shared.messages import ExerciseStart
from shared.units import NS_PER_S

SET_BACK_NS = NS_PER_S
"""A clock that reads so much less than before has been set."""

MOST_AHEAD_NS = 60 * NS_PER_S
LONGEST_EXERCISE_NS = 24 * 3600 * NS_PER_S

_log = structlog.stdlib.get_logger(__name__)


class PostClock(PacedClock):
    """The clock ``own``; set by an exercise's start, if the post waits for one.

    ``own_keys`` are those the post itself says things under: it starts no exercise.
    """

    def __init__(self, own: Clock, own_keys: Collection[str], *, follows_exercise: bool) -> None:
        super().__init__(own)
        self.own = own
        self._own_keys = own_keys
        self._follows_exercise = follows_exercise
        self.exercise: Received | None = None
        """What has set it."""

        self.passed_ns = 0
        """As of when anything was handled last."""

    def handled_at_ns(self, came_ns: int) -> int:
        """Return as of when to handle what came then: not before time was said to have passed.

        So it is for what had to wait for its sender's turn, and for the first message after the
        clock was set back as well: a replay is told by that until when all was fused before.
        """
        handled_ns = max(came_ns, self.passed_ns)
        is_set_back = handled_ns - self.now_ns() > SET_BACK_NS
        self.passed_ns = came_ns if is_set_back else handled_ns
        return handled_ns

    def heed(self, key: str, payload: bytes) -> None:
        """Go by an exercise's start if this is the first that is heard of, and one is awaited."""
        if self._follows_exercise and key not in self._own_keys:
            self.follow(key, payload)

    def follow(self, key: str, payload: bytes) -> None:
        """Go by an exercise's start, if this is one."""
        parsed = parse_key(key)
        if isinstance(parsed, Refusal) or parsed.topic != "exercise":
            return
        start = decode(parsed, payload)
        if not isinstance(start, ExerciseStart):
            return
        since_ns = self.now_ns() - start.event_time_ns
        if not -MOST_AHEAD_NS <= since_ns <= LONGEST_EXERCISE_NS:
            _log.warning("an exercise's start at no likely time is passed over", key=key)
            return
        # The first start counts: whoever gives another must not turn the post's clock.
        self._follows_exercise = False
        self.exercise = Received(key, payload)
        self.run_from(start.event_time_ns, start.speed)
        _log.info("exercise", scenario=start.scenario, seed=start.seed, speed=start.speed)
