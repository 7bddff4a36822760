"""An inbox that many may write into, where nobody's flood is at another's cost.

Each sender has a queue of its own, and they are emptied in turn. What room there is, in messages
and in bytes, is shared by a rule that needs no list of senders: nobody may hold more than is left
free ("Dynamic queue length thresholds for shared-memory packet switches", Choudhury and Hahne,
1998). One that floods so gets half at most, two a third each, and there is room for who comes next.

What is refilled is of then, and may be much: it waits behind all that is said now.
"""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import Generic, Literal, Protocol, TypeAlias, TypeVar

from shared.codec import MAX_PAYLOAD_BYTES
from shared.token_bucket import TokenBucket
from shared.topics import ROLES

Lost: TypeAlias = Literal["crowded_out", "too_long", "slowed"]
"""Why something did not get through the inbox: its sender had sent too much before it, it was too
long itself, or its sender is slowed down."""

UNKNOWN_SENDER = "?"
"""All whose keys name no node of ours: they share one queue."""

MOST_COUNTED = 4096
"""Kinds of losses that are counted one by one; what is lost of further senders is the unknown's."""

MOST_SLOWED = 4096
LONGEST_HEARD_BYTES = 2 * MAX_PAYLOAD_BYTES
"""Longer payloads are not even copied: up to here, what is too large stays to be seen."""

OVERHEAD_BYTES = 300
"""What Python needs for a message, besides its bytes."""

SLOWED_PER_S = 100.0
SLOWED_FOR_S = 10.0
LONGEST_NAME = 32


class Message(Protocol):
    """What has a key and bytes."""

    @property
    def key(self) -> str:
        """The key it came under."""

    @property
    def payload(self) -> bytes:
        """Its bytes."""


T = TypeVar("T", bound=Message)


def sender_of(key: str) -> str:
    """Return who sends under ``key``, as ``role/id``; ``UNKNOWN_SENDER`` if it does not say."""
    chunks = key.split("/", 6)
    if len(chunks) < 5 or chunks[3] not in ROLES or not 0 < len(chunks[4]) <= LONGEST_NAME:
        return UNKNOWN_SENDER
    return f"{chunks[3]}/{chunks[4]}"


