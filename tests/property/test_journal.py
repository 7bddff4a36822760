"""The journal beside a plain list: whatever is done, in whatever order, they hold the same."""

# ruff: noqa: D102  rules are told by their names

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from shared.journal import KEPT_NS, Journal
from shared.kept import Holding, Row, within_bytes

NUMBERS = st.integers(min_value=-2, max_value=30)


class JournalBesideAList(RuleBasedStateMachine):
    """Appends, acknowledges, trims and opens again, and compares."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = TemporaryDirectory()
        self.now_ns = 0
        self.rows: dict[int, tuple[int, Row]] = {}
        self.last = self.acknowledged = 0
        self.open()
        self.run = self.journal.run

    def open(self) -> None:
        self.journal = Journal(Path(self.folder.name) / "journal", lambda: self.now_ns)

    def teardown(self) -> None:
        self.journal.close()
        self.folder.cleanup()

    @rule(key=st.sampled_from(["a", "b"]), payload=st.binary(max_size=50))
    def append(self, key: str, payload: bytes) -> None:
        kept = self.journal.append(key, lambda run, number: run + b"%d" % number + payload)
        self.last += 1
        assert kept == self.run + b"%d" % self.last + payload
        self.rows[self.last] = (self.now_ns, Row(self.last, key, kept))

    @rule(number=NUMBERS)
    def acknowledge(self, number: int) -> None:
        self.journal.acknowledge(number)
        if self.acknowledged < number <= self.last:
            self.acknowledged = number

    @rule(hours=st.integers(min_value=1, max_value=30))
    def pass_time(self, hours: int) -> None:
        self.now_ns += hours * KEPT_NS // 24

    @rule()
    def trim(self) -> None:
        self.journal.trim()
        old_ns = self.now_ns - KEPT_NS
        self.rows = {
            number: (at_ns, row)
            for number, (at_ns, row) in self.rows.items()
            if number > self.acknowledged or number == self.last or at_ns >= old_ns
        }

    @rule()
    def open_again(self) -> None:
        self.journal.close()
        self.open()

    @precondition(lambda self: self.last)
    @rule(first=NUMBERS, last=NUMBERS, most=st.integers(1, 9), most_bytes=st.integers(0, 99))
    def read(self, first: int, last: int, most: int, most_bytes: int) -> None:
        asked = [row for number, (_, row) in sorted(self.rows.items()) if first <= number <= last]
        expected = list(within_bytes(asked[:most], most_bytes))
        assert self.journal.rows(first, last, most, most_bytes) == expected

    @invariant()
    def holds_the_same(self) -> None:
        kept_from = min(self.rows, default=self.last + 1)
        holding = Holding(self.run, self.last, kept_from, self.acknowledged)
        assert self.journal.holding() == holding


TestJournalBesideAList = JournalBesideAList.TestCase
TestJournalBesideAList.settings = settings(max_examples=15, stateful_step_count=20)
