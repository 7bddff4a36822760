"""What the post answers to those who call mayday (pure): it has heard, and who has taken it up.

Whoever calls is told by every repeat of theirs how the alert stands, and at once when that changes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, TypeAlias

from command_post.desks.alert_desk import AlertDesk
from shared.messages import Alert, AlertStage, Mayday, MaydayAnswer, Message, NodeId

Stage: TypeAlias = Literal["heard", "acknowledged", "resolved"]

_STAGES: dict[AlertStage, Stage] = {
    "raised": "heard",
    "acknowledged": "acknowledged",
    "assigned": "acknowledged",
    "resolved": "resolved",
}


class MaydayAnswers:
    """Answers maydays by how the alerts of ``desk`` stand; ``sequence`` is left to the sender."""

    def __init__(self, desk: AlertDesk) -> None:
        self._desk = desk
        self._calls: dict[NodeId, Mayday] = {}

    def to(self, responder_id: NodeId, said: Message, now_ns: int) -> list[MaydayAnswer]:
        """Return the answer to what a responder's unit says, if that is a mayday."""
        if not isinstance(said, Mayday):
            return []
        before = self._calls.get(responder_id)
        if before is None or said.event_time_ns >= before.event_time_ns:
            self._calls[responder_id] = said
        alert = self._desk.newest("mayday", ("responder", responder_id))
        return [_answer(responder_id, said, alert, now_ns)]

    def after(self, alerts: Iterable[Alert], now_ns: int) -> list[MaydayAnswer]:
        """Return what is to be told to those whose maydays somebody has taken up."""
        return [
            _answer(alert.node_id, self._calls[alert.node_id], alert, now_ns)
            for alert in alerts
            if alert.kind == "mayday" and alert.by is not None and alert.node_id in self._calls
        ]


def _answer(responder_id: NodeId, call: Mayday, alert: Alert | None, now_ns: int) -> MaydayAnswer:
    by = None if alert is None else alert.by
    return MaydayAnswer(
        event_time_ns=now_ns,
        sequence=0,
        responder_id=responder_id,
        called_ns=call.called_ns,
        phase=call.phase,
        stage="heard" if alert is None or by is None else _STAGES[alert.stage],
        by=by,
    )
