"""The time line: one order, late events at once, nothing twice, no more than there is room for."""

from __future__ import annotations

from collections.abc import Sequence

from hypothesis import given
from hypothesis import strategies as st

from command_post.fusion.time_line import Event, TimeLine
from shared.topics import Key
from tests.stride_world import at_ns, stride

HOLD_NS = 1_500_000_000
KEYS = tuple(Key("exercise", "responder", name, "increment") for name in ("r1", "r2"))


def event(time_s: float, sequence: int = 0, key: Key = KEYS[0]) -> Event:
    return Event(key, stride(time_s, 1.0, 0.0, sequence=sequence), at_ns(time_s))


def numbers(events: Sequence[Event]) -> list[int]:
    return [each.message.sequence for each in events]


def test_events_wait_for_the_hold() -> None:
    line = TimeLine(HOLD_NS, 100)
    line.put(event(10.0), at_ns(10.1))
    assert line.release(at_ns(11.4)) == []
    assert len(line.release(at_ns(11.5))) == 1
    assert len(line) == 0


@given(st.permutations(range(12)))
def test_any_order_of_arrival_within_the_hold_leaves_in_one_order(order: list[int]) -> None:
    events = [event(10.0 + 0.1 * (k // 3), k, KEYS[k % 2]) for k in range(12)]
    line = TimeLine(HOLD_NS, 100)
    released = []
    for step, index in enumerate(order):
        now_ns = at_ns(10.5 + 0.08 * step)
        line.put(events[index], now_ns)
        released += line.release(now_ns)
    released += line.release(at_ns(20.0))
    assert released == sorted(
        events, key=lambda e: (e.message.event_time_ns, str(e.key), e.message.sequence)
    )
    assert not line.counts.total()


def test_late_events_are_released_at_once_and_counted() -> None:
    line = TimeLine(HOLD_NS, 100)
    line.put(event(10.0, 0), at_ns(10.1))
    line.put(event(8.0, 1), at_ns(10.2))
    assert numbers(line.release(at_ns(10.2))) == [1]
    assert line.counts["late"] == 1


def test_repeats_are_dropped_and_counted() -> None:
    line = TimeLine(HOLD_NS, 100)
    for _ in range(3):
        line.put(event(10.0, 5), at_ns(10.1))
    assert len(line.release_all()) == 1
    line.put(event(10.0, 5), at_ns(30.0))
    assert len(line.release_all()) == 0
    assert line.counts["repeated"] == 3


def test_a_sender_that_starts_again_is_heard() -> None:
    line = TimeLine(HOLD_NS, 100)
    line.put(event(10.0, 0), at_ns(10.0))
    line.put(event(50.0, 0), at_ns(50.0))
    assert len(line.release_all()) == 2


def test_a_clock_far_ahead_holds_nobody_up() -> None:
    line = TimeLine(HOLD_NS, 100)
    line.put(event(9999.0, 0), at_ns(10.0))
    line.put(event(10.0, 1, KEYS[1]), at_ns(10.1))
    assert numbers(line.release(at_ns(11.6))) == [1]
    assert numbers(line.release(at_ns(13.0))) == [0]


def test_a_full_line_lets_the_earliest_go() -> None:
    line = TimeLine(HOLD_NS, 3)
    for k in range(5):
        line.put(event(10.0 + k / 10, k), at_ns(10.0))
    assert numbers(line.release(at_ns(10.0))) == [0, 1]
    assert line.counts["crowded_out"] == 2


def test_a_flood_of_one_key_is_forgotten_in_time() -> None:
    line = TimeLine(0, 100)
    for k in range(2000):
        line.put(event(10.0, k), at_ns(10.0))
    line.put(event(10.0, 0), at_ns(10.0))
    assert line.counts["repeated"] == 0
    assert len(line) == 2001
    assert numbers(line.release_all())[:3] == [0, 0, 1]
