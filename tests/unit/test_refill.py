"""What is asked of whom, and what of a reply is taken."""

from __future__ import annotations

from collections import Counter
from itertools import count, pairwise

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.codec import MAX_PAYLOAD_BYTES, encode
from shared.gate import Gate, JournalRun, Missing
from shared.kept import Row
from shared.memory_journal import MemoryJournal
from shared.pacing import FIRST_ROWS, LONGEST_PAUSE_S, MOST_ROWS, Pace
from shared.received_numbers import Hole
from shared.refill import refilled, reply_to, request_of
from shared.refill_plan import LONGEST_WAIT_S, MOST_VAIN_ROUNDS, Ask, RefillPlan
from shared.seal import sealed
from tests.traffic import increment

KEY = "clew/v1/fire/responder/r1/increment"
RUN = b"thisrun_"
R1 = JournalRun("responder", "r1", RUN)


def message(number: int, run: bytes = RUN) -> bytes:
    return sealed(encode(increment(number)), run, number)


def journal_of(last: int) -> MemoryJournal:
    journal = MemoryJournal()
    journal.run = RUN
    for _ in range(last):
        journal.append(KEY, lambda run, number: message(number, run))
    return journal


def ask_and_reply(first: int, last: int, most_rows: int) -> bytes:
    journal = journal_of(30)

    def fetch(run: bytes, first: int, last: int, rows: int, most_bytes: int) -> list[Row]:
        assert run == RUN
        return journal.rows(first, last, rows, most_bytes)

    reply = reply_to(request_of(Missing(R1, Hole(first, last), 1), most_rows), fetch)
    assert reply is not None
    return reply


def test_a_reply_has_what_was_asked_for_as_it_was_said() -> None:
    taken = refilled(ask_and_reply(5, 100, 4), R1, "fire", Hole(5, 8))
    assert taken.messages == {number: (KEY, message(number)) for number in (5, 6, 7, 8)}
    assert taken.unasked == 0


def test_what_was_not_asked_for_is_left_out() -> None:
    reply = ask_and_reply(5, 12, 8)
    assert refilled(reply, R1, "fire", Hole(6, 7)).messages.keys() == {6, 7}
    assert refilled(reply, R1, "fire", Hole(6, 7)).unasked == 6
    for other in (R1._replace(run=b"otherrun"), R1._replace(node_id="r2"), R1._replace(role="dap")):
        assert refilled(reply, other, "fire", Hole(5, 12)) == ({}, 8)
    assert refilled(reply, R1, "other", Hole(5, 12)) == ({}, 8)


HEALTH = KEY.replace("increment", "health")


@pytest.mark.parametrize(
    "rows",
    [
        [(KEY, b"unsealed")],
        [("no key", message(5))],
        [(HEALTH, message(5))],
        [(KEY, message(5) + bytes(MAX_PAYLOAD_BYTES))],
        [(KEY, message(5, b"otherrun"))],
    ],
)
def test_rows_that_cannot_be_the_nodes_are_counted(rows: list[tuple[str, bytes]]) -> None:
    good = (KEY, message(6))
    taken = refilled(msgpack.packb([[*rows, good, good]]), R1, "fire", Hole(5, 6))
    assert taken == ({6: good}, 2)


@given(st.binary(max_size=200))
def test_garbage_is_harmless(garbage: bytes) -> None:
    assert refilled(garbage, R1, "fire", Hole(1, 9)).messages == {}
    reply = reply_to(garbage, lambda *_: [])
    assert reply is None or refilled(reply, R1, "fire", Hole(1, 9)) == ({}, 0)


def test_a_huge_reply_is_not_even_read() -> None:
    rows = [(KEY, message(5)), *[(KEY, bytes(60_000))] * 5]
    assert refilled(msgpack.packb([rows]), R1, "fire", Hole(5, 5)) == ({}, 1)


def test_a_reply_is_bounded_whatever_is_asked() -> None:
    seen: list[tuple[int, int]] = []

    def fetch(_run: bytes, _first: int, _last: int, rows: int, most_bytes: int) -> list[Row]:
        seen.append((rows, most_bytes))
        return []

    request = {"run": RUN.hex(), "first": 1, "last": 2**62, "most_rows": 10**6}
    assert reply_to(msgpack.packb(request), fetch) is None
    del request["most_rows"]
    assert reply_to(msgpack.packb(request), fetch) is not None
    assert seen == [(500, 1 << 17)]