class FairInbox(Generic[T]):
    """A bounded place between threads, whose ``put`` is a fit handler: it never blocks.

    Ask ``wanted`` before it, ere the bytes are copied.

    The order of one sender's messages is kept, apart from what is refilled. What finds no room
    displaces the oldest of its own sender: whoever has fallen behind should see what is going on
    now.
    """

    def __init__(
        self,
        max_messages: int,
        max_bytes: int,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """``max_messages``, ``max_bytes``: of all senders together."""
        if max_messages < 2 or max_bytes < 2:
            raise ValueError("an inbox needs room for two messages at least")
        self._free_messages = max_messages
        self._free_bytes = max_bytes
        self._monotonic_s = monotonic_s
        self._live = _Line[T]()
        self._refilled = _Line[T]()
        self._slowed: dict[str, _Slowed] = {}
        self._lost: Counter[tuple[Lost, str]] = Counter()
        self._filled = threading.Condition()

    def __len__(self) -> int:
        return self._live.count + self._refilled.count

    def refilled_of(self, sender: str) -> int:
        """Return how many messages of a sender wait that were refilled."""
        with self._filled:
            queue = self._refilled.queues.get(sender)
            return 0 if queue is None else len(queue.messages)

    def lost(self) -> Counter[tuple[Lost, str]]:
        """Return how much did not get through, by reason and sender."""
        with self._filled:
            return self._lost.copy()

    def queued(self) -> dict[str, int]:
        """Return how many messages of each sender wait, of those that have any."""
        with self._filled:
            waiting = Counter[str]()
            for queue in (*self._live.turns, *self._refilled.turns):
                waiting[queue.sender] += len(queue.messages)
            return dict(waiting)

    def put(self, message: T, *, refilled: bool = False) -> None:
        """Add ``message``, at the cost of its own sender if there is no room."""
        sender = sender_of(message.key)
        size = _size(message)
        line = self._refilled if refilled else self._live
        with self._filled:
            queue = line.queues.get(sender) or _Queue[T](sender)
            while queue.messages and not self._has_room(queue, size):
                self._release(line, queue)
                self._lose("crowded_out", sender)
            if self._has_room(queue, size):
                self._append(line, queue, message, size)
                self._filled.notify()
                return
            self._lose("crowded_out", sender)
            if sender in line.queues:
                del line.queues[sender]
                line.turns.remove(queue)

    def wanted(self, key: str, length: int) -> bool:
        """Say whether a message of ``length`` bytes is to be put in; where not, it is counted.

        Not what is longer than ``LONGEST_HEARD_BYTES``, nor what a sender who is slowed down sends.
        """
        if length <= LONGEST_HEARD_BYTES and not self._slowed:
            return True
        sender = sender_of(key)
        with self._filled:
            why: Lost | None = None
            if length > LONGEST_HEARD_BYTES:
                why = "too_long"
            elif not self._may_pass(sender):
                why = "slowed"
            if why is not None:
                self._lose(why, sender)
            return why is None

    def slow_down(self, sender: str) -> None:
        """Let ``sender`` put in 100 messages a second at most, for the next ten seconds.

        For one who sends what is of no use: looking at it all would take the time of the others.
        """
        with self._filled:
            now_s = self._monotonic_s()
            known = self._slowed.get(sender)
            if known is not None:
                known.until_s = now_s + SLOWED_FOR_S
            elif len(self._slowed) < MOST_SLOWED:
                self._slowed[sender] = _Slowed(now_s)

    def get_some(self, most: int, timeout_s: float = 0.0) -> list[T]:
        """Take out ``most`` messages or fewer, of each sender in turn, and one that was refilled.

        So what is said now waits for no more than one of these, and these wait for nobody's flood
        to end. Waits ``timeout_s`` at most for the first.
        """
        with self._filled:
            self._filled.wait_for(lambda: len(self), timeout_s)
            live = [self._next(self._live) for _ in range(min(most, self._live.count))]
            return [*live, self._next(self._refilled)] if self._refilled.count else live

    def _next(self, line: _Line[T]) -> T:
        queue = line.turns.popleft()
        message = self._release(line, queue)
        if queue.messages:
            line.turns.append(queue)
        else:
            del line.queues[queue.sender]
        return message

    def _has_room(self, queue: _Queue[T], size: int) -> bool:
        enough_bytes = queue.bytes + size <= self._free_bytes
        return enough_bytes and len(queue.messages) < self._free_messages

    def _append(self, line: _Line[T], queue: _Queue[T], message: T, size: int) -> None:
        if queue.sender not in line.queues:
            line.queues[queue.sender] = queue
            line.turns.append(queue)
        queue.messages.append(message)
        queue.bytes += size
        self._free_bytes -= size
        self._free_messages -= 1
        line.count += 1

    def _release(self, line: _Line[T], queue: _Queue[T]) -> T:
        message = queue.messages.popleft()
        size = _size(message)
        queue.bytes -= size
        self._free_bytes += size
        self._free_messages += 1
        line.count -= 1
        return message

    def _may_pass(self, sender: str) -> bool:
        slowed = self._slowed.get(sender)
        if slowed is None:
            return True
        now_s = self._monotonic_s()
        if now_s > slowed.until_s:
            del self._slowed[sender]
            return True
        return slowed.bucket.take(1.0, now_s)

    def _lose(self, why: Lost, sender: str) -> None:
        kind = (why, sender)
        if kind not in self._lost and len(self._lost) >= MOST_COUNTED:
            kind = (why, UNKNOWN_SENDER)
        self._lost[kind] += 1


class _Queue(Generic[T]):
    """What one sender has put in."""

    def __init__(self, sender: str) -> None:
        self.sender = sender
        self.messages: deque[T] = deque()
        self.bytes = 0


class _Line(Generic[T]):
    """Queues that are emptied in turn: those in ``turns``, each once, are not empty."""

    def __init__(self) -> None:
        self.queues: dict[str, _Queue[T]] = {}
        self.turns: deque[_Queue[T]] = deque()
        self.count = 0


class _Slowed:
    """A sender that is slowed down, and until when."""

    def __init__(self, now_s: float) -> None:
        self.until_s = now_s + SLOWED_FOR_S
        self.bucket = TokenBucket(SLOWED_PER_S, SLOWED_PER_S, now_s)


def _size(message: Message) -> int:
    return len(message.key) + len(message.payload) + OVERHEAD_BYTES
