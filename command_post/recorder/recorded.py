"""What is recorded, and what a record is to whoever puts something into it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol


class Outgoing(Protocol):
    """What an incident has to say."""

    @property
    def key(self) -> str:
        """The key it goes out under."""

    @property
    def payload(self) -> bytes:
        """Its bytes."""


class Incident(Protocol):
    """What handles messages and makes others of them, by nothing but the calls it gets."""

    def handle(self, key: str, payload: bytes, now_ns: int) -> Sequence[Outgoing]:
        """Take one message in; return what has become due."""

    def pass_time(self, now_ns: int) -> Sequence[Outgoing]:
        """Return what has become due with nothing heard."""

    def finish(self, now_ns: int) -> Sequence[Outgoing]:
        """Return what is still held back."""


class Record(Protocol):
    """What messages are put into: a ``Recorder``, or a ``RecordingFile`` itself."""

    def put(self, key: str, payload: bytes, log_time_ns: int, *, outgoing: bool = False) -> bool:
        """Add a message that was received at ``log_time_ns``, or made then (``outgoing``).

        Say whether it is taken.
        """

    def mark_end(self, now_ns: int) -> None:
        """Say that the incident was finished at ``now_ns``: no more is received."""
