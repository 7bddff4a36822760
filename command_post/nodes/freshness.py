"""How fresh what is known of each node is (pure): computed from what was heard, never guessed.

As a subscriber's freshness is in vehicles: alive, how often against how often expected, last
heard, what is missing. The words are for a commander, and there are none where all is well.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple, TypeAlias

from shared.codec import Refusal, decode, parse_key
from shared.gate import Gate
from shared.messages import Beat
from shared.seal import Seal, read_seal
from shared.topics import ROLES, TOPICS, Key, Role
from shared.units import NS_PER_S

Node: TypeAlias = tuple[Role, str]

WINDOW_NS = 10 * NS_PER_S
"""Rates and losses are of the last one to two of these."""

SILENT_S = 5.0
"""A node beats twice a second: silence for longer is worth a word."""

LOSS_TOLD = 0.05
FEWEST_COUNTED = 8
"""A share is told of so many messages or more."""

FEWEST_USELESS = 20
"""Fewer are not worth a word."""

MOST_NODES = 4096


class Freshness(NamedTuple):
    """What is known of one node at a moment.

    ``alive``: it holds a liveliness token. ``heard_age_s`` is ``None`` for never. ``rates_hz`` are
    the messages a second, by topic, of late; ``loss`` the share that did not come of what is only
    said once. Of what its journal holds, ``behind`` messages are known of and not here yet,
    ``gone`` lost for good, and ``unacknowledged`` still only there (``None``: it has no journal).
    ``clock_offset_s`` is how far the post's clock is ahead of the node's, as the node says.
    ``useless`` counts what it sent that was refused, turned away or not even heard.
    """

    role: Role
    node_id: str
    alive: bool
    heard_age_s: float | None
    rates_hz: Mapping[str, float]
    loss: float | None
    behind: int
    gone: int
    unacknowledged: int | None
    clock_offset_s: float | None
    clock_uncertainty_s: float | None
    useless: int

    @property
    def silence(self) -> str | None:
        """That it is not heard, in words."""
        if self.heard_age_s is None:
            return "never heard"
        return f"not heard for {self.heard_age_s:.0f} s" if self.heard_age_s > SILENT_S else None

    @property
    def words(self) -> tuple[str, ...]:
        """What else is to be told of it."""
        return tuple(self._words())

    def _words(self) -> Iterator[str]:
        if self.behind:
            refills = self.alive and self.silence is None
            yield f"{_messages(self.behind)} behind" + (", refilling" if refills else "")
        if self.gone:
            yield f"{_messages(self.gone)} lost for good"
        if self.loss is not None and self.loss > LOSS_TOLD:
            yield f"link loses {self.loss:.0%}"
        if self.useless >= FEWEST_USELESS:
            yield f"{self.useless} useless messages"


def _messages(count: int) -> str:
    return "1 message" if count == 1 else f"{count} messages"


class NodeWatch:
    """Takes in all that is let in, and tells how fresh each node is."""

    def __init__(self) -> None:
        self._nodes: dict[Node, _Node] = {}

    def hear(self, key_text: str, payload: bytes, now_ns: int) -> None:
        """Take in bytes that were let in at ``now_ns`` of the post's clock."""
        key = parse_key(key_text)
        if isinstance(key, Refusal):
            return
        node = self._nodes.get((key.role, key.node_id))
        if node is None:
            if len(self._nodes) >= MOST_NODES:
                return
            node = self._nodes[key.role, key.node_id] = _Node()
        node.hear(key, payload, now_ns)

    def fresh(
        self, now_ns: int, alive: Collection[Node], gate: Gate, useless: Mapping[str, int]
    ) -> tuple[Freshness, ...]:
        """Return the freshness of every node heard of at ``now_ns``, by role and id.

        ``alive`` names those that hold a liveliness token, ``useless`` counts by ``role/id``.
        """
        behind, gone = Counter[Node](), Counter[Node]()
        for journal, numbers in gate.journals():
            node = (journal.role, journal.node_id)
            behind[node] += numbers.missing
            gone[node] += gate.gone.get(journal, 0)
        return tuple(
            self._nodes.get(node, _NEVER_HEARD).freshness(
                node, now_ns, node in alive, behind[node], gone[node], useless
            )
            for node in sorted({*self._nodes, *alive, *behind, *_named(useless)})
        )


