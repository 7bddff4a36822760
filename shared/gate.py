"""The gate: who may come in, and each but once (pure).

What is heard passes here before anybody acts on it: at the post before it is recorded and fused,
at an agent before an order is heeded. Whoever refills what was missed asks here what is missing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Literal, NamedTuple, Protocol, TypeAlias

from shared.codec import MAX_PAYLOAD_BYTES, Refusal, decode, parse_key
from shared.messages import Beat
from shared.received_numbers import Hole, ReceivedNumbers
from shared.seal import Seal, read_seal
from shared.topics import TOPICS, Key, Role
from shared.units import NS_PER_S

MOST_RUNS = 16_384
"""Runs that are remembered, of all nodes together."""

MOST_RUNS_OF_A_NODE = 256
"""Journals that a node may have had: who makes up runs is not to take the room of all others."""

MOST_LIVE_RUNS = 1024
"""Runs of one key that are remembered, where nothing is journalled: each order is a process's."""

TWINS_APART_NS = 10 * NS_PER_S
"""By so much the clocks of two by one name may differ who are heard in turns."""

TOLD_LATER = frozenset({"dap_place"})
"""What is not dated by when it is said, but by when it came to be so."""

MOST_TURNED = 16_384
"""Reasons and nodes that are counted apart; what is beyond counts under ``UNNAMED``."""

UNNAMED = "?"

Turned: TypeAlias = Literal[
    "repeated", "replayed", "unsealed", "unsigned", "unknown_signer", "forged", "too_many_runs",
    "expired", "not_yet_valid", "withdrawn",
]  # fmt: skip
"""Why something did not come in.

``repeated`` came before, as refilled messages may; ``replayed`` is older than what its sender has
said since; ``unknown_signer`` may be known later, and is then refilled. ``expired`` and
``not_yet_valid`` is the signer's certificate, ``withdrawn`` its key.
"""


class Verifier(Protocol):
    """Knows the nodes' keys."""

    def verdict(self, key: Key, key_text: str, seal: Seal, /) -> Turned | None:
        """Say why ``seal`` does not show that the node of ``key`` said it; ``None`` if it does."""


class JournalRun(NamedTuple):
    """A journal's run of numbers: whose, and which."""

    role: Role
    node_id: str
    run: bytes


class Missing(NamedTuple):
    """What has not come of a journal, and is kept there: a hole; ``in_all`` are missing."""

    journal: JournalRun
    hole: Hole
    in_all: int


class Remembered(NamedTuple):
    """What a gate knows of what has come."""

    journals: dict[JournalRun, ReceivedNumbers]
    live: dict[str, LiveRuns]
    gone: Counter[JournalRun]


def numbering(key_text: str, payload: bytes) -> tuple[JournalRun, int] | None:
    """Return of which journal a message is, and its number there; ``None`` if of none."""
    key = parse_key(key_text)
    seal = None if isinstance(key, Refusal) else read_seal(payload)
    if isinstance(key, Refusal) or seal is None or not TOPICS[key.topic].journalled:
        return None
    return JournalRun(key.role, key.node_id, seal.run), seal.number


