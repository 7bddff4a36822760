"""Routers dialled side by side, since Zenoh waits long for one that does not answer."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import structlog
import zenoh

log = structlog.stdlib.get_logger(__name__)

HEAD_START_S = 0.3
"""So much sooner than the next is each dialled: where the first answers, no other is bothered."""

PAUSE_S = 0.2
LONGEST_PAUSE_S = 1.0
WATCH_S = 0.05


class Answered(NamedTuple):
    """The router that answered first, and the session with it."""

    endpoint: str
    session: zenoh.Session


def configuration(settings: Mapping[str, Any]) -> zenoh.Config:
    """Return ``settings`` as Zenoh takes them."""
    return zenoh.Config.from_json5(json.dumps(settings))


def first_to_answer(
    settings: Mapping[str, Any], endpoints: Sequence[str], is_over: Callable[[], bool]
) -> Answered | None:
    """Dial all ``endpoints`` until one has answered; ``None`` once ``is_over()``.

    Those who answer too late are left again at once. To be called from a thread that is no daemon:
    the threads made here take after it, and may be inside Zenoh for as long as it waits for a
    link (``zenoh_settings.OPEN_LINK_MS``) after this has returned.
    """
    race = _Race(settings, endpoints)
    for number, endpoint in enumerate(endpoints):
        arguments = (endpoint, number * HEAD_START_S)
        threading.Thread(target=race.run, args=arguments, name="zenoh-dial").start()
    while not race.over.wait(WATCH_S):
        if is_over():
            race.call_off()
    return race.winner


class _Race:
    """Who is dialled, and who was the first to answer."""

    def __init__(self, settings: Mapping[str, Any], endpoints: Sequence[str]) -> None:
        self._settings = settings
        self._endpoints = endpoints
        self._silent: set[str] = set()
        self._lock = threading.Lock()
        self.over = threading.Event()
        self.winner: Answered | None = None

    def call_off(self) -> None:
        """Take nobody any more."""
        with self._lock:
            self.over.set()

    def run(self, endpoint: str, wait_s: float) -> None:
        """Dial after ``wait_s``, again and again, until somebody has answered."""
        connect = {**self._settings["connect"], "endpoints": [endpoint]}
        pause_s = PAUSE_S
        while not self.over.wait(wait_s):
            try:
                session = zenoh.open(configuration({**self._settings, "connect": connect}))
            except zenoh.ZError as error:
                self._note_silence(endpoint, error)
                wait_s, pause_s = pause_s, min(2.0 * pause_s, LONGEST_PAUSE_S)
            else:
                if not self._wins(Answered(endpoint, session)):
                    session.close()  # type: ignore[no-untyped-call]

    def _wins(self, answered: Answered) -> bool:
        with self._lock:
            if self.over.is_set():
                return False
            self.winner = answered
            self.over.set()
            return True

    def _note_silence(self, endpoint: str, error: zenoh.ZError) -> None:
        with self._lock:
            known = endpoint in self._silent
            self._silent.add(endpoint)
            is_last = not known and len(self._silent) == len(set(self._endpoints))
        if not known:
            log.debug("a router does not answer", dialling=endpoint, error=str(error))
        if is_last:
            log.info("no router answers yet, trying on", dialling=list(self._endpoints))
