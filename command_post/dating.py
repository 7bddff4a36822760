"""When what the nodes say happened on the post's clock, whatever their own clocks read (pure)."""

from __future__ import annotations

from command_post.fusion.time_line import Event
from command_post.senders import Senders
from shared.messages import DapInstallation, Message
from shared.topics import Key


class Dating:
    """Dates events by what ``senders`` tells of their nodes' clocks.

    ``moved_in_time`` counts those that were moved.
    """

    def __init__(self, senders: Senders) -> None:
        self._senders = senders
        self._undated: dict[str, Event] = {}
        """Installations that may be old, of DAPs whose clock is not known yet."""

        self._installed: dict[str, tuple[int, int]] = {}
        """When each DAP was installed, on the post's clock and on its own."""

        self.moved_in_time = 0

    def date(self, key: Key, message: Message, now_ns: int) -> list[Event]:
        """Take in what is to be fused; return the events that can be dated now.

        A DAP that seems to have been set down long ago, and does not say where, is kept until it
        says something that happens now: if its clock is behind, it must not be put where its
        installer was then.
        """
        asks_where = isinstance(message, DapInstallation) and message.position is None
        known = self._senders.knows_clock(key.role, key.node_id)
        event = Event(key, message, message.event_time_ns)
        if asks_where and not known and self._senders.seems_old(message, now_ns):
            self._undated[key.node_id] = event
            return []
        return [self._dated(event)]

    def dated_by_now(self, key: Key) -> list[Event]:
        """Return what was kept of a node whose clock is known by now."""
        if key.node_id not in self._undated or not self._senders.knows_clock("dap", key.node_id):
            return []
        return [self._dated(self._undated.pop(key.node_id))]

    def rest(self) -> list[Event]:
        """Return all that was kept: no more will be heard."""
        return [self._dated(self._undated.pop(dap_id)) for dap_id in tuple(self._undated)]

    def said_ns(self, dap_id: str, installed_ns: int) -> int:
        """Return when, on its own clock, a DAP was installed that was so at ``installed_ns``."""
        dated_ns, said_ns = self._installed.get(dap_id, (installed_ns, installed_ns))
        return said_ns if dated_ns == installed_ns else installed_ns

    def _dated(self, event: Event) -> Event:
        key, message, said_ns = event
        time_ns = self._senders.time_ns(key.role, key.node_id, said_ns)
        if isinstance(message, DapInstallation):
            known = self._installed.get(key.node_id)
            # What a DAP says again of itself must not seem to be news.
            if known is None or known[1] != said_ns:
                known = self._installed[key.node_id] = (time_ns, said_ns)
            time_ns = known[0]
        self.moved_in_time += time_ns != said_ns
        return event._replace(time_ns=time_ns)
