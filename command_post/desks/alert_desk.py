"""What the commander is alerted to, and how each alert stands (pure).

Alerts are few and each is told once: a unit's alarm, a node that beats and falls silent, what the
fusion comes to doubt, a stranger at the gate. One is *raised*; people acknowledge it, assign it,
resolve it. What is over by itself resolves itself. Nothing here runs on its own: time is what the
caller says it is, and what was due before is dated by when it was due.
"""

from __future__ import annotations

import heapq
import re
from collections import OrderedDict
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple, TypeAlias

import msgspec

from command_post.nodes.supplies import SupplyWatch, supplies_of, why_silent
from command_post.nodes.teams import Left
from command_post.nodes.told import as_alarm, why_nowhere
from shared.messages import (
    MOST_WORDS,
    Alarm,
    Alert,
    AlertKind,
    AlertRequest,
    AlertStage,
    Beat,
    DapInstallation,
    DapState,
    Mayday,
    Message,
    NodeId,
    OutsideWord,
    StrangerNoticed,
    Supplies,
)
from shared.topics import Role
from shared.units import NS_PER_S

Node: TypeAlias = tuple[Role, str]

SILENT_NS = 10 * NS_PER_S
"""A node beats twice a second: one that is not heard for so long has lost contact."""

HOLDS_SILENT = 20
"""In an exercise in a hurry beats are rarer: so many holds, if that is longer."""

MOST_ALERTS = 1000
"""More that are resolved are forgotten, the oldest first."""

_NO_ID = re.compile(r"[^A-Za-z0-9_-]")
MOST_ID = 32

_WORDS: dict[str, str] = {
    "motionless": "does not move",
    "fall": "has fallen",
    "mayday": "calls mayday",
}
_NAMES: dict[AlertKind, str] = {
    "dap_dead": "lost_contact", "dap_moved": "taken_up", "doubt": "doubt_",
}  # fmt: skip
"""What alerts are about, where that is not their kind."""

_GET_WORSE = frozenset({*_WORDS, "low_battery", "low_air"})
"""What is raised again when it says something else."""


class Known(NamedTuple):
    """A doubt of the fusion's, as far as an alert tells it."""

    kind: str
    role: Role
    node_id: str
    words: str


