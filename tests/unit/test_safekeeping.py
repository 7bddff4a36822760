"""Nobody is told that a message is safe before it is on the disk."""

from __future__ import annotations

from command_post.nodes.safekeeping import Safekeeping
from shared.codec import encode
from shared.gate import Gate, JournalRun
from shared.messages import SafeUpTo
from shared.received_numbers import Hole
from shared.seal import sealed
from tests.traffic import increment, key_of

RUN = b"\x07" * 8
JOURNAL = JournalRun("responder", "r1", RUN)


class FakeDisk:
    """Takes what it is given, and has it safe when it is told so."""

    def __init__(self) -> None:
        self.taken = self.safe = self.begun_anew = 0
        self.has_room = True


class World:
    """A gate, a disk, and what is told of both; a second passes with every look."""

    def __init__(self) -> None:
        self.gate, self.disk = Gate(), FakeDisk()
        self.keeping = Safekeeping(self.gate, self.disk)
        self.now_s = 1000.0

    def hear(
        self, *numbers: int, node_id: str = "r1", run: bytes = RUN, taken: bool = True
    ) -> None:
        """Let in messages of these numbers, which the disk takes or drops."""
        key = key_of("responder", node_id, "increment")
        for number in numbers:
            payload = sealed(encode(increment(number)), run, number)
            assert self.gate.admit(key, payload) is None
            if taken:
                self.disk.taken += 1
            else:
                self.keeping.lose(key, payload)

    def told(self, looks: int = 1) -> list[int]:
        """Return the numbers told in so many seconds."""
        found: list[int] = []
        for _ in range(looks):
            self.now_s += 1.0
            for receipt in self.keeping.receipts(self.now_s, 5):
                found += [each.number for each in receipt.safe]
        return found

    def sync(self) -> None:
        """Have on the disk all that it has taken."""
        self.disk.safe = self.disk.taken


def test_a_number_is_told_once_its_message_is_on_the_disk() -> None:
    world = World()
    world.hear(1, 2, 3)
    assert world.told(5) == []
    world.sync()
    assert world.told(5) == [3]
    world.hear(4)
    assert world.told(5) == []
    world.sync()
    assert world.told(5) == [4]


def test_what_came_after_the_disk_was_looked_at_is_not_told_yet() -> None:
    world = World()
    world.hear(1)
    world.told()
    world.hear(2)
    world.disk.safe = 1
    assert world.told(3) == [1]
    assert world.told(3) == []
    world.sync()
    assert world.told(3) == [2]


def test_behind_a_hole_nothing_is_told() -> None:
    world = World()
    world.hear(1, 2, 5)
    world.told()
    world.sync()
    assert world.told(4) == [2]
    world.hear(3, 4)
    world.told()
    world.sync()
    assert world.told(4) == [5]


def test_who_comes_late_hears_it_again_within_half_a_minute() -> None:
    world = World()
    world.hear(1)
    world.told()
    world.sync()
    assert world.told(100).count(1) == 4


def test_every_journal_is_told_of_in_receipts_that_are_small_enough() -> None:
    world = World()
    for number in range(600):
        world.hear(1, node_id=f"r{number % 3 + 1}", run=number.to_bytes(8, "big"))
    world.told()
    world.sync()
    world.now_s += 3.0
    receipts = world.keeping.receipts(world.now_s, 5)
    assert [len(receipt.safe) for receipt in receipts] == [256, 256, 88]
    assert [receipt.sequence for receipt in receipts] == [0, 1, 2]
    assert receipts[0].safe[0] == SafeUpTo(role="responder", node_id="r1", run="00" * 8, number=1)


def test_what_was_safe_comes_again_when_somebody_has_cut_the_file() -> None:
    world = World()
    world.hear(1, 2, 3)
    world.hear(5, node_id="r2")
    world.told()
    world.sync()
    assert sorted(world.told(5)) == [3]
    world.disk.begun_anew += 1
    world.told()
    missing = {each.journal.node_id: each.hole for each in world.gate.missing()}
    assert missing == {"r1": Hole(1, 3), "r2": Hole(1, 5)}
    world.hear(1, 2, 3)
    world.sync()
    assert set(world.told(40)) == {3}


def test_what_the_disk_had_to_drop_is_never_told_and_comes_again() -> None:
    world = World()
    world.hear(1, 2)
    world.told()
    world.disk.has_room = False
    world.hear(3, 4, 6, taken=False)
    world.sync()
    assert set(world.told(40)) == {2}
    assert [each.hole for each in world.gate.missing()] == [Hole(5, 5)]
    world.disk.has_room = True
    world.hear(7)
    assert set(world.told(40)) == {2}
    numbers = world.gate.journal(JOURNAL)
    assert numbers is not None
    assert list(numbers.holes()) == [Hole(3, 6)]
    world.hear(3, 4, 5, 6)
    world.told()
    world.sync()
    assert world.told(3) == [7]


def test_what_is_not_journalled_is_never_waited_for() -> None:
    world = World()
    world.keeping.lose(key_of("responder", "r1", "health"), sealed(b"\x80", RUN, 4))
    world.keeping.lose("nobody's", b"?")
    world.hear(1)
    world.told()
    world.sync()
    assert world.told(3) == [1]
