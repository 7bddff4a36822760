"""That a node is at work, what its journal holds, and what of that is safe elsewhere."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from shared.messages.values import (
    MOST_LOST,
    ClockOffsetNs,
    Duration,
    Message,
    MessageNumber,
    NodeId,
    Probability,
    RunId,
    TimeNs,
)


class ClockSpan(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """What a journal has from ``first_number`` on was dated by a clock that was off by that."""

    first_number: MessageNumber
    offset_ns: ClockOffsetNs
    uncertainty_ns: TimeNs


class ClockStatement(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """How far the clock of the post ``post_id`` is ahead of a node's, as the node found out.

    It is ``offset_ns`` at the time of the beat, give or take ``uncertainty_ns``, and grows by
    ``drift`` (seconds a second). A process that dates its messages by a clock that was read anew
    begins a span: ``spans`` are the journal's, by number, where it has more than one.
    """

    post_id: NodeId
    offset_ns: ClockOffsetNs
    uncertainty_ns: TimeNs
    drift: Annotated[float, Meta(ge=-1e-3, le=1e-3)]
    spans: Annotated[tuple[ClockSpan, ...], Meta(max_length=32)] = ()


class Supplies(msgspec.Struct, frozen=True, kw_only=True, gc=False, omit_defaults=True):
    """What a node has left: the charge of its battery (0 to 1), its wearer's air; how hot it is."""

    battery: Probability | None = None
    charging: bool = False
    temperature_c: Annotated[float, Meta(ge=-273.15, le=1000.0)] | None = None
    air_bar: Annotated[float, Meta(ge=0.0, le=1000.0)] | None = None
    air_left_s: Duration | None = None


class Beat(Message, frozen=True, kw_only=True):
    """A node is at work, at ``event_time_ns``; what its journal holds for those who missed it.

    ``run`` is the journal's and ``last_number`` its newest message's, of which those before
    ``kept_from`` are there no more and those up to ``acknowledged`` are known to be safe elsewhere.
    The disk has ``lost`` some between: nobody is to wait for them. ``clock`` is what the node knows
    of its clock, ``None`` if nothing. ``supplies`` are what it has left, where that is told. The
    last beat of a node that is switched off says that it ``leaves``. All that its wearer moved
    until ``followed_until_ns`` is in the journal: ``None`` of who follows nobody, or does not say.
    """

    run: RunId
    last_number: MessageNumber
    kept_from: MessageNumber
    acknowledged: MessageNumber
    clock: ClockStatement | None = None
    lost: Annotated[tuple[MessageNumber, ...], Meta(max_length=MOST_LOST)] = ()
    supplies: Supplies | None = None
    leaves: bool = False
    followed_until_ns: TimeNs | None = None


class SafeUpTo(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """All messages of a journal up to ``number`` are on the disk of whoever says so."""

    role: Literal["responder", "dap", "post"]
    node_id: NodeId
    run: RunId
    number: MessageNumber


class Receipt(Message, frozen=True, kw_only=True):
    """What the post has safe of the nodes' journals: they need not keep it for the post's sake."""

    safe: Annotated[tuple[SafeUpTo, ...], Meta(max_length=256)]
