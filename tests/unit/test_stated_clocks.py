"""Nodes that state how far their clocks are off: followed, unless that cannot be."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from command_post.fusion.time_line import Event
from command_post.incident import Incident, IncidentSettings
from command_post.nodes.dating import Dating
from command_post.nodes.senders import Senders
from command_post.roster import RosterSettings, make_roster
from shared.codec import encode
from shared.messages import Beat, ClockSpan, ClockStatement, OdometryIncrement
from shared.seal import Seal, sealed
from shared.units import NS_PER_S
from tests.stride_world import at_ns, key_of, stride

HOLD_NS = 1_500_000_000
JOURNAL = bytes(8)
PROCESS, LATER_PROCESS = b"process1", b"process2"
MS = 1_000_000
DAY_S = 86_400.0


class Says(NamedTuple):
    """What a node states: by how much the post's clock is ahead, and how surely."""

    offset_s: float
    uncertainty_s: float = 0.02
    drift: float = 0.0
    spans: tuple[ClockSpan, ...] = ()
    post_id: str = "post"


class Node:
    """A node whose clock is ``ahead_s`` ahead of the post's, and drifts; as a post hears it."""

    def __init__(self, ahead_s: float, drift: float = 0.0) -> None:
        self.ahead_s = ahead_s
        self.drift = drift
        self.process = PROCESS
        self.senders = Senders(HOLD_NS)
        self.dating = Dating(self.senders)
        self.number = 0

    def reads_s(self, true_s: float) -> float:
        """Return what its clock reads."""
        return true_s + self.ahead_s + self.drift * true_s

    def beat(self, sent_s: float, says: Says | None, way_s: float = 0.03) -> list[str]:
        """Let it beat, and return what that shows to be wrong with it."""
        statement = None
        if says is not None:
            statement = ClockStatement(
                post_id=says.post_id,
                offset_ns=round(says.offset_s * NS_PER_S),
                uncertainty_ns=round(says.uncertainty_s * NS_PER_S),
                drift=says.drift,
                spans=says.spans,
            )
        beat = Beat(
            event_time_ns=at_ns(self.reads_s(sent_s)), sequence=self.number, run=JOURNAL.hex(),
            last_number=0, kept_from=1, acknowledged=0, clock=statement,
        )  # fmt: skip
        self.number += 1
        seal = Seal(self.process, self.number, None, b"")
        key = key_of("responder", "r1", Beat)
        now_ns = at_ns(sent_s + way_s)
        self.released = self.dating.dated_by_now(key, now_ns)
        return [found.kind for found in self.senders.hear(key, beat, now_ns, seal)]

    def step(self, true_s: float, heard_s: float | None = None, number: int = 100) -> list[Event]:
        """Let a stride of ``true_s`` be heard, live or from the journal; return what is dated."""
        heard_s = true_s + 0.03 if heard_s is None else heard_s
        said = stride(self.reads_s(true_s), 1.2, 0.0, sequence=number)
        key, seal = key_of("responder", "r1", OdometryIncrement), Seal(JOURNAL, number, None, b"")
        self.senders.hear(key, said, at_ns(heard_s), seal)
        return self.dating.date(key, said, at_ns(heard_s), seal)


@pytest.mark.parametrize("ahead_s", [DAY_S, -DAY_S, 3 * 3600.0, -40.0, 5.0, -0.3, 0.0])
def test_what_a_node_says_is_dated_by_the_offset_that_it_states(ahead_s: float) -> None:
    node = Node(ahead_s)
    expected = ["wrong_clock"] if abs(ahead_s) > 1.0 else []
    assert node.beat(0.0, Says(-ahead_s + 0.004)) == expected
    for true_s in (1.0, 2.0):
        (event,) = node.step(true_s)
        assert abs(event.time_ns - at_ns(true_s)) <= 20 * MS


def test_a_clock_that_may_be_right_is_left_alone() -> None:
    node = Node(0.0)
    for second in range(20):
        node.beat(second, Says(0.018 if second % 2 else -0.018))
        (event,) = node.step(second + 0.5)
        assert event.time_ns == at_ns(second + 0.5)
    assert node.dating.moved_in_time == 0


@pytest.mark.parametrize("drift", [100e-6, -100e-6])
def test_a_drift_counts_for_what_was_said_long_ago(drift: float) -> None:
    node = Node(-40.0, drift)
    true_offset_s = 40.0 - drift * 3600.0
    node.beat(3600.0, Says(true_offset_s, 0.005, drift=-drift))
    (event,) = node.step(1800.0, heard_s=3600.5)
    assert abs(event.time_ns - at_ns(1800.0)) <= 10 * MS


def test_each_span_of_a_journal_has_the_offset_of_its_own() -> None:
    node = Node(7.0)
    spans = tuple(
        ClockSpan(first_number=first, offset_ns=round(offset_s * NS_PER_S), uncertainty_ns=20 * MS)
        for first, offset_s in ((1, -3600.0), (50, 40.0), (90, -7.0))
    )
    node.beat(600.0, Says(-7.0, spans=spans))
    (now,) = node.step(600.2, number=95)
    assert now.time_ns == at_ns(600.2)
    for number, ahead_s in ((10, 3600.0), (49, 3600.0), (50, -40.0), (89, -40.0)):
        node.ahead_s = ahead_s
        (event,) = node.step(300.0, heard_s=601.0, number=number)
        assert event.time_ns == at_ns(300.0)
    assert node.senders.states_clock("responder", "r1")


