"""A node with a journal, and somebody who missed what it said: on the memory bus, step by step."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import msgpack
import pytest

from shared.bus.interface import LinkHandler, Received
from shared.bus.memory import MemoryBus, MemoryNetwork
from shared.codec import encode
from shared.collector import Collector
from shared.gate import Gate, JournalRun, Turned
from shared.heartbeat import Heartbeat
from shared.messages import Beat, ClockStatement, OdometryIncrement, Receipt, SafeUpTo
from shared.outbox import JournalledOutbox
from shared.seal import Seal
from shared.sender import Sender, Unkept
from shared.topics import TOPICS, Key, everything_of, journal_key
from tests.heard import message_in
from tests.traffic import increment
from tests.waiting import wait_for

STATEMENT = ClockStatement(post_id="post", offset_ns=7, uncertainty_ns=3, drift=0.0)
RECEIPT = "clew/v1/fire/post/post/receipt"


class Node:
    """A responder's unit that says strides."""

    def __init__(self, network: MemoryNetwork, folder: Path, name: str = "r1") -> None:
        self.name = name
        self.bus = network.connect()
        self.outbox = JournalledOutbox(folder / f"{name}.journal")
        self.sender = Sender(self.bus, "fire", "responder", name, self.outbox)
        self.heartbeat = Heartbeat(
            self.bus, "fire", "responder", name, self.outbox,
            now_ns=lambda: 42, clock_statement=lambda _: STATEMENT,
        )  # fmt: skip
        self.journal = JournalRun("responder", name, self.outbox.holdings()[0].run)

    def say(self, *numbers: int) -> None:
        """Say the strides of these numbers."""
        for number in numbers:
            self.sender.send(increment(number))

    def acknowledged(self) -> int:
        """Up to which number it knows its journal safe."""
        return self.outbox.holdings()[0].acknowledged


class Listener:
    """Lets in what it hears once it listens, and collects what it missed."""

    def __init__(self, network: MemoryNetwork, gate: Gate | None = None) -> None:
        self.gate = gate or Gate()
        self.came: list[Received] = []
        self.turned: list[Turned] = []
        self.bus: MemoryBus = network.connect()
        self.has_room = True
        self.collector = Collector(
            self.bus, "fire", self.gate.missing, self.take, has_room=lambda: self.has_room
        )
        self.bus.subscribe(everything_of("fire"), self.take)

    def take(self, received: Received) -> None:
        """Let a message in, or not."""
        why = self.gate.admit(*received)
        if why is None:
            self.came.append(received)
        else:
            self.turned.append(why)

    def numbers(self) -> list[int]:
        """Return the strides that came in, in the order of their coming."""
        messages = map(message_in, self.came)
        return [m.sequence for m in messages if isinstance(m, OdometryIncrement)]

    def collect(self) -> None:
        """Ask until nothing is missing."""

        def is_complete() -> bool:
            self.collector.collect()
            return not self.gate.missing()

        wait_for(is_complete, "all that was missed")


@pytest.fixture
def network() -> MemoryNetwork:
    return MemoryNetwork()


@pytest.fixture
def node(network: MemoryNetwork, tmp_path: Path) -> Iterator[Node]:
    node = Node(network, tmp_path)
    with node.outbox, node.bus:
        yield node


def test_a_beat_tells_what_the_journal_holds(network: MemoryNetwork, node: Node) -> None:
    listener = Listener(network)
    node.say(0, 1, 2)
    node.heartbeat.beat()
    node.outbox.acknowledge(node.journal.run, 2)
    node.heartbeat.beat()
    first, second = (m for m in map(message_in, listener.came) if isinstance(m, Beat))
    assert first == Beat(
        event_time_ns=42, sequence=0, run=node.journal.run.hex(), last_number=3, kept_from=1,
        acknowledged=0, clock=STATEMENT,
    )  # fmt: skip
    assert (second.sequence, second.acknowledged) == (1, 2)


