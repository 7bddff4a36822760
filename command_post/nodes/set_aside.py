"""What could not be handled for a fault of the post's own, counted and told by node (pure)."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from hashlib import blake2b
from typing import Any, NamedTuple, Protocol

from command_post.fusion.mishaps import GotOver, Mishap, Mishaps
from command_post.fusion.time_line import Event
from command_post.nodes.notices import Notices
from command_post.nodes.senders import Node
from shared.topics import Key
from shared.units import NS_PER_S

TOLD_NS = 600 * NS_PER_S
"""So long is it said of a node that something of it could not be handled."""

MOST_NODES = 4096
MOST_WORDS = 120


class Attendant(Protocol):
    """Somebody who knows what is being handled, should the process end amid that."""

    def begin(self, what: str) -> None:
        """Take in that ``what`` is handled from now on."""

    def end(self) -> None:
        """Take in that it is done, whether it was survived or done."""


class _Unattended:
    def begin(self, what: str) -> None:
        pass

    def end(self) -> None:
        pass


class _Handling:
    """Gets over exceptions of what is done within, which ``what`` names to who attends.

    ``what`` is empty within what is attended already. One is made for every message, so that what
    there would be to note is put together only if there is.
    """

    __slots__ = ("_attendant", "_mishaps", "_node", "_told", "_what")

    def __init__(
        self, mishaps: Mishaps, node: Node, told: tuple[str, ...], attendant: Attendant, what: str
    ) -> None:
        self._mishaps = mishaps
        self._node = node
        self._told = told
        self._attendant = attendant
        self._what = what

    def __enter__(self) -> None:
        if self._what:
            self._attendant.begin(self._what)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: object
    ) -> bool:
        is_over = error is None or GotOver(self._note).__exit__(kind, error, trace)
        if is_over and self._what:
            self._attendant.end()
        return is_over

    def _note(self, error: Exception) -> None:
        self._mishaps.note(error, ", ".join(self._told), *self._node)


class _Aside(NamedTuple):
    times: int
    last_ns: int
    words: str


class SetAside:
    """Keeps of each node how often something of it was put aside, and why it was the last time."""

    def __init__(self, notices: Notices, post: Node) -> None:
        """What cannot be laid to any node is the ``post``'s own."""
        self._notices = notices
        self._post = post
        self._mishaps = Mishaps()
        self._elsewhere: list[Mishap] = []
        self._of: dict[Node, _Aside] = {}
        self._attendant: Attendant = _Unattended()
        self._fatal: frozenset[str] = frozenset()

    def __getstate__(self) -> dict[str, Any]:
        """Return all that is to be kept: who attends belongs to a process."""
        return {**self.__dict__, "_attendant": _Unattended()}

    def attended(self, by: Attendant | None, fatal: Collection[str]) -> None:
        """Have somebody attend; what is ``fatal`` is put aside from now on, unhandled."""
        self._attendant = by or _Unattended()
        self._fatal = frozenset(fatal)

    def takes(self, key: Key, what: str) -> bool:
        """Say whether ``what`` was said under ``key`` is to be handled, and note it if not."""
        if what not in self._fatal:
            return True
        words = f"{key.topic}: the post ended at it, more than once"
        self._mishaps.put_aside(words, key.role, key.node_id, "Fatal")
        return False

    def survived(self, key: Key, doing: str, what: str = "") -> _Handling:
        """Break off what is done within with a message under ``key``, at an exception.

        ``what`` names it to who attends; within what is attended already, nothing does.
        """
        node, told = (key.role, key.node_id), (key.topic, doing)
        return _Handling(self._mishaps, node, told, self._attendant, what)

    def passing(self, doing: str) -> _Handling:
        """Break off at an exception what is done within, which no message is about."""
        return _Handling(self._mishaps, self._post, (doing,), self._attendant, doing)

    def take(self, mishaps: Iterable[Mishap]) -> None:
        """Take in what came up elsewhere, and was got over there."""
        self._elsewhere += mishaps

    def tell(self, now_ns: int) -> None:
        """Count and tell what came up by ``now_ns``."""
        if not (self._mishaps or self._elsewhere):
            return
        mishaps, self._elsewhere = [*self._mishaps.take(), *self._elsewhere], []
        for each in mishaps:
            node = self._post if each.role is None else (each.role, each.node_id)
            self._notices.put_aside(f"failed_{each.error}", node[1], each.words, each.trace)
            before = self._of.get(node)
            if before is not None or len(self._of) < MOST_NODES:
                times = 1 + (0 if before is None else before.times)
                self._of[node] = _Aside(times, now_ns, each.words[:MOST_WORDS])

    def faults(self, node: Node, now_ns: int) -> list[str]:
        """Return in words what of a node was put aside of late."""
        aside = self._of.get(node)
        if aside is None or now_ns - aside.last_ns > TOLD_NS:
            return []
        return [f"put aside {aside.times} times for a fault of the post ({aside.words})"]

    def remarks(self, now_ns: int) -> list[str]:
        """Return in words what was put aside of late that is neither a responder's nor a DAP's."""
        return [
            f"{node[1]}: {words}"
            for node in self._of
            if node[0] == "post"
            for words in self.faults(node, now_ns)
        ]


def heard(key: str, payload: bytes) -> str:
    """Name what was heard, among all that is handled."""
    return f"hearing {key} {blake2b(payload, digest_size=8).hexdigest()}"


def fused(event: Event) -> str:
    """Name what is fused, among all that is handled."""
    said = event.message
    return f"fusing {event.key} {said.sequence} {said.event_time_ns}"
