"""The newest of what units tell and is not fused: alarms, health, movements, boxes (pure).

It is taken in at once: an alarm waits for nobody.
"""

from __future__ import annotations

from typing import NamedTuple

from command_post.nodes.box_words import box_words
from command_post.nodes.last_signs import LastSigns
from command_post.nodes.supplies import supplies_of
from shared.messages import (
    Alarm,
    AlarmKind,
    Beat,
    DapInstallation,
    DapState,
    Mayday,
    Message,
    NodeHealth,
    OdometryIncrement,
    Supplies,
)
from shared.topics import Role


class RaisedAlarm(NamedTuple):
    """What an alarm's newest message says, and when that phase was first heard of, post's clock."""

    alarm: Alarm
    heard_ns: int


class LastMovement(NamedTuple):
    """A responder's newest movement, and when it was heard, on the post's clock."""

    increment: OdometryIncrement
    heard_ns: int


class Told:
    """What was told last, by responder; alarms by their kind as well, ``cancelled`` ones too.

    ``boxes`` by DAP: what each said of itself; ``supplies`` by node: what it has left.
    """

    def __init__(self) -> None:
        self.boxes: dict[str, DapState] = {}
        self.alarms: dict[str, dict[AlarmKind, RaisedAlarm]] = {}
        self.health: dict[str, NodeHealth] = {}
        self.movements: dict[str, LastMovement] = {}
        self.supplies: dict[tuple[Role, str], Supplies] = {}
        self._signs = LastSigns()

    def take(self, role: Role, node_id: str, message: Message, now_ns: int) -> None:
        """Keep ``message``, heard at ``now_ns``, if it is the newest of its kind."""
        self._signs.take(role, node_id, message, now_ns)
        match message:
            case OdometryIncrement():
                last = self.movements.get(node_id)
                if last is None or _is_newer(message, last.increment):
                    self.movements[node_id] = LastMovement(message, now_ns)
            case Beat(supplies=Supplies() as supplies):
                self.supplies[role, node_id] = supplies
            case Alarm():
                self._take_alarm(node_id, message, now_ns)
            case Mayday():
                self._take_alarm(node_id, as_alarm(message), now_ns)
            case NodeHealth():
                said = self.health.get(node_id)
                if said is None or _is_newer(message, said):
                    self.health[node_id] = message
            case DapState():
                box = self.boxes.get(node_id)
                if box is None or _is_newer(message, box):
                    self.boxes[node_id] = message
                    self.supplies[role, node_id] = supplies_of(message)

    def of_box(self, dap_id: str, silent_ns: int, now_ns: int) -> list[str]:
        """Return in words what is wrong with a DAP's box; of a dead one why, as far as is known.

        ``silent_ns`` is for how long nothing was heard of it.
        """
        state = self.boxes.get(dap_id)
        words = [*box_words(state, silent_ns)]
        if state is None or state.going is None:
            words += self._signs.words(dap_id, now_ns)
        return words

    def _take_alarm(self, node_id: str, alarm: Alarm, now_ns: int) -> None:
        of_node = self.alarms.setdefault(node_id, {})
        known = of_node.get(alarm.kind)
        if known is None or _is_newer(alarm, known.alarm):
            goes_on = known is not None and known.alarm.phase == alarm.phase
            heard_ns = known.heard_ns if known is not None and goes_on else now_ns
            of_node[alarm.kind] = RaisedAlarm(alarm, heard_ns)


def why_nowhere(said: DapInstallation) -> str | None:
    """Return in words why it is not known where a DAP stands; ``None`` if that is to be found."""
    if said.position is not None or said.installer_id is not None:
        return None
    if said.at_rest:
        return "lies where nobody set it down: it is placed when it is passed"
    return "taken up, and nowhere until it is set down again"


def is_taken_up(said: DapInstallation) -> bool:
    """Say whether a DAP tells that it was taken up, and stands nowhere since."""
    return why_nowhere(said) is not None and not said.at_rest


def as_alarm(mayday: Mayday) -> Alarm:
    """Return a wearer's call for help, or its end, as the alarm that it is."""
    return Alarm(
        event_time_ns=mayday.event_time_ns,
        sequence=mayday.sequence,
        kind="mayday",
        phase="alarm" if mayday.phase == "called" else "cancelled",
        confidence=1.0,
        reason=mayday.reason,
    )


def _is_newer(message: Message, known: Message) -> bool:
    """Whether ``message`` was sent after ``known``, of the same key.

    A sender that begins anew numbers from 0 again, one whose clock is set back counts on: either
    order is believed, for what is neither later nor further is a repeat.
    """
    later = message.event_time_ns > known.event_time_ns
    return later or message.sequence > known.sequence