class AlertDesk:
    """Raises alerts and follows them. What has changed is returned, to be published."""

    def __init__(self, hold_ns: int) -> None:
        self._silent_ns = max(SILENT_NS, HOLDS_SILENT * hold_ns)
        self._alerts: OrderedDict[int, Alert] = OrderedDict()
        self._open: dict[tuple[str, Node], int] = {}
        """What stands, by what it is about (a kind, or a kind of doubt) and whom."""

        self._settled: dict[tuple[str, Node], str] = {}
        """What somebody has resolved and is not over: its words, so that repeats alert nobody."""

        self._calls: dict[Node, Mayday] = {}
        """What was said last of a wearer's newest mayday."""

        self._supplies: dict[Node, SupplyWatch] = {}
        self._remains: dict[Node, Supplies] = {}
        """What each node had left last, as far as it tells."""

        self._going: dict[Node, str | None] = {}
        """Why a DAP goes off, if it does."""

        self._installed_ns: dict[Node, int] = {}
        self._next_number = 0
        self._heard_ns: dict[Node, int] = {}
        self._deadlines: list[tuple[int, Node]] = []
        self._awaited: set[Node] = set()
        """Those with a deadline."""

    @property
    def alerts(self) -> Mapping[int, Alert]:
        """All alerts by number, resolved ones too, in the order in which they were raised."""
        return MappingProxyType(self._alerts)

    @property
    def due_ns(self) -> int | None:
        """When a node may have been silent for too long next."""
        return self._deadlines[0][0] if self._deadlines else None

    def restore(self, alerts: Iterable[Alert]) -> None:
        """Go on with alerts as they were told last, in the order of their numbers.

        What an alert is about is not all told: a doubt that stands is over once others come up.
        """
        self._alerts = OrderedDict(
            (alert.number, msgspec.structs.replace(alert, sequence=0)) for alert in alerts
        )
        self._next_number = max(self._alerts, default=-1) + 1
        self._open, self._settled = {}, {}
        for alert in self._alerts.values():
            about = (_NAMES.get(alert.kind, alert.kind), (alert.role, alert.node_id))
            if alert.stage != "resolved":
                self._open[about] = alert.number
            elif alert.by is not None:
                self._settled[about] = alert.words

    def pass_time(self, now_ns: int) -> list[Alert]:
        """Return the alerts to those who have fallen silent by ``now_ns``."""
        changed = []
        while self._deadlines and self._deadlines[0][0] <= now_ns:
            due_ns, node = heapq.heappop(self._deadlines)
            self._awaited.discard(node)
            if node not in self._heard_ns:
                continue
            heard_until_ns = self._heard_ns[node] + self._silent_ns
            if heard_until_ns > due_ns:
                self._await(node, heard_until_ns)
            else:
                why = why_silent(node[0], self._remains.get(node))
                words = f"nothing heard for {self._silent_ns / NS_PER_S:.0f} s"
                changed += self._lose(node, due_ns, words if why is None else f"{words}: {why}")
        return changed

    def hear(self, node: Node, message: Message, now_ns: int) -> list[Alert]:
        """Take in what a node says at ``now_ns``: that it is there, and perhaps an alarm."""
        if isinstance(message, Beat):
            return self._take_beat(node, message, now_ns)
        if node in self._heard_ns:
            self._heard_ns[node] = now_ns
        changed: list[Alert] = []
        match message:
            case Alarm():
                changed = self._take_alarm(node, message, now_ns)
            case StrangerNoticed():
                changed = self._notice_at(node, message, now_ns)
            case Mayday():
                changed = self._take_mayday(node, message, now_ns)
            case DapState():
                changed = self._take_box(node, message, now_ns)
            case DapInstallation():
                changed = self._take_installation(node, message, now_ns)
        return changed

    def leave(self, found: Iterable[Left], now_ns: int) -> list[Alert]:
        """Take in who has left their team, and who is with it again."""
        changed = []
        for responder_id, words in found:
            node: Node = ("responder", responder_id)
            changed += (
                self._over("left_team", node, now_ns, "with their team again")
                if words is None
                else self._raise("left_team", "left_team", node, now_ns, words)
            )
        return changed

    def notice(self, stranger: StrangerNoticed, now_ns: int) -> list[Alert]:
        """Take in that the gate turns somebody away."""
        node = (stranger.role, stranger.node_id)
        return self._raise("intruder", "intruder", node, now_ns, stranger.words)

    def _notice_at(self, dap: Node, stranger: StrangerNoticed, now_ns: int) -> list[Alert]:
        """Take in what a DAP noticed. It names whom it likes: an alert is of a node heard here."""
        named: Node = (stranger.role, stranger.node_id)
        node = named if named in self._heard_ns else dap
        return self._raise("intruder", "intruder", node, now_ns, f"{stranger.words} (by {dap[1]})")

    def hear_outside(self, word: OutsideWord, now_ns: int) -> list[Alert]:
        """Take in what another system says: a mayday there is one here."""
        node: Node = ("post", _NO_ID.sub("_", word.callsign)[:MOST_ID])
        if word.kind == "mayday":
            words = f"calls mayday in TAK: {word.words}".rstrip(": ")
            return self._raise(f"outside {word.uid}", "mayday", node, now_ns, words)
        if word.kind == "cancel":
            return self._over(f"outside {word.uid}", node, now_ns, "taken back in TAK")
        return []

    def doubt(self, doubts: Iterable[Known], now_ns: int) -> list[Alert]:
        """Take in all that the fusion doubts at ``now_ns``."""
        changed, standing = [], set()
        for doubt in doubts:
            about = (f"doubt_{doubt.kind}", (doubt.role, doubt.node_id))
            standing.add(about)
            kind: AlertKind = (
                "dap_moved" if (doubt.kind, doubt.role) == ("moved", "dap") else "doubt"
            )
            changed += self._raise(about[0], kind, about[1], now_ns, doubt.words)
        for name, node in [*self._open, *self._settled]:
            if name.startswith("doubt_") and (name, node) not in standing:
                changed += self._over(name, node, now_ns, "no longer doubted")
        return changed

    def request(self, by: NodeId, request: AlertRequest, now_ns: int) -> list[Alert]:
        """Do what somebody requests of an alert that stands; nothing of any other."""
        alert = self._alerts.get(request.number)
        if alert is None or alert.stage == "resolved":
            return []
        assigned_to = request.assigned_to or alert.assigned_to
        if request.stage == "assigned" and assigned_to is None:
            return []
        return self._turn(alert, request.stage, now_ns, by=by, assigned_to=assigned_to)

    def newest(self, kind: AlertKind, node: Node) -> Alert | None:
        """Return how the newest alert of a kind to a node stands, resolved or not, if any was."""
        alerts = reversed(self._alerts.values())
        return next(
            (one for one in alerts if (one.kind, one.role, one.node_id) == (kind, *node)), None
        )

    def _take_beat(self, node: Node, beat: Beat, now_ns: int) -> list[Alert]:
        """Watch who beats from now on; a recording without beats alerts to nobody."""
        changed = []
        if beat.leaves:
            going = self._going.get(node)
            words = "switched off" if going is None else f"went off: {going}"
            return self._lose(node, now_ns, words)
        if node not in self._heard_ns:
            self._await(node, now_ns + self._silent_ns)
            changed += self._over("lost_contact", node, now_ns, "heard again")
        self._heard_ns[node] = now_ns
        return (
            changed
            if beat.supplies is None
            else changed + self._take_supplies(node, beat.supplies, now_ns)
        )

    def _take_box(self, dap: Node, box: DapState, now_ns: int) -> list[Alert]:
        """Take in what a DAP's box is like; that it goes off now its last beat says."""
        self._going[dap] = box.going
        return self._take_supplies(dap, supplies_of(box), now_ns)

    def _take_supplies(self, node: Node, told: Supplies, now_ns: int) -> list[Alert]:
        self._remains[node] = told
        changed = []
        for kind, words in self._supplies.setdefault(node, SupplyWatch()).take(told):
            changed += (
                self._over(kind, node, now_ns, "enough again")
                if words is None
                else self._raise(kind, kind, node, now_ns, words)
            )
        return changed

    def _await(self, node: Node, due_ns: int) -> None:
        if node not in self._awaited:
            self._awaited.add(node)
            heapq.heappush(self._deadlines, (due_ns, node))

    def _lose(self, node: Node, now_ns: int, words: str) -> list[Alert]:
        self._heard_ns.pop(node, None)
        kind: AlertKind = "dap_dead" if node[0] == "dap" else "lost_contact"
        return self._raise("lost_contact", kind, node, now_ns, words)

    def _take_installation(self, dap: Node, said: DapInstallation, now_ns: int) -> list[Alert]:
        """Take in where a DAP stands; out of the journal it may be older than what was heard."""
        if said.event_time_ns < self._installed_ns.get(dap, 0):
            return []
        self._installed_ns[dap] = said.event_time_ns
        why = why_nowhere(said)
        if why is None:
            return self._over("taken_up", dap, now_ns, "set down again")
        return self._raise("taken_up", "dap_moved", dap, now_ns, why)

    def _take_mayday(self, node: Node, said: Mayday, now_ns: int) -> list[Alert]:
        """Take in a call or its end; out of the journal it may be older than what was heard."""
        before = self._calls.get(node)
        if before is not None and said.event_time_ns < before.event_time_ns:
            return []
        self._calls[node] = said
        if before is not None and said.called_ns != before.called_ns:
            # A new call is no repeat of one that somebody has resolved.
            self._settled.pop(("mayday", node), None)
        return self._take_alarm(node, as_alarm(said), now_ns)

    def _take_alarm(self, node: Node, alarm: Alarm, now_ns: int) -> list[Alert]:
        if alarm.phase == "cancelled":
            return self._over(alarm.kind, node, now_ns, alarm.reason)
        soon = " (warning)" if alarm.phase == "pre_alarm" else ""
        words = f"{_WORDS[alarm.kind]}{soon}: {alarm.reason}"
        return self._raise(alarm.kind, alarm.kind, node, now_ns, words)

    def _raise(
        self, name: str, kind: AlertKind, node: Node, now_ns: int, words: str
    ) -> list[Alert]:
        """Raise an alert; one that stands already is raised again where it says something else."""
        number = self._open.get((name, node))
        if number is not None:
            alert = self._alerts[number]
            worse = alert.words != words[:MOST_WORDS] and kind in _GET_WORSE
            return self._turn(alert, "raised", now_ns, words=words) if worse else []
        if self._settled.get((name, node)) == words:
            return []
        self._settled.pop((name, node), None)
        alert = Alert(
            event_time_ns=now_ns,
            sequence=0,
            number=self._next_number,
            kind=kind,
            role=node[0],
            node_id=node[1],
            since_ns=now_ns,
            stage="raised",
            words=words[:MOST_WORDS],
            by=None,
            assigned_to=None,
        )
        self._next_number += 1
        self._open[name, node] = alert.number
        self._alerts[alert.number] = alert
        self._forget()
        return [alert]

    def _over(self, name: str, node: Node, now_ns: int, words: str) -> list[Alert]:
        self._settled.pop((name, node), None)
        number = self._open.get((name, node))
        if number is None:
            return []
        return self._turn(self._alerts[number], "resolved", now_ns, words=words)

    def _turn(
        self,
        alert: Alert,
        stage: AlertStage,
        now_ns: int,
        *,
        by: NodeId | None = None,
        words: str | None = None,
        assigned_to: NodeId | None = None,
    ) -> list[Alert]:
        turned = msgspec.structs.replace(
            alert,
            event_time_ns=now_ns,
            stage=stage,
            by=by,
            words=alert.words if words is None else words[:MOST_WORDS],
            assigned_to=assigned_to or alert.assigned_to,
        )
        self._alerts[alert.number] = turned
        if stage == "resolved":
            about = next(about for about, number in self._open.items() if number == alert.number)
            del self._open[about]
            if by is not None:
                self._settled[about] = alert.words
        return [turned]

    def _forget(self) -> None:
        if len(self._alerts) <= MOST_ALERTS:
            return
        oldest = next((one for one in self._alerts.values() if one.stage == "resolved"), None)
        if oldest is not None:
            del self._alerts[oldest.number]
