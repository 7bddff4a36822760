"""What stood at a moment: alerts, orders, alarms, access points (pure).

What happens rarely is gone through in its order by the handlers that the post has for it. Going on
takes the few messages since; going back begins anew.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from command_post.desks.orders import Orders
from command_post.fusion.dap_map import InstalledDap
from command_post.nodes.told import Told
from command_post.web.board import with_outside
from shared.messages import (
    Alarm,
    Alert,
    DapEstimate,
    DapInstallation,
    Mayday,
    Message,
    NodeId,
    OrderAnswer,
    OrderReply,
    OrderRequest,
    OutsideWord,
)
from shared.topics import Key, Role

RARE = frozenset(
    {
        "alert", "order", "order_answer", "order_request", "order_reply", "alarm", "mayday",
        "installation", "dap_place", "outside",
    }
)  # fmt: skip
"""The topics that it is gone by."""

MADE = frozenset({"alert", "order", "order_answer", "dap_place"})
"""Those of them that the post has made of what it received."""


class Happened(NamedTuple):
    """A message, and when it was received or made; ``None`` says that its node is heard first."""

    at_ns: int
    key: Key
    message: Message | None


class Standing:
    """What the messages up to a moment come to."""

    def __init__(self) -> None:
        self.alerts: dict[int, Alert] = {}
        self.answers: list[OrderAnswer] = []
        self.told = Told()
        self.orders = Orders()
        self.daps: dict[NodeId, InstalledDap] = {}
        self.outside: dict[str, OutsideWord] = {}
        self._known: set[NodeId] = set()
        self._installers: dict[tuple[NodeId, int], NodeId | None] = {}

    def take(self, happened: Happened) -> None:
        """Take in the next message."""
        at_ns, key, message = happened
        match message:
            case None:
                self._known.add(key.node_id)
                self.orders.meet(key.node_id)
            case Alert():
                self.alerts[message.number] = message
            case OrderAnswer():
                self.answers.append(message)
            case OrderRequest():
                self.orders.request(message, self._known, at_ns)
            case OrderReply():
                self.orders.take(key.node_id, message)
            case Alarm() | Mayday():
                self.told.take(key.role, key.node_id, message, at_ns)
            case OutsideWord():
                shown = with_outside(self.outside, message)
                self.outside = self.outside if shown is None else shown
            case DapInstallation():
                self._install(key.node_id, message)
            case DapEstimate(dap_id=dap_id, event_time_ns=since_ns):
                installer_id = self._installers.get((dap_id, since_ns))
                self.daps[dap_id] = InstalledDap(message.position, since_ns, installer_id)

    def faults(self, role: Role, node_id: str) -> list[str]:
        """Return what was held to be wrong with a node: the doubts that stand."""
        return [
            alert.words
            for alert in self.alerts.values()
            if alert.kind in ("doubt", "dap_moved")
            and (alert.role, alert.node_id) == (role, node_id)
            and alert.stage != "resolved"
        ]

    def _install(self, dap_id: NodeId, said: DapInstallation) -> None:
        if said.position is None and said.installer_id is None:
            self.daps.pop(dap_id, None)
        else:
            self._installers[dap_id, said.event_time_ns] = said.installer_id


class Course:
    """All that happened rarely, in its order; ``at`` says how it stood at a moment."""

    def __init__(self, happened: Sequence[Happened]) -> None:
        self.happened = sorted(happened, key=lambda each: each.at_ns)
        self._at_ns = [each.at_ns for each in self.happened]
        self._standing = Standing()
        self._taken = 0

    def at(self, at_ns: int) -> Standing:
        """Return what stood at ``at_ns``; it is good until this is asked again."""
        wanted = bisect_right(self._at_ns, at_ns)
        if wanted < self._taken:
            self._standing, self._taken = Standing(), 0
        for each in self.happened[self._taken : wanted]:
            self._standing.take(each)
        self._taken = wanted
        return self._standing

    def alerted(self, after_ns: int, until_ns: int) -> list[Alert]:
        """Return how alerts changed after one moment and until another, the newest of each."""
        first, last = (bisect_right(self._at_ns, each) for each in (after_ns, until_ns))
        newest: Mapping[int, Alert] = {
            each.message.number: each.message
            for each in self.happened[first:last]
            if isinstance(each.message, Alert)
        }
        return list(newest.values())