class _Node:
    """What was heard of one node."""

    def __init__(self) -> None:
        self._heard_ns: int | None = None
        self._counts: dict[str, _Recently] = {}
        self._once = _SaidOnce()
        self._beat: Beat | None = None

    def hear(self, key: Key, payload: bytes, now_ns: int) -> None:
        """Count a message that came just now; a beat is kept."""
        self._heard_ns = now_ns
        self._counts.setdefault(key.topic, _Recently()).add(now_ns)
        seal = read_seal(payload)
        if seal is not None and not TOPICS[key.topic].journalled:
            self._once.hear(seal, now_ns)
        if key.topic == "beat":
            message = decode(key, payload)
            self._beat = message if isinstance(message, Beat) else self._beat

    def freshness(
        self,
        node: Node,
        now_ns: int,
        alive: bool,
        behind: int,
        gone: int,
        useless: Mapping[str, int],
    ) -> Freshness:
        """Return how fresh what is known of it is; see ``Freshness`` for the words."""
        role, node_id = node
        beat = self._beat
        clock = None if beat is None else beat.clock
        heard_ns = self._heard_ns
        return Freshness(
            role=role,
            node_id=node_id,
            alive=alive,
            heard_age_s=None if heard_ns is None else max(now_ns - heard_ns, 0) / NS_PER_S,
            rates_hz={topic: count.rate_hz(now_ns) for topic, count in self._counts.items()},
            loss=self._once.loss(now_ns),
            behind=behind,
            gone=gone,
            unacknowledged=None if beat is None else max(beat.last_number - beat.acknowledged, 0),
            clock_offset_s=None if clock is None else clock.offset_ns / NS_PER_S,
            clock_uncertainty_s=None if clock is None else clock.uncertainty_ns / NS_PER_S,
            useless=useless.get(f"{role}/{node_id}", 0),
        )


class _Recently:
    """How many there were of late: in the window that runs, and in the one before it."""

    def __init__(self) -> None:
        self._window = 0
        self._now = 0
        self._before = 0

    def add(self, now_ns: int, count: int = 1) -> None:
        """Count what came at ``now_ns``."""
        self._turn(now_ns)
        self._now += count

    def of_late(self, now_ns: int) -> int:
        """Return how many came in both windows."""
        self._turn(now_ns)
        return self._now + self._before

    def rate_hz(self, now_ns: int) -> float:
        """Return how many come a second."""
        return self.of_late(now_ns) * NS_PER_S / (WINDOW_NS + now_ns % WINDOW_NS)

    def _turn(self, now_ns: int) -> None:
        window = now_ns // WINDOW_NS
        if window != self._window:
            # A clock that is set back, or far ahead, begins anew.
            self._before = self._now if window == self._window + 1 else 0
            self._now = 0
            self._window = window


class _SaidOnce:
    """What share is missing of what is only said once: its numbers tell."""

    def __init__(self) -> None:
        self._run = b""
        self._number = 0
        self._come = _Recently()
        self._missed = _Recently()

    def hear(self, seal: Seal, now_ns: int) -> None:
        """Count a number that came, and those it leaves out."""
        if seal.run != self._run:
            self._run, self._number = seal.run, seal.number - 1
        self._come.add(now_ns)
        # What overtook others was counted as a gap: they make up for it as they come.
        self._missed.add(now_ns, max(seal.number - self._number - 1, 0))
        if seal.number < self._number:
            self._missed.add(now_ns, -1)
        self._number = max(self._number, seal.number)

    def loss(self, now_ns: int) -> float | None:
        come, missed = self._come.of_late(now_ns), max(self._missed.of_late(now_ns), 0)
        return missed / (come + missed) if come + missed >= FEWEST_COUNTED else None


_NEVER_HEARD = _Node()


def _named(useless: Mapping[str, int]) -> Iterator[Node]:
    """Yield the nodes among senders."""
    for sender in useless:
        role_name, _, node_id = sender.partition("/")
        for role in ROLES:
            if role == role_name:
                yield role, node_id
