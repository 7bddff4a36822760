"""From the post to whoever shows what it says: the post leaves it here, and waits for nobody.

Estimates come by the thousand a second, and only the newest of each matters: of those that nobody
took the oldest make room. Alerts and answers wait apart, so that no crowd of estimates displaces
one. Of rosters only the newest is kept.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Generic, Protocol, TypeVar

from command_post.roster import Roster
from shared.bus.inbox import Inbox

MOST_TRACKS = 20_000
MOST_RARE = 4_096
_RARE = frozenset({"alert", "order_answer", "origin", "outside"})


class Follower(Protocol):
    """What makes something of what the post says."""

    def publish(self, key_text: str, payload: bytes) -> None:
        """Take in a message that the post has published."""

    def show(self, roster: Roster) -> None:
        """Take in the newest roster."""


F = TypeVar("F", bound=Follower)


class Handover(Generic[F]):
    """Keeps a follower up with the post, at the expense of whoever looks at it."""

    def __init__(self, follower: F) -> None:
        self._follower = follower
        self._looking = threading.Lock()
        self._tracks: Inbox[tuple[str, bytes]] = Inbox(MOST_TRACKS)
        self._rare: Inbox[tuple[str, bytes]] = Inbox(MOST_RARE)
        self._rosters: Inbox[Roster] = Inbox(1)

    @property
    def dropped(self) -> int:
        """How many messages nobody took in time."""
        return self._tracks.dropped + self._rare.dropped

    @property
    def waiting(self) -> int:
        """How many messages are left here."""
        return len(self._tracks) + len(self._rare)

    def published(self, key_text: str, payload: bytes) -> None:
        """Leave what the post has published, if anybody wants to know it."""
        topic = key_text[key_text.rfind("/") + 1 :]
        if topic == "track":
            self._tracks.put((key_text, payload))
        elif topic in _RARE:
            self._rare.put((key_text, payload))

    def show(self, roster: Roster) -> None:
        """Leave the newest roster."""
        self._rosters.put(roster)

    @contextmanager
    def now(self) -> Iterator[F]:
        """Give the follower as it is once it has taken in all that was left; to one at a time."""
        with self._looking:
            for key_text, payload in (*self._rare.get_all(), *self._tracks.get_all()):
                self._follower.publish(key_text, payload)
            for roster in self._rosters.get_all():
                self._follower.show(roster)
            yield self._follower
