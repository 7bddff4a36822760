"""When what the nodes say happened on the post's clock, whatever their own clocks read (pure)."""

from __future__ import annotations

from typing import NamedTuple

from command_post.fusion.time_line import Event
from command_post.nodes.senders import Node, Senders
from shared.messages import DapInstallation, Message
from shared.seal import Seal
from shared.topics import Key

PATIENCE_NS = 1_200_000_000
"""A node beats every half second, and knows how far its clock is off by its second beat."""

MOST_WAITING = 1000
"""Of one node; what comes beyond is dated as well as it can be."""


class _Undated(NamedTuple):
    """An event, and in what seal it came."""

    event: Event
    seal: Seal | None


class Dating:
    """Dates events by what ``senders`` tells of their nodes' clocks.

    A node that seals what it says will soon state how far its clock is off: what comes before that
    waits for it, ``PATIENCE_NS`` at most since the node was first heard. ``moved_in_time`` counts
    the events that were moved.
    """

    def __init__(self, senders: Senders) -> None:
        self._senders = senders
        self._undated: dict[str, _Undated] = {}
        """Installations that may be old, of DAPs whose clock is not known yet."""

        self._heard_first_ns: dict[Node, int] = {}
        self._waiting: dict[Node, list[_Undated]] = {}
        """What came of nodes that have not stated how far their clock is off."""

        self._installed: dict[str, tuple[int, int]] = {}
        """When each DAP was installed, on the post's clock and on its own."""

        self.moved_in_time = 0

    def date(
        self, key: Key, message: Message, now_ns: int, seal: Seal | None = None
    ) -> list[Event]:
        """Take in what is to be fused; return the events that can be dated now."""
        node = (key.role, key.node_id)
        undated = _Undated(Event(key, message, message.event_time_ns), seal)
        if seal is not None and self._may_state_soon(node, now_ns):
            waiting = self._waiting.setdefault(node, [])
            if len(waiting) < MOST_WAITING:
                waiting.append(undated)
                return []
        return self._date_or_keep(undated, now_ns)

    def dated_by_now(self, key: Key, now_ns: int) -> list[Event]:
        """Return what was kept and can be dated by now, a message under ``key`` being heard."""
        self._heard_first_ns.setdefault((key.role, key.node_id), now_ns)
        dated = []
        for node in [node for node in self._waiting if not self._may_state_soon(node, now_ns)]:
            for undated in self._waiting.pop(node):
                dated += self._date_or_keep(undated, now_ns)
        if key.node_id in self._undated and self._senders.knows_clock("dap", key.node_id):
            dated.append(self._dated(self._undated.pop(key.node_id)))
        return dated

    def rest(self) -> list[Event]:
        """Return all that was kept: no more will be heard."""
        waiting = [undated for node in tuple(self._waiting) for undated in self._waiting.pop(node)]
        kept = [self._undated.pop(dap_id) for dap_id in tuple(self._undated)]
        return [self._dated(undated) for undated in waiting + kept]

    def redate(self, event: Event) -> None:
        """Note when a DAP is held to have been installed, other than it said."""
        self._installed[event.key.node_id] = (event.time_ns, event.message.event_time_ns)

    def said_ns(self, dap_id: str, installed_ns: int) -> int:
        """Return when, on its own clock, a DAP was installed that was so at ``installed_ns``."""
        dated_ns, said_ns = self._installed.get(dap_id, (installed_ns, installed_ns))
        return said_ns if dated_ns == installed_ns else installed_ns

    def _may_state_soon(self, node: Node, now_ns: int) -> bool:
        first_ns = self._heard_first_ns.setdefault(node, now_ns)
        waits = now_ns - first_ns < PATIENCE_NS
        return waits and not self._senders.states_clock(*node)

    def _date_or_keep(self, undated: _Undated, now_ns: int) -> list[Event]:
        """Return the event dated, or nothing.

        A DAP that seems to have been set down long ago, and does not say where, is kept until it
        says something that happens now: if its clock is behind, it must not be put where its
        installer was then.
        """
        key, message, _ = undated.event
        asks_where = isinstance(message, DapInstallation) and message.position is None
        known = self._senders.knows_clock(key.role, key.node_id)
        if asks_where and not known and self._senders.seems_old(message, now_ns):
            self._undated[key.node_id] = undated
            return []
        return [self._dated(undated)]

    def _dated(self, undated: _Undated) -> Event:
        (key, message, said_ns), seal = undated
        time_ns = self._senders.time_ns(key.role, key.node_id, said_ns, seal)
        if isinstance(message, DapInstallation):
            known = self._installed.get(key.node_id)
            # What a DAP says again of itself must not seem to be news.
            if known is None or known[1] != said_ns:
                known = self._installed[key.node_id] = (time_ns, said_ns)
            time_ns = known[0]
        if time_ns == said_ns:
            return undated.event
        self.moved_in_time += 1
        return undated.event._replace(time_ns=time_ns)
