"""What a recording's time line shows: how long it is, what was alerted to and ordered, its gaps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import msgspec

from command_post.review.past import Past
from command_post.review.standing import Happened
from shared.messages import Alert, NodeId, Order, OrderAnswer, OrderReply, OrderRequest
from shared.units import NS_PER_S

GAP_S = 5.0
"""Somebody beats twice a second: so long nothing comes only if nobody is there, or no record."""


class Step(msgspec.Struct, frozen=True):
    """What became of an alert or an order, when (s since the beginning) and by whom."""

    at_s: float
    stage: str
    by: NodeId | None = None
    to: NodeId | None = None


class Mark(msgspec.Struct, frozen=True):
    """An alert or an order: when it came (s since the beginning), and all that became of it.

    ``awaited`` are those who have never acknowledged an order.
    """

    at_s: float
    kind: str
    node_id: NodeId
    words: str
    steps: tuple[Step, ...] = ()
    awaited: tuple[NodeId, ...] = ()


class Gap(msgspec.Struct, frozen=True):
    """From when to when (s since the beginning) there is nothing, and why."""

    from_s: float
    to_s: float
    words: str


class Timeline(msgspec.Struct, frozen=True, kw_only=True):
    """A recording from ``begin_ns``, post's clock, for ``length_s``; estimates up to ``read_s``.

    ``faults`` say in words what is wrong with the record.
    """

    name: str
    begin_ns: int
    length_s: float
    read_s: float
    marks: list[Mark]
    gaps: list[Gap]
    faults: list[str]


def timeline_of(past: Past, known: Timeline | None = None) -> Timeline:
    """Return what is known of a recording's course; of what was ``known``, what may be new."""
    begin_ns = past.begin_ns
    read_s = (past.read_until_ns - begin_ns) / NS_PER_S
    if known is not None:
        return msgspec.structs.replace(known, read_s=read_s, faults=list(_faults(past)))
    return Timeline(
        name=past.recording.paths[0].name,
        begin_ns=begin_ns,
        length_s=(past.end_ns - begin_ns) / NS_PER_S,
        read_s=read_s,
        marks=marks_of(past.course.happened, begin_ns),
        gaps=gaps_of(past),
        faults=list(_faults(past)),
    )


def marks_of(happened: Iterable[Happened], begin_ns: int) -> list[Mark]:
    """Return alerts and orders in the order in which they came."""
    alerts: dict[int, list[Alert]] = {}
    asked: list[tuple[Happened, OrderRequest]] = []
    issued: dict[int, Order] = {}
    answers: dict[tuple[NodeId, int], OrderAnswer] = {}
    replies: dict[int, list[tuple[Happened, OrderReply]]] = {}
    for each in happened:
        match each.message:
            case Alert() as alert:
                alerts.setdefault(alert.number, []).append(alert)
            case OrderRequest() as request:
                asked.append((each, request))
            case Order() as order:
                issued[each.at_ns] = order
            case OrderAnswer() as answer:
                answers[answer.commander_id, answer.request_sequence] = answer
            case OrderReply() as reply:
                replies.setdefault(reply.order_sequence, []).append((each, reply))
    marks = [_of_alert(stages, begin_ns) for stages in alerts.values()]
    for each, request in asked:
        order_now = issued.get(each.at_ns)
        told = answers.get((each.key.node_id, request.sequence))
        heard = replies.get(order_now.sequence, []) if order_now is not None else []
        marks.append(_of_order(each, request, told, heard, begin_ns))
    return sorted(marks, key=lambda each: each.at_s)


def gaps_of(past: Past) -> list[Gap]:
    """Return where nothing was recorded for long."""
    resumed_ns = past.recording.gone.resumed_ns
    return [
        Gap(
            _since(left_ns, past.begin_ns),
            _since(came_ns, past.begin_ns),
            "the post was not at work"
            if any(left_ns <= each <= came_ns for each in resumed_ns)
            else "nothing was received",
        )
        for left_ns, came_ns in past.recording.silences_ns(round(GAP_S * NS_PER_S))
    ]


def _of_alert(stages: list[Alert], begin_ns: int) -> Mark:
    first = stages[0]
    steps = [
        Step(_since(each.event_time_ns, begin_ns), each.stage, each.by, each.assigned_to)
        for each in stages
    ]
    since_s = _since(first.since_ns, begin_ns)
    return Mark(since_s, first.kind, first.node_id, first.words, tuple(steps))


def _of_order(
    asked: Happened,
    request: OrderRequest,
    answer: OrderAnswer | None,
    replies: Iterable[tuple[Happened, OrderReply]],
    begin_ns: int,
) -> Mark:
    at_s = _since(asked.at_ns, begin_ns)
    refused = "" if answer is None else answer.refusal or ""
    steps = [Step(at_s, "refused" if refused else "ordered", asked.key.node_id)]
    steps += [
        Step(_since(each.at_ns, begin_ns), reply.stage, each.key.node_id) for each, reply in replies
    ]
    told = [request.text, f"to: {', '.join(request.to) or 'everybody'}", refused]
    words = "; ".join(each for each in told if each)
    done = {step.by for step in steps if step.stage == "acknowledged"}
    waited_for = () if answer is None or request.kind == "withdraw" else answer.waited_for
    awaited = tuple(each for each in waited_for if each not in done)
    return Mark(at_s, request.kind, asked.key.node_id, words, tuple(steps), awaited)


def _faults(past: Past) -> Iterator[str]:
    recording = past.recording
    if not recording.finished:
        yield "unfinished: the recorder was killed, or still writes"
    if recording.gone.dropped_count:
        yield f"{recording.gone.dropped_count} messages dropped by the recorder"
    damages = {each.offset_bytes: each for each in list(recording.damages)}
    for damage in damages.values():
        yield f"damaged at byte {damage.offset_bytes}: {damage.reason}"


def _since(time_ns: int, begin_ns: int) -> float:
    return round((time_ns - begin_ns) / NS_PER_S, 3)