class Link:
    """One that takes ``delay_s`` and ``rows_per_s``."""

    def __init__(self, delay_s: float, rows_per_s: float) -> None:
        self.delay_s, self.rows_per_s = delay_s, rows_per_s

    def ask(self, pace: Pace, from_s: float, times: int) -> list[int]:
        """Ask so often from ``from_s`` on; return how many rows each time."""
        at_s, asked = from_s, []
        for _ in range(times):
            duration_s = self.delay_s + pace.rows / self.rows_per_s
            at_s += duration_s + pace.pause_s
            asked.append(pace.rows)
            pace.replied(at_s, duration_s, pace.rows)
        return asked


@pytest.mark.parametrize("delay_s", [0.001, 0.1, 0.4, 1.0])
@pytest.mark.parametrize("rows_per_s", [20.0, 180.0, 2000.0])
def test_on_any_link_others_wait_for_a_reply_but_shortly(delay_s: float, rows_per_s: float) -> None:
    asked = Link(delay_s, rows_per_s).ask(Pace(), 0.0, 2000)[20:]
    held_up_s = max(asked) / rows_per_s
    assert held_up_s < 0.25
    assert max(asked) == MOST_ROWS or held_up_s > 0.04


def test_on_a_link_that_narrows_it_asks_for_less() -> None:
    pace = Pace()
    assert Link(0.005, 1e5).ask(pace, 0.0, 50)[-1] == MOST_ROWS
    narrowed = Link(0.005, 100.0).ask(pace, 10.0, 20)
    assert max(narrowed[6:]) <= 25
    pace.unanswered()
    assert pace.rows <= 12
    assert pace.pause_s == LONGEST_PAUSE_S


def test_short_replies_say_nothing_of_longer_ones() -> None:
    pace = Pace()
    for at_s in range(101):
        pace.replied(float(at_s), 0.01, 1)
    assert pace.rows == FIRST_ROWS


def missing(node: str, first: int, last: int, in_all: int | None = None) -> Missing:
    hole = Hole(first, last)
    journal = JournalRun("responder", node, RUN)
    return Missing(journal, hole, last - first + 1 if in_all is None else in_all)