@pytest.mark.parametrize("lie_s", [60.0, -60.0, 3600.0, 1.0])
def test_a_node_whose_statement_cannot_be_true_is_told_of_and_not_followed(lie_s: float) -> None:
    node = Node(0.0)
    shown = [kind for second in range(5) for kind in node.beat(second, Says(lie_s))]
    assert shown == ["false_clock"]
    (event,) = node.step(5.0)
    assert event.time_ns == at_ns(5.0)
    (fault,) = node.senders.faults("responder", "r1", at_ns(5.0))
    assert "what it says of its clock is wrong" in fault


def test_a_liar_with_a_wrong_clock_is_put_where_its_messages_seem_to_be() -> None:
    node = Node(-40.0)
    for second in range(5):
        node.beat(second, Says(-500.0))
    (event,) = node.step(5.0)
    assert abs(event.time_ns - at_ns(5.0)) <= 100 * MS


def test_a_process_begun_anew_with_another_clock_is_followed_at_once() -> None:
    node = Node(DAY_S)
    for second in range(5):
        assert node.beat(second, Says(-DAY_S)) == (["wrong_clock"] if second == 0 else [])
    node.ahead_s, node.process = -40.0, LATER_PROCESS
    assert node.beat(6.0, None) == []
    assert node.beat(7.0, Says(40.0)) == []
    (event,) = node.step(7.5)
    assert event.time_ns == at_ns(7.5)
    known = node.senders.clock("responder", "r1")
    assert known is not None
    assert known.offset_ns == 40 * NS_PER_S


def test_a_post_begun_anew_with_another_clock_is_followed_at_once() -> None:
    node = Node(0.0)
    for second in range(5):
        node.beat(second, Says(0.0))
    # From the post's new clock, the node's is a minute ahead.
    node.ahead_s = 60.0
    assert node.beat(6.0, Says(-60.0)) == ["wrong_clock"]
    (event,) = node.step(7.0)
    assert event.time_ns == at_ns(7.0)


def test_what_comes_before_the_first_statement_waits_for_it() -> None:
    node = Node(3600.0)
    assert node.step(0.0) == []
    node.beat(0.1, None)
    assert node.step(0.5, number=101) == []
    node.beat(1.0, Says(-3600.0))
    key = key_of("responder", "r1", OdometryIncrement)
    waited = node.dating.dated_by_now(key, at_ns(1.1))
    assert [event.time_ns for event in waited] == [at_ns(0.0), at_ns(0.5)]


def test_who_states_nothing_is_not_waited_for_long() -> None:
    node = Node(0.0)
    assert node.step(0.0) == []
    node.beat(2.0, None)
    assert [event.time_ns for event in node.released] == [at_ns(0.0)]
    assert len(node.step(2.5)) == 1


def test_what_is_stated_of_another_posts_clock_is_not_of_this_ones() -> None:
    node = Node(-40.0)
    node.beat(0.0, Says(77.0, post_id="another"))
    assert not node.senders.states_clock("responder", "r1")
    # It seems as far behind as its messages seem old.
    (event,) = node.step(5.0)
    assert abs(event.time_ns - at_ns(5.0)) <= 50 * MS


def test_old_rows_of_a_journal_say_nothing_of_the_clock() -> None:
    node = Node(0.0)
    node.beat(900.0, Says(0.0))
    for row in range(20):
        node.step(100.0 + row, heard_s=900.5 + 0.01 * row, number=row)
    assert node.beat(901.0, Says(0.0)) == []
    assert node.senders.clock("responder", "r1") == (0, 20 * MS)


@pytest.mark.parametrize(
    ("says", "fault"),
    [
        (Says(40.0), "clock behind by 40 s, known to 20 ms"),
        (Says(-7200.0, 0.5), "clock ahead by 2 h, known to 500 ms"),
        (Says(0.3), None),
        (Says(0.0, 3.0), "clock known to 3 s only"),
    ],
)
def test_the_roster_shows_how_far_a_clock_is_off_and_how_surely(
    says: Says, fault: str | None
) -> None:
    incident = Incident(IncidentSettings())
    node = Node(-says.offset_s)
    key = str(key_of("responder", "r1", Beat))
    statement = ClockStatement(
        post_id="post", offset_ns=round(says.offset_s * NS_PER_S), drift=0.0,
        uncertainty_ns=round(says.uncertainty_s * NS_PER_S),
    )  # fmt: skip
    beat = Beat(
        event_time_ns=at_ns(node.reads_s(0.0)), sequence=0, run=JOURNAL.hex(), last_number=0,
        kept_from=1, acknowledged=0, clock=statement,
    )  # fmt: skip
    incident.handle(key, sealed(encode(beat), PROCESS, 1), at_ns(0.03))
    (row,) = make_roster(incident, at_ns(1.0), RosterSettings()).responders
    assert row.fault == fault
    known = incident.clock("responder", "r1")
    assert known is not None
    assert known.uncertainty_ns == round(says.uncertainty_s * NS_PER_S)
