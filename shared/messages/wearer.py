"""What a responder's unit has to say of its wearer and of itself."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from shared.messages.values import (
    AlarmKind,
    AlarmPhase,
    Confidence,
    HealthLevel,
    Message,
    NodeId,
    TimeNs,
    Words,
)


class Alarm(Message, frozen=True, kw_only=True):
    """An alarm of a responder's unit begins, gets worse, goes on, or is over.

    An alarm that stands is said again every few seconds, with the time at which its phase began
    in ``event_time_ns``; ``cancelled`` ends it, and is said a few times.
    """

    kind: AlarmKind
    phase: AlarmPhase
    confidence: Confidence
    reason: Words


class Mayday(Message, frozen=True, kw_only=True):
    """A wearer calls for help, or takes that back: said again until the post has answered.

    ``called_ns`` is when they called, and names the call; ``event_time_ns`` when its phase began.
    """

    phase: Literal["called", "cancelled"]
    called_ns: TimeNs
    reason: Words


class NodeHealth(Message, frozen=True, kw_only=True):
    """What a unit finds of its own sensor, in words for who wears it; what is worst first.

    ``level`` is that of the worst finding, ``ok`` if nothing is wrong: findings of that level say
    how the sensor was found.
    """

    level: HealthLevel
    findings: Annotated[tuple[Words, ...], Meta(max_length=16)]


class DropAdvice(Message, frozen=True, kw_only=True):
    """A unit has told its wearer to set a DAP down here: how urgent that is, and why.

    ``boxes_left`` are those that the wearer carries.
    """

    urgency: Confidence
    reason: Words
    boxes_left: Annotated[int, Meta(ge=0, le=1000)]


class SiteAdvice(Message, frozen=True, kw_only=True):
    """The post has found that a DAP is wanted where a responder is: who carries one, sets it down.

    ``reason`` says what it would tell there.
    """

    responder_id: NodeId
    reason: Words
