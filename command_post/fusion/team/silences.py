"""Who is silent, and when it is to be told anew how far they may have gone (pure).

A walker says so stride by stride, and a unit at work that it is. So where beats are missing the
wearer may be walking, all the time since they were last known of. Of a unit that does not beat, who
stands says nothing, and it takes longer to tell.
"""

from __future__ import annotations

import heapq
import sys
from collections.abc import Iterator
from itertools import islice

from command_post.fusion.team.log import ResponderLog
from command_post.fusion.team.settings import TeamSettings
from shared.units import NS_PER_S

NEVER_NS = sys.maxsize

RARER = 0.1
"""After this share of a silence it is told anew: nobody needs all of a night's."""


def is_silent(silent_s: float, log: ResponderLog, settings: TeamSettings) -> bool:
    """Say whether who was last known of ``silent_s`` ago should have been heard since."""
    return silent_s > quiet_s(log, settings)


def quiet_s(log: ResponderLog, settings: TeamSettings) -> float:
    """Return for how long it means nothing that nothing is heard."""
    if log.beat_s is None:
        return settings.silence_s
    return min(max(settings.missed_beats * log.beat_s, settings.missed_s), settings.silence_s)


def least_quiet_ns(settings: TeamSettings) -> int:
    """Return for how long it means nothing of anybody that nothing is heard."""
    return round(min(settings.missed_s, settings.silence_s) * NS_PER_S)


def unheard_m(silent_s: float, unseen_s: float, log: ResponderLog, settings: TeamSettings) -> float:
    """Return how far who is silent may have gone (standard deviation) since they were seen.

    It is ``silent_s`` since their unit told of them, and ``unseen_s`` since anybody did. Who does
    not beat may as well have stood for as long as they may.
    """
    stood_s = settings.silence_s if log.beat_s is None else 0.0
    return settings.silent_speed_m_s * max(min(unseen_s, silent_s - stood_s), 0.0)


class Silences:
    """When each responder is to be told anew of, if nothing is heard until then."""

    def __init__(self, settings: TeamSettings) -> None:
        self._settings = settings
        self._told_ns: dict[str, int] = {}
        self._seen_ns: dict[str, int] = {}
        self._silent: set[str] = set()
        self._due: list[tuple[int, str]] = []
        self._look_ns: dict[str, int] = {}
        """The one entry of each in ``_due`` that counts."""

    @property
    def due_ns(self) -> int | None:
        """When somebody has to be looked at next; ``None`` if nobody has."""
        return self._due[0][0] if self._due else None

    def told(self, responder_id: str, time_ns: int) -> None:
        """Note that it was told where they are at ``time_ns``."""
        before_ns = self._told_ns.get(responder_id)
        if before_ns is None:
            self.look(responder_id, time_ns)
        self._told_ns[responder_id] = time_ns if before_ns is None else max(before_ns, time_ns)

    def heard(self, responder_id: str, time_ns: int) -> None:
        """Note that it is known where somebody was at ``time_ns``."""
        if responder_id in self._silent:
            self.look(responder_id, time_ns)

    def seen(self, responder_id: str, time_ns: int) -> None:
        """Note that others told where somebody was at ``time_ns``: who is silent is told anew."""
        self._seen_ns[responder_id] = time_ns
        self.heard(responder_id, time_ns)

    def look(self, responder_id: str, time_ns: int) -> None:
        """Have somebody looked at from ``time_ns`` on, who may be silent sooner than was known."""
        if time_ns < self._look_ns.get(responder_id, NEVER_NS):
            self._look_ns[responder_id] = time_ns
            heapq.heappush(self._due, (time_ns, responder_id))

    def due(self, logs: dict[str, ResponderLog], until_ns: int) -> Iterator[tuple[int, str]]:
        """Yield when whom is to be told of, in order of time: with that it is noted as told."""
        while self._due and self._due[0][0] <= until_ns:
            look_ns, responder_id = heapq.heappop(self._due)
            if look_ns != self._look_ns.get(responder_id):
                continue
            del self._look_ns[responder_id]
            log = logs.get(responder_id)
            if log is None:
                del self._told_ns[responder_id]
                continue
            at_ns = self._next_ns(responder_id, log)
            if at_ns <= until_ns:
                yield at_ns, responder_id
                self._told_ns[responder_id] = at_ns
                silent_s = (at_ns - log.known.by(at_ns)) / NS_PER_S
                if is_silent(silent_s, log, self._settings):
                    self._silent.add(responder_id)
                else:
                    self._silent.discard(responder_id)
                at_ns = self._next_ns(responder_id, log)
            self.look(responder_id, at_ns)

    def _next_ns(self, responder_id: str, log: ResponderLog) -> int:
        """Return when it is to be told next: of who is silent, until they are not, else once.

        It does not depend on when one asks, nor on the order in which things were heard.
        """
        settings, told_ns = self._settings, self._told_ns[responder_id]
        known_ns, after = log.known.by(told_ns), log.known.after(told_ns)
        tick_ns = round(settings.tick_s * NS_PER_S)
        if responder_id in self._silent:
            if not is_silent((told_ns - known_ns) / NS_PER_S, log, settings):
                return told_ns
            seen_ns = max(known_ns, self._seen_ns.get(responder_id, 0))
            at_ns = told_ns + max(tick_ns, round(RARER * (told_ns - seen_ns)))
            return min([at_ns, *(span.begin_ns for span in islice(after, 1))])
        quiet_ns = round(quiet_s(log, settings) * NS_PER_S) + 1
        for span in after:
            if span.begin_ns >= max(known_ns + quiet_ns, told_ns + tick_ns):
                break
            known_ns = span.end_ns
        return max(known_ns + quiet_ns, told_ns + tick_ns)
