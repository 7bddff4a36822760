"""What waits for the recorder's thread, and how much."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

from command_post.recorder.parts import RecordingSet
from shared.mcap_reader import BegunFrom


class Item(NamedTuple):
    """A message."""

    key: str
    payload: bytes
    log_time_ns: int
    outgoing: bool

    @property
    def size_bytes(self) -> int:
        """What it takes of the queue's room."""
        return len(self.payload)

    def write_to(self, file: RecordingSet) -> None:
        """Put it into ``file``."""
        file.put(self.key, self.payload, self.log_time_ns, outgoing=self.outgoing)


class End(NamedTuple):
    """That the incident was finished at ``now_ns``."""

    now_ns: int
    size_bytes: int = 0

    def write_to(self, file: RecordingSet) -> None:
        """Put it into ``file``."""
        file.mark_end(self.now_ns)


class Resumed(NamedTuple):
    """That a recording that was broken off is gone on with since ``now_ns``, from what.

    ``put_aside`` is named what is not handled, neither now nor before.
    """

    now_ns: int
    begun_from: BegunFrom = "all"
    put_aside: Sequence[str] = ()
    size_bytes: int = 0

    def write_to(self, file: RecordingSet) -> None:
        """Put it into ``file``."""
        file.mark_resumed(self.now_ns, self.begun_from, self.put_aside)


class WhenSafe(NamedTuple):
    """What is to be called once all before it is safe, with how far the file is written."""

    then: Callable[[int], None]
    size_bytes: int = 0


class RecorderStatus(NamedTuple):
    """How the recorder fares. ``fault``: why nothing is recorded at the moment, if so."""

    queued: int
    written: int
    dropped: int
    fault: str | None


Entry: TypeAlias = Item | End | Resumed | WhenSafe
