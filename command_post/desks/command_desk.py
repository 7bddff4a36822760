"""What lies between commanders and crew: alerts, maydays, orders, the incident's place (pure).

What they ask for or are told of comes out as messages to be published.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from msgspec import structs

from command_post.desks.alert_desk import AlertDesk, Known
from command_post.desks.announcer import Announcer, Outgoing
from command_post.desks.mayday_answers import MaydayAnswers
from command_post.desks.orders import Orders
from command_post.incident_settings import IncidentSettings
from command_post.nodes.teams import Left
from shared.messages import (
    Alert,
    AlertRequest,
    Message,
    NodeId,
    OrderAnswer,
    OrderReply,
    OrderRequest,
    OriginSet,
    OutsideWord,
    StrangerNoticed,
)
from shared.topics import Role

START_ID = "start"
"""Under whose name stands in the record what was given as the post was started."""


class CommandDesk:
    """Takes in what commanders ask for and what crews raise, and answers both."""

    def __init__(self, settings: IncidentSettings, announcer: Announcer) -> None:
        self._announcer = announcer
        self._post_id = settings.post_id
        self._alerts = AlertDesk(settings.hold_ns)
        self._maydays = MaydayAnswers(self._alerts)
        self.orders = Orders()
        self.origin: Outgoing | None = None
        """Where on the Earth the incident is, as it was said last."""

    @property
    def alerts(self) -> Mapping[int, Alert]:
        """What the commander has been alerted to, by number; see ``AlertDesk``."""
        return self._alerts.alerts

    @property
    def due_ns(self) -> int | None:
        """When something is to be alerted to, were nothing heard until then."""
        return self._alerts.due_ns

    def restore(self, alerts: Iterable[Alert]) -> None:
        """Go on with alerts as they were told last, in the order of their numbers."""
        self._alerts.restore(alerts)

    def pass_time(self, now_ns: int) -> list[Outgoing]:
        """Return what is due by ``now_ns``."""
        return self._alerted(self._alerts.pass_time(now_ns))

    def hear(self, node: tuple[Role, NodeId], message: Message, now_ns: int) -> list[Outgoing]:
        """Take in what a node says; return what is alerted to, and what a mayday is answered."""
        if isinstance(message, OrderReply) and message.post_id == self._post_id:
            self.orders.take(node[1], message)
        alerted = self._alerted(self._alerts.hear(node, message, now_ns))
        answers = self._maydays.to(node[1], message, now_ns)
        return alerted + [self._announcer.mayday_answer(each) for each in answers]

    def take(
        self, by: NodeId, message: Message, responders: Collection[NodeId], now_ns: int
    ) -> list[Outgoing]:
        """Take in what a commander says, or what the post heard outside or at its links."""
        match message:
            case OrderRequest():
                return self._order(by, message, responders, now_ns)
            case AlertRequest():
                changed = self._alerts.request(by, message, now_ns)
                answers = self._maydays.after(changed, now_ns)
                return self._alerted(changed) + [
                    self._announcer.mayday_answer(each) for each in answers
                ]
            case OutsideWord():
                return self._alerted(self._alerts.hear_outside(message, now_ns))
            case OriginSet():
                return self._place(by, message, now_ns)
            case StrangerNoticed():
                return self._alerted(self._alerts.notice(message, now_ns))
            case _:
                return []

    def doubt(self, doubts: list[Known], time_ns: int) -> list[Outgoing]:
        """Alert to what the fusion doubts since ``time_ns``."""
        return self._alerted(self._alerts.doubt(doubts, time_ns))

    def leave(self, left: Iterable[Left], time_ns: int) -> list[Outgoing]:
        """Alert to those who have left their team."""
        return self._alerted(self._alerts.leave(left, time_ns))

    def _alerted(self, alerts: Iterable[Alert]) -> list[Outgoing]:
        return [self._announcer.alert(alert) for alert in alerts]

    def _place(self, by: NodeId, message: OriginSet, now_ns: int) -> list[Outgoing]:
        """Take in where on the Earth the incident is, and say so to everybody."""
        if by == START_ID and self.origin is not None:
            return []
        number = self._announcer.next_sequence("origin")
        said = structs.replace(message, event_time_ns=now_ns, sequence=number)
        self.origin = self._announcer.outgoing(said)
        return [self.origin]

    def _order(
        self,
        commander_id: NodeId,
        request: OrderRequest,
        responders: Collection[NodeId],
        now_ns: int,
    ) -> list[Outgoing]:
        """Do what a commander requests, and answer."""
        issued = self.orders.request(request, responders, now_ns)
        refusal = issued if isinstance(issued, str) else None
        order, waited_for = (None, ()) if isinstance(issued, str) else issued
        answer = OrderAnswer(
            event_time_ns=now_ns,
            sequence=self._announcer.next_sequence("order_answer"),
            commander_id=commander_id,
            request_sequence=request.sequence,
            refusal=refusal,
            waited_for=waited_for,
        )
        outgoing = [] if order is None else [self._announcer.outgoing(order)]
        return [*outgoing, self._announcer.outgoing(answer)]