def test_it_beats_as_soon_as_it_has_a_link_again(
    network: MemoryNetwork, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    linked: list[LinkHandler] = []
    monkeypatch.setattr(MemoryBus, "on_link", lambda _, handler: linked.append(handler))
    monkeypatch.setattr("shared.heartbeat.PERIOD_S", 600.0)
    listener = Listener(network)
    node = Node(network, tmp_path)
    with node.outbox, node.bus, node.heartbeat:
        wait_for(lambda: len(listener.came) == 1, "the first beat")
        for handler in linked:
            handler()
        wait_for(lambda: len(listener.came) == 2, "the beat after the link came")


def test_who_comes_late_gets_all_of_it_once(network: MemoryNetwork, node: Node) -> None:
    node.say(*range(100))
    listener = Listener(network)
    node.say(100, 101)
    node.heartbeat.beat()
    listener.collect()
    assert sorted(listener.numbers()) == list(range(102))
    assert listener.numbers()[:2] == [100, 101]
    assert listener.turned == []
    assert listener.collector.counts["refilled"] == 100


def test_nothing_is_asked_of_who_is_not_there(network: MemoryNetwork, node: Node) -> None:
    node.say(*range(9))
    listener = Listener(network)
    node.heartbeat.beat()
    node.bus.close()

    def has_asked_twice() -> bool:
        listener.collector.collect()
        return listener.collector.counts["unanswered"] >= 2

    wait_for(has_asked_twice, "two vain requests")
    assert listener.numbers() == []


def test_who_has_no_room_asks_nobody(network: MemoryNetwork, node: Node) -> None:
    node.say(1)
    listener = Listener(network)
    node.heartbeat.beat()
    listener.has_room = False
    for _ in range(9):
        listener.collector.collect()
    assert listener.collector.counts["asked"] == 0
    listener.has_room = True
    listener.collect()


def test_one_far_behind_does_not_keep_others_waiting(
    network: MemoryNetwork, tmp_path: Path
) -> None:
    nodes = [Node(network, tmp_path, f"r{number}") for number in range(3)]
    nodes[0].say(*range(200))
    for node in nodes[1:]:
        node.say(*range(25))
    listener = Listener(network)
    for node in nodes:
        node.heartbeat.beat()
    listener.collect()
    order = [received.key.split("/")[4] for received in listener.came[3:]]
    assert len(order) == 250
    assert max(order.index(f"r{number}") for number in range(3)) < 25
    last = {name: len(order) - order[::-1].index(name) for name in ("r1", "r2")}
    assert max(last.values()) < 130
    for node in nodes:
        node.bus.close()
        node.outbox.close()


class Signs:
    """Knows the node's signature."""

    def verdict(self, _key: Key, _key_text: str, seal: Seal) -> Turned | None:
        """Say whether it is right."""
        return None if seal.signature == b"s" * 64 else "forged"


def test_forged_replies_give_nothing_and_take_nothing(
    network: MemoryNetwork, tmp_path: Path
) -> None:
    forger, bus = network.connect(), network.connect()
    with JournalledOutbox(tmp_path / "r1", lambda _: b"s" * 64) as outbox, forger, bus:
        key = "clew/v1/fire/responder/r1/increment"
        run = outbox.holdings()[0].run
        outbox.seal(TOPICS["increment"], key, encode(increment(0)))
        sealed_by_forger = Unkept(lambda _: b"t" * 64, run).seal(
            TOPICS["increment"], key, encode(increment(9))
        )
        answers = [msgpack.packb([[(key, sealed_by_forger)] * 3]), b"\xc1", bytes(1 << 20)]
        for answer in answers:
            forger.answer(journal_key("fire", "responder", "r1"), partial(_constantly, answer))
        listener = Listener(network, Gate(Signs()))
        Heartbeat(bus, "fire", "responder", "r1", outbox).beat()
        listener.collect()
        assert listener.numbers() == [0]
        assert "forged" in listener.turned
        assert listener.collector.counts["unasked"] >= 4


def _constantly(answer: bytes, _request: bytes) -> bytes:
    return answer


def receipt(number: int, **safe: str) -> bytes:
    told = {"role": "responder", "node_id": "r1", **safe}
    return encode(
        Receipt(event_time_ns=1, sequence=0, safe=(SafeUpTo(number=number, **told),))  # type: ignore[arg-type]
    )


def test_receipts_are_heeded_once_for_the_nodes_own_run(network: MemoryNetwork, node: Node) -> None:
    post, said = network.connect(), Unkept()
    run = node.journal.run.hex()
    node.say(*range(5))

    def tell(payload: bytes) -> int:
        post.publish(RECEIPT, said.seal(TOPICS["receipt"], RECEIPT, payload))
        node.heartbeat.beat()
        return node.acknowledged()

    assert tell(receipt(3, run=run)) == 3
    for other in ({"node_id": "r2"}, {"role": "dap"}, {"run": "0" * 16}):
        assert tell(receipt(5, **{"run": run, **other})) == 3
    assert tell(b"\x80") == 3
    assert tell(receipt(2, run=run)) == 3
    assert tell(receipt(5, run=run)) == 5


def test_a_message_that_the_disk_altered_keeps_nothing_else_from_being_safe(
    network: MemoryNetwork, node: Node, tmp_path: Path
) -> None:
    node.say(*range(5))
    with sqlite3.connect(tmp_path / "r1.journal", isolation_level=None) as other:
        other.execute("UPDATE message SET payload = zeroblob(9) WHERE number = 3")
    other.close()
    listener = Listener(network)
    node.heartbeat.beat()

    def has_all() -> bool:
        listener.collector.collect()
        node.heartbeat.beat()
        numbers = listener.gate.journal(node.journal)
        return numbers is not None and numbers.up_to == 5

    wait_for(has_all, "all that there is")
    assert sorted(listener.numbers()) == [0, 1, 3, 4]
    assert listener.gate.gone[node.journal] == 1
    assert listener.gate.missing() == []


def test_only_a_post_that_is_known_is_heeded(network: MemoryNetwork, tmp_path: Path) -> None:
    post = network.connect()
    with JournalledOutbox(tmp_path / "r1") as outbox:
        heartbeat = Heartbeat(
            network.connect(), "fire", "responder", "r1", outbox, verifier=Signs()
        )
        run = outbox.holdings()[0].run.hex()
        outbox.seal(TOPICS["increment"], "any", encode(increment(0)))
        for mark, expected in ((b"t", 0), (b"s", 1)):
            said = Unkept(lambda _, mark=mark: mark * 64)  # type: ignore[misc]
            post.publish(RECEIPT, said.seal(TOPICS["receipt"], RECEIPT, receipt(1, run=run)))
            heartbeat.beat()
            assert outbox.holdings()[0].acknowledged == expected
