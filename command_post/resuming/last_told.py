"""What a recording has told last: what it takes to go on from it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from command_post.fusion.track import Estimate
from shared.messages import Alert, DapEstimate


class Recorded(Protocol):
    """A message as it was recorded; ``outgoing`` ones were made of those received."""

    @property
    def log_time_ns(self) -> int:
        """When it was received, or made."""

    @property
    def key(self) -> str:
        """The key it came or went under."""

    @property
    def payload(self) -> bytes:
        """Its bytes."""

    @property
    def outgoing(self) -> bool:
        """Whether it was made."""


class LastTold(NamedTuple):
    """What was told last: of each responder, of each DAP (as it was said), of each alert.

    ``to_handle`` is what was received and matters still, in its order; ``moves`` counts all moves
    received. ``next_sequences`` number what is said next, by topic; ``last_ns`` is when the last
    message was recorded.
    """

    estimates: Mapping[str, Estimate]
    dap_places: Mapping[str, tuple[str, bytes, DapEstimate]]
    alerts: list[Alert]
    next_sequences: Mapping[str, int]
    to_handle: list[Recorded]
    moves: int
    last_ns: int
