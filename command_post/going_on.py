"""The post goes on whatever fails of its shell: its page, its table, a thread of its own.

What nobody expected is an error in the log the first time, counted from then on, and a remark in
the roster.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from threading import Event
from typing import Protocol

import structlog

from command_post.fusion.mishaps import GotOver
from command_post.roster import Roster

PAUSE_S = 1.0
"""A thread that fails again and again shall not keep the machine busy with it."""

_log = structlog.stdlib.get_logger(__name__)


class Guest(Protocol):
    """Somebody at the post who follows what it says, and may ask for something: its page, TAK."""

    def published(self, key_text: str, payload: bytes) -> None:
        """Take in what the post has published."""

    def show(self, roster: Roster) -> None:
        """Take in the newest roster."""

    def take_requests(self) -> list[tuple[str, bytes]]:
        """Return what was asked for since, as messages under their keys."""


class GoingOn:
    """Breaks off what fails, and tells of it."""

    def __init__(self) -> None:
        self._failed: Counter[tuple[str, str]] = Counter()

    @property
    def remarks(self) -> list[str]:
        """What fails, in words."""
        return [
            f"{what} failed {count} times for a fault of the post ({error})"
            for (what, error), count in sorted(self._failed.items())
        ]

    def survived(self, what: str) -> GotOver:
        """Break off at an exception what is done within; interrupts go on upwards."""
        return GotOver(lambda error: self._note(what, error))

    def running(self, what: str, run: Callable[[Event], None], stop: Event) -> None:
        """Have ``run`` run until ``stop``, and begin it anew wherever it fails."""
        while not stop.is_set():
            with self.survived(what):
                run(stop)
                return
            stop.wait(PAUSE_S)

    def _note(self, what: str, error: Exception) -> None:
        kind = (what, type(error).__name__)
        self._failed[kind] += 1
        if self._failed[kind] == 1:
            _log.error("the post goes on without what fails", what=what, exc_info=error)


class Guests:
    """The guests of a post, none of whom can hold it up by failing."""

    def __init__(self, guests: Sequence[Guest], going_on: GoingOn) -> None:
        self._guests = tuple(guests)
        self._going_on = going_on

    def published(self, key_text: str, payload: bytes) -> None:
        """Tell all what the post has published."""
        for guest in self._guests:
            with self._going_on.survived(_name(guest)):
                guest.published(key_text, payload)

    def show(self, roster: Roster) -> None:
        """Give all the newest roster."""
        for guest in self._guests:
            with self._going_on.survived(_name(guest)):
                guest.show(roster)

    def take_requests(self) -> list[tuple[str, bytes]]:
        """Return what they ask for, as messages under their keys."""
        asked: list[tuple[str, bytes]] = []
        for guest in self._guests:
            with self._going_on.survived(_name(guest)):
                asked += guest.take_requests()
        return asked


def _name(guest: Guest) -> str:
    return type(guest).__name__