def test_all_are_asked_in_turn_however_much_is_missing() -> None:
    plan, asked = RefillPlan(), Counter[str]()
    lacks = [missing("r1", 1, 10**5), missing("r2", 1, 10**4), missing("r3", 1, 100)]
    for at_s in range(30):
        ask = plan.next(lacks, float(at_s))
        if ask is not None:
            asked[ask.missing.journal.node_id] += 1
            plan.replied(ask, None, 0, 0.01)
            lacks = [
                lack._replace(hole=Hole(plan.behind[lack.journal] + 1, 10**6)) for lack in lacks
            ]
    assert set(asked.values()) == {29 // 3, 29 // 3 + 1}


class Nodes:
    """Journals, a gate, and the plan between them."""

    def __init__(self, *said: int) -> None:
        self.gate, self.plan = Gate(), RefillPlan()
        self.said = {JournalRun("responder", f"r{n}", RUN): last for n, last in enumerate(said)}
        self.lost: set[int] = set()
        self.now_s = 0.0
        self.asks = 0
        for journal, last in self.said.items():
            self.come(journal, last)

    def come(self, journal: JournalRun, number: int) -> None:
        """Let one message come in."""
        self.gate.admit(f"clew/v1/fire/responder/{journal.node_id}/increment", message(number))

    def missing(self) -> int:
        """How many have not come."""
        return sum(each.in_all for each in self.gate.missing())

    def run(self, seconds: float) -> None:
        """Let time pass, and have every request answered."""
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            ask = self.plan.next(self.gate.missing(self.plan.behind), self.now_s)
            self.now_s += 0.05 if ask is None else self.answer(ask)

    def answer(self, ask: Ask) -> float:
        """Answer with what is asked for and is not lost."""
        self.asks += 1
        found = [n for n in range(ask.hole.first, ask.hole.last + 1) if n not in self.lost]
        for number in found:
            self.come(ask.missing.journal, number)
        return 0.01 + self.plan.replied(ask, max(found, default=None), len(found), 0.01)


def test_all_that_is_missing_is_asked_for() -> None:
    nodes = Nodes(500, 40, 3, 1)
    nodes.run(10.0)
    assert nodes.missing() == 0
    asked = nodes.asks
    nodes.run(10.0)
    assert nodes.asks == asked


def test_what_is_lost_for_good_keeps_nothing_else_back_and_is_not_asked_for_ever() -> None:
    nodes = Nodes(200)
    nodes.lost = {7, 100, 101}
    nodes.run(3.0)
    assert nodes.missing() == 3
    nodes.run(2000.0)
    asked = nodes.asks
    assert asked < 20 + 3 * (MOST_VAIN_ROUNDS + 2)
    nodes.run(2000.0)
    assert nodes.asks == asked
    (journal,) = nodes.said
    nodes.come(journal, 260)
    nodes.run(3.0)
    assert nodes.missing() == 3
    nodes.lost = set()
    nodes.plan.came_back("responder", "r9")
    nodes.plan.came_back("responder", "r0")
    nodes.run(3.0)
    assert nodes.missing() == 0


def test_a_node_that_claims_to_have_said_no_end_of_things_is_given_up() -> None:
    plan, lacks = RefillPlan(), missing("r1", 1, 2**62)
    asks = 0
    for step in range(200_000):
        behind = plan.behind.get(lacks.journal, 0)
        first = 1 if behind >= 2**62 else behind + 1
        ask = plan.next([lacks._replace(hole=Hole(first, 2**62))], step * 0.05)
        if ask is not None:
            asks += 1
            plan.replied(ask, None, 0, 0.01)
    assert asks < 70 * (MOST_VAIN_ROUNDS + 2)
    assert plan.next([lacks], 1e9) is None


def test_who_does_not_answer_is_asked_ever_less_until_they_are_back() -> None:
    plan, lacks, at_s = RefillPlan(), [missing("r1", 1, 9), missing("r2", 1, 9)], list[float]()
    for step in count():
        now_s = step * 0.05
        ask = plan.next(lacks, now_s)
        if ask is not None:
            plan.unanswered(ask)
            at_s += [now_s] if ask.missing.journal.node_id == "r1" else []
        if now_s > 600.0:
            break
    gaps = [after - before for before, after in pairwise(at_s)]
    assert all(later > earlier - 0.1 for earlier, later in pairwise(gaps))
    assert gaps[0] < 0.5
    assert gaps[-1] == pytest.approx(LONGEST_WAIT_S, abs=0.2)
    assert plan.next(lacks, now_s) is None
    plan.came_back("responder", "r2")
    ask = plan.next(lacks, now_s)
    assert ask is not None
    assert ask.missing.journal.node_id == "r2"


def test_those_complete_are_forgotten() -> None:
    plan = RefillPlan()
    plan.next([missing("r1", 1, 9), missing("r2", 1, 9)], 0.0)
    assert len(plan.behind) == 2
    plan.next([missing("r2", 1, 9)], 1.0)
    assert [journal.node_id for journal in plan.behind] == ["r2"]


def test_what_has_come_and_waits_its_turn_is_not_asked_for_again() -> None:
    plan, now_s, seen = RefillPlan(), 0.0, False
    asked: list[int] = []
    for _ in range(200):
        lacks = missing("r1", 1, 50)
        behind = plan.behind.get(lacks.journal, 0)
        # The gate has let in none of it yet: it lacks what is beyond, or else all.
        hole = Hole(behind + 1, 50) if behind < 50 else Hole(1, 50)
        ask = plan.next([lacks._replace(hole=hole)], now_s, lambda _: seen)
        if ask is not None:
            asked += range(ask.hole.first, ask.hole.last + 1)
            plan.replied(ask, ask.hole.last, ask.rows, 0.01)
        now_s += 0.05
    assert asked == list(range(1, 51))
    seen = True
    plan.next([missing("r1", 40, 50)], now_s, lambda _: seen)
    ask = plan.next([missing("r1", 40, 50)], now_s + LONGEST_WAIT_S, lambda _: seen)
    assert ask is not None
    assert ask.hole.first == 40
