"""Alarms said again (pure): a message can be lost, and what it said still holds."""

from __future__ import annotations

from typing import NamedTuple

from edge_agent.alarms import AlarmEvent
from shared.messages import AlarmKind
from shared.units import NS_PER_S

REPEAT_NS = 5 * NS_PER_S
"""An alarm is said again so long after it was said last, while it stands."""

ENDED_REPEAT_NS = 2 * NS_PER_S
ENDED_REPEATS = 2
"""That an alarm is over is said again so often, and then taken as heard."""


class _Said(NamedTuple):
    """What was said last of a kind of alarm, when, and how often it is to be said again."""

    event: AlarmEvent
    time_ns: int
    repeats_left: int | None


class AlarmRepeats:
    """Takes alarms as they are raised and cancelled; tells what to send, repeats among it."""

    def __init__(self) -> None:
        self._said: dict[AlarmKind, _Said] = {}

    def due(self, events: list[AlarmEvent], now_ns: int) -> list[AlarmEvent]:
        """Return ``events``, which are new by ``now_ns``, and those to be said again by then."""
        for event in events:
            left = ENDED_REPEATS if event.phase == "cancelled" else None
            self._said[event.kind] = _Said(event, now_ns, left)
        if not self._said:
            return events
        return events + [
            again for said in list(self._said.values()) if (again := self._again(said, now_ns))
        ]

    def _again(self, said: _Said, now_ns: int) -> AlarmEvent | None:
        """Return what was said, if it is time to say it again; forget it if that was enough."""
        event, said_ns, left = said
        wait_ns = REPEAT_NS if left is None else ENDED_REPEAT_NS
        if 0 <= now_ns - said_ns < wait_ns:
            return None
        if left == 1:
            del self._said[event.kind]
        else:
            self._said[event.kind] = _Said(event, now_ns, left and left - 1)
        return event