class Gate:
    """Lets each message in once. ``turned`` counts what was not, by reason and node.

    Without a ``verifier`` anybody is believed, and what has no seal at all is let in as it comes:
    that is for one machine. With one, all must be sealed and signed.

    What ``parse_key`` refuses is none of the gate's business: it is let in, to be refused where it
    is counted as what it is.
    """

    def __init__(self, verifier: Verifier | None = None) -> None:
        self._verifier = verifier
        self._journals: dict[JournalRun, ReceivedNumbers] = {}
        self._live: dict[str, LiveRuns] = {}
        self._runs_of = Counter[tuple[Role, str]]()
        """How many runs of each node are in ``_journals``."""

        self.turned: Counter[tuple[Turned, str]] = Counter()
        self.gone: Counter[JournalRun] = Counter()
        """How many messages of a journal are known to be lost for good."""

    def admit(self, key_text: str, payload: bytes) -> Turned | None:
        """Take in bytes heard under ``key_text``; return why they are turned away, if so."""
        key = parse_key(key_text)
        if isinstance(key, Refusal) or len(payload) > MAX_PAYLOAD_BYTES:
            return None
        return self._counted(key, self._judge(key, key_text, payload))

    def _counted(self, key: Key, why: Turned | None) -> Turned | None:
        if why is not None:
            kind = (why, key.node_id)
            full = len(self.turned) >= MOST_TURNED and kind not in self.turned
            self.turned[(why, UNNAMED) if full else kind] += 1
        return why

    def doubt(self, key_text: str, payload: bytes) -> Turned | None:
        """Return why it is not believed who says these bytes; when, and how often, is not asked.

        For what tells by itself when it was said.
        """
        key = parse_key(key_text)
        if isinstance(key, Refusal):
            return None
        why = self._disbelieved(key, key_text, read_seal(payload))
        return self._counted(key, why)

    def remembered(self) -> Remembered:
        """Return what it knows, which goes on changing: for another that is to know the same."""
        return Remembered(self._journals, self._live, self.gone)

    def remember(self, remembered: Remembered) -> None:
        """Know what another knew, and nothing else."""
        self._journals, self._live, self.gone = remembered
        self._runs_of = Counter((run.role, run.node_id) for run in self._journals)

    def recall(self, key_text: str, payload: bytes) -> None:
        """Take in once more what was let in before, as a record of it says."""
        key = parse_key(key_text)
        seal = read_seal(payload)
        if not isinstance(key, Refusal) and seal is not None:
            self._take(key, key_text, payload, seal)

    def forget(self, journal: JournalRun, holes: Sequence[Hole]) -> None:
        """Have come again what was let in and then lost."""
        numbers = self._journals.get(journal)
        if numbers is not None:
            for hole in holes:
                numbers.forget(hole)

    def journal(self, journal: JournalRun) -> ReceivedNumbers | None:
        """Return what has come of a journal; ``None`` if nothing is known of it."""
        return self._journals.get(journal)

    def journals(self) -> Iterator[tuple[JournalRun, ReceivedNumbers]]:
        """Yield each journal heard of, and what has come of it."""
        yield from self._journals.items()

    def missing(self, behind: Mapping[JournalRun, int] | None = None) -> list[Missing]:
        """Return a hole of every journal that has one: the lowest.

        Of a journal with a number in ``behind`` it is the lowest above that, if there is one.
        """
        found = []
        for journal, numbers in self._journals.items():
            hole = numbers.hole_behind(0 if behind is None else behind.get(journal, 0))
            hole = hole or numbers.hole_behind(0)
            if hole is not None:
                found.append(Missing(journal, hole, numbers.missing))
        return found

    def _judge(self, key: Key, key_text: str, payload: bytes) -> Turned | None:
        seal = read_seal(payload)
        why = self._disbelieved(key, key_text, seal)
        return why if seal is None or why is not None else self._take(key, key_text, payload, seal)

    def _disbelieved(self, key: Key, key_text: str, seal: Seal | None) -> Turned | None:
        if self._verifier is None:
            return None
        if seal is None:
            return "unsealed"
        return "unsigned" if seal.signature is None else self._verifier.verdict(key, key_text, seal)

    def _take(self, key: Key, key_text: str, payload: bytes, seal: Seal) -> Turned | None:
        if TOPICS[key.topic].journalled:
            return self._take_journalled(key, seal)
        if key_text not in self._live and len(self._live) >= MOST_RUNS:
            return "too_many_runs"
        runs = self._live.setdefault(key_text, LiveRuns())
        why = runs.take(seal, lambda: _said_ns(key, payload, runs.since_ns))
        if why is None and key.topic == "beat":
            self._heed(key, payload)
        return why

    def _take_journalled(self, key: Key, seal: Seal) -> Turned | None:
        numbers = self._numbers(JournalRun(key.role, key.node_id, seal.run))
        if numbers is None:
            return "too_many_runs"
        return None if numbers.take(seal.number) else "repeated"

    def _heed(self, key: Key, payload: bytes) -> None:
        beat = decode(key, payload)
        if isinstance(beat, Beat):
            journal = JournalRun(key.role, key.node_id, bytes.fromhex(beat.run))
            numbers = self._numbers(journal)
            if numbers is not None:
                self.gone[journal] += numbers.heed(beat.kept_from, beat.last_number, beat.lost)

    def _numbers(self, journal: JournalRun) -> ReceivedNumbers | None:
        node = (journal.role, journal.node_id)
        numbers = self._journals.get(journal)
        has_room = len(self._journals) < MOST_RUNS and self._runs_of[node] < MOST_RUNS_OF_A_NODE
        if numbers is None and has_room:
            numbers = self._journals[journal] = ReceivedNumbers()
            self._runs_of[node] += 1
        return numbers


class LiveRuns:
    """What is kept nowhere: within each run its numbers rise.

    Two who go by one name, by mistake, speak in turns. So a run that another came after is gone on
    with by what is newer: who of them stays is heard. But only by what is said since, as it is
    dated itself: who hands messages on can keep the last ones of a process that has ended, and say
    them once another speaks in its place.
    """

    def __init__(self, numbers: Iterable[tuple[bytes, int]] = (), since_ns: int = 0) -> None:
        self._numbers = dict(numbers)
        self._speaking = next(reversed(self._numbers), None)
        self.since_ns = since_ns
        """When the run that speaks began to, or went on, as it dates it."""

    @property
    def numbers(self) -> list[tuple[bytes, int]]:
        """The newest number of each run, those that were heard last at the end."""
        return list(self._numbers.items())

    def take(self, seal: Seal, said_ns: Callable[[], int]) -> Turned | None:
        """Take a number, said when ``said_ns`` tells; return why it is turned away, if it is."""
        newest = self._numbers.get(seal.run, 0)
        if seal.number <= newest:
            return "repeated" if seal.number == newest else "replayed"
        if seal.run != self._speaking:
            begins_ns = said_ns()
            if newest and begins_ns < self.since_ns - TWINS_APART_NS:
                return "replayed"
            # A unit's clock may be set back between two of its processes.
            self.since_ns = max(begins_ns, self.since_ns) if newest else begins_ns
            self._speaking = seal.run
        self._numbers.pop(seal.run, None)
        self._numbers[seal.run] = seal.number
        if len(self._numbers) > MOST_LIVE_RUNS:
            del self._numbers[next(iter(self._numbers))]
        return None


def _said_ns(key: Key, payload: bytes, unknown_ns: int) -> int:
    """Return when a message was said, by its sender's clock; ``unknown_ns`` if it does not tell."""
    message = decode(key, payload)
    if isinstance(message, Refusal) or key.topic in TOLD_LATER:
        return unknown_ns
    return message.event_time_ns
