"""A recording in which something happens: an exercise, with an alarm and an order put into it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from command_post.recorder.file import RecordingFile
from command_post.review.past import Past
from shared.codec import encode
from shared.mcap_index import IndexedRecording
from shared.mcap_reader import RecordedMessage, read_recording
from shared.messages import (
    Alarm,
    Alert,
    AlertStage,
    Message,
    Order,
    OrderAnswer,
    OrderReply,
    OrderRequest,
)
from shared.topics import Key, Role
from shared.units import NS_PER_S
from tests.conftest import CHECKOUT

EXERCISE = CHECKOUT / "recordings" / "four_daps.mcap"
ALARM_S, ACKNOWLEDGED_S, RESOLVED_S = 60.0, 65.0, 90.0
ORDER_S, REPLY_S = 120.0, 123.0
SILENT_FROM_S, SILENT_TO_S = 150.0, 158.0
"""In which nothing was received."""


def eventful(path: Path) -> Path:
    """Make it at ``path``."""
    recording = read_recording(EXERCISE)
    exercise = list(recording)
    begin_ns = exercise[0].log_time_ns
    incident = exercise[0].key.split("/")[2]
    happened = sorted([*exercise, *_events(incident, begin_ns)], key=lambda each: each.log_time_ns)
    file = RecordingFile(path, recording.metadata)
    for each in happened:
        if not SILENT_FROM_S <= (each.log_time_ns - begin_ns) / NS_PER_S < SILENT_TO_S:
            file.put(each.key, each.payload, each.log_time_ns, outgoing=each.outgoing)
    file.mark_end(exercise[-1].log_time_ns)
    file.finish()
    return path


@contextmanager
def opened(path: Path) -> Iterator[Past]:
    """Give a recording as it is shown afterwards, all of it read."""
    with IndexedRecording([path]) as recording:
        past = Past(recording)
        for _ in past.read():
            pass
        yield past


def _events(incident: str, begin_ns: int) -> Iterator[RecordedMessage]:
    def at(after_s: float) -> int:
        return begin_ns + round(after_s * NS_PER_S)

    def said(after_s: float, role: Role, node_id: str, topic: str, message: Message,
             *, outgoing: bool = False) -> RecordedMessage:  # fmt: skip
        key = str(Key(incident, role, node_id, topic))
        return RecordedMessage(at(after_s), message.event_time_ns, key, encode(message), outgoing)

    def alert(after_s: float, sequence: int, stage: AlertStage, by: str | None) -> RecordedMessage:
        told = Alert(
            event_time_ns=at(after_s), sequence=sequence, number=0, kind="mayday",
            role="responder", node_id="r2", since_ns=at(ALARM_S), stage=stage,
            words="calls mayday: the button", by=by, assigned_to=None,
        )  # fmt: skip
        return said(after_s, "post", "post", "alert", told, outgoing=True)

    alarm = Alarm(
        event_time_ns=at(ALARM_S), sequence=0, kind="mayday", phase="alarm", confidence=1.0,
        reason="the button",
    )  # fmt: skip
    yield said(ALARM_S, "responder", "r2", "alarm", alarm)
    yield alert(ALARM_S, 0, "raised", None)
    yield alert(ACKNOWLEDGED_S, 1, "acknowledged", "kim")
    yield alert(RESOLVED_S, 2, "resolved", "kim")
    request = OrderRequest(
        event_time_ns=at(ORDER_S), sequence=7, kind="evacuate", to=(), text="north door"
    )
    number = at(ORDER_S) // 1_000_000
    order = Order(
        event_time_ns=at(ORDER_S), sequence=number, kind="evacuate", to=(), text="north door"
    )
    answer = OrderAnswer(
        event_time_ns=at(ORDER_S), sequence=0, commander_id="kim", request_sequence=7,
        refusal=None, waited_for=("r1", "r2", "r3"),
    )  # fmt: skip
    yield said(ORDER_S, "post", "kim", "order_request", request)
    yield said(ORDER_S, "post", "post", "order", order, outgoing=True)
    yield said(ORDER_S, "post", "post", "order_answer", answer, outgoing=True)
    for name in ("r1", "r3"):
        reply = OrderReply(
            event_time_ns=at(REPLY_S), sequence=0, post_id="post", order_sequence=number,
            stage="acknowledged",
        )  # fmt: skip
        yield said(REPLY_S, "responder", name, "order_reply", reply)
