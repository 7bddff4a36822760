"""How a client stays linked: routers dialled side by side, and a link held in reserve.

Zenoh links a client to one router, waits long for one that does not answer, and over TLS a link
takes four times there and back to open: time in which its wearer is not heard. So each router gets
a session of its own, and the one to change to is open before it is needed.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import structlog
import zenoh

from shared.bus.zenoh_settings import OPEN_RESERVE_MS

log = structlog.stdlib.get_logger(__name__)

HEAD_START_S = 0.3
"""So much sooner than the next is each dialled: where the first answers, no other is bothered."""

PAUSE_S = 0.2
LONGEST_PAUSE_S = 1.0
LONGEST_PAUSE_FOR_RESERVE_S = 2.0
WATCH_S = 0.05

NONE_ANSWERS = "no router answers yet, trying on"
NONE_IN_RESERVE = "no other router is in reach, should this one be lost"


class Answered(NamedTuple):
    """A router that has answered, and the session with it."""

    endpoint: str
    session: zenoh.Session


class LinkKeeper:
    """Finds a session with one of ``endpoints``, and another one when its link is gone.

    ``is_linked`` tells whether there is a link, ``adopt`` takes a session for use in place of the
    former, or returns ``False``, and ``has_linked`` is called whenever a link has come.
    """

    def __init__(
        self,
        settings: Mapping[str, Any],
        endpoints: Sequence[str],
        *,
        is_linked: Callable[[], bool],
        adopt: Callable[[zenoh.Session], bool],
        has_linked: Callable[[], None],
    ) -> None:
        transport = {**settings["transport"], "unicast": {"open_timeout": OPEN_RESERVE_MS}}
        self._settings = settings
        self._reserve_settings = {**settings, "transport": transport}
        self._endpoints = list(endpoints)
        self._is_linked = is_linked
        self._adopt = adopt
        self._has_linked = has_linked
        self._others = self._endpoints
        self._dialling: Dialling | None = None
        self._reserve: Answered | None = None

    def run(self, closing: threading.Event) -> None:
        """Keep linked until ``closing``.

        From a thread that is no daemon: those made here take after it, and may be inside Zenoh for
        as long as that waits for a link (``zenoh_settings.OPEN_LINK_MS``) when this has returned.
        """
        while not closing.is_set():
            if self._is_linked():
                self._tend_reserve()
            elif not closing.is_set():
                self._find_link(closing)
            closing.wait(WATCH_S)
        reserve = self._take_reserve()
        if reserve is not None:
            leave(reserve.session)

    def _find_link(self, closing: threading.Event) -> None:
        """Change to the router in reserve, or to the first that answers.

        Zenoh redials the router that was lost by itself, but with no more patience than it took
        to open: so where there are others, it comes after them.
        """
        log.info("there is no link", dialling=self._others)
        answered = self._take_reserve()
        if answered is None:
            lost = [each for each in self._endpoints if each not in self._others]
            dialled = [*self._others, *lost] if self._others else []
            dialling = Dialling(self._settings, dialled, LONGEST_PAUSE_S, NONE_ANSWERS)
            while not (dialling.over.wait(WATCH_S) or closing.is_set() or self._is_linked()):
                pass
            answered = dialling.call_off()
        if answered is not None:
            turn = self._endpoints.index(answered.endpoint)
            self._others = [*self._endpoints[turn + 1 :], *self._endpoints[:turn]]
            if not self._adopt(answered.session):
                leave(answered.session)
        if not closing.is_set():
            self._has_linked()

    def _tend_reserve(self) -> None:
        """See to it that there is a link to another router, if one is in reach."""
        if self._reserve is not None:
            if not has_link(self._reserve.session):
                leave(self._reserve.session)
                self._reserve = None
        elif self._dialling is None:
            if self._others:
                self._dialling = Dialling(
                    self._reserve_settings, self._others, LONGEST_PAUSE_FOR_RESERVE_S,
                    NONE_IN_RESERVE,
                )  # fmt: skip
        elif self._dialling.over.is_set():
            self._reserve, self._dialling = self._dialling.call_off(), None

    def _take_reserve(self) -> Answered | None:
        """Return the session in reserve, if it has a link; from now on there is none."""
        reserve, dialling = self._reserve, self._dialling
        self._reserve = self._dialling = None
        if dialling is not None:
            reserve = dialling.call_off()
        if reserve is None or has_link(reserve.session):
            return reserve
        leave(reserve.session)
        return None


class Dialling:
    """Routers that are dialled until one has answered, which sets ``over``, or until called off.

    Who answers too late is left again at once; ``in_vain`` is logged once all have been silent.
    """

    def __init__(
        self,
        settings: Mapping[str, Any],
        endpoints: Sequence[str],
        longest_pause_s: float,
        in_vain: str,
    ) -> None:
        self._settings = settings
        self._in_vain = in_vain
        self._endpoints = list(endpoints)
        self._longest_pause_s = longest_pause_s
        self._silent: set[str] = set()
        self._lock = threading.Lock()
        self._winner: Answered | None = None
        self.over = threading.Event()
        for number, endpoint in enumerate(self._endpoints):
            arguments = (endpoint, number * HEAD_START_S)
            threading.Thread(target=self._dial, args=arguments, name="zenoh-dial").start()

    def call_off(self) -> Answered | None:
        """Dial no more; return who has answered, if anyone has."""
        with self._lock:
            self.over.set()
            return self._winner

    def _dial(self, endpoint: str, wait_s: float) -> None:
        connect = {**self._settings["connect"], "endpoints": [endpoint]}
        pause_s = PAUSE_S
        while not self.over.wait(wait_s):
            try:
                session = zenoh.open(configuration({**self._settings, "connect": connect}))
            except zenoh.ZError as error:
                self._note_silence(endpoint, error)
                wait_s, pause_s = pause_s, min(2.0 * pause_s, self._longest_pause_s)
            else:
                if not self._wins(Answered(endpoint, session)):
                    leave(session)

    def _wins(self, answered: Answered) -> bool:
        with self._lock:
            if self.over.is_set():
                return False
            self._winner = answered
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
            log.info(self._in_vain, dialling=self._endpoints)


def configuration(settings: Mapping[str, Any]) -> zenoh.Config:
    """Return ``settings`` as Zenoh takes them."""
    return zenoh.Config.from_json5(json.dumps(settings))


def has_link(session: zenoh.Session | None) -> bool:
    """Return whether a link to another node is up at this moment."""
    with suppress(zenoh.ZError):  # closed meanwhile
        return session is not None and bool(session.info.links())
    return False


def leave(session: zenoh.Session) -> None:
    """Close ``session``; where it has no link, behind this thread's back.

    There Zenoh redials, and closes only when it has waited for that router in vain.
    """
    if has_link(session):
        session.close()  # type: ignore[no-untyped-call]
    else:
        threading.Thread(target=session.close, name="zenoh-leave").start()
