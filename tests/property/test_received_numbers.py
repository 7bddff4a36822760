"""What has come of a run, against a plain set."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from shared.received_numbers import Hole, ReceivedNumbers

numbers = st.integers(1, 40)


@given(st.lists(numbers), st.integers(0, 60))
def test_new_once_and_holes_are_what_is_missing(came: list[int], highest: int) -> None:
    received, plain = ReceivedNumbers(), set[int]()
    for number in came:
        assert received.take(number) == (number not in plain)
        plain.add(number)
    received.exist(highest)
    last = max([highest, *plain])
    missing = {number for number in range(1, last + 1) if number not in plain}
    holes = list(received.holes())
    assert {n for hole in holes for n in range(hole.first, hole.last + 1)} == missing
    assert holes == sorted(holes)
    assert received.missing == len(missing)
    for number in range(last + 2):
        beyond = [Hole(max(hole.first, number + 1), hole.last) for hole in holes]
        expected = next((hole for hole in beyond if hole.first <= hole.last), None)
        assert received.hole_behind(number) == expected
    assert received.up_to == min([*missing, last + 1]) - 1
    assert received.highest == last


@given(st.sets(numbers), st.integers(1, 50))
def test_what_is_given_up_is_counted_and_no_longer_missing(came: set[int], before: int) -> None:
    received = ReceivedNumbers()
    for number in came:
        received.take(number)
    lost = sum(number not in came for number in range(received.up_to + 1, before))
    assert received.give_up(before) == lost
    assert received.up_to >= before - 1
    assert all(hole.first >= before for hole in received.holes())
    assert not received.take(before - 1)


def test_a_hole_between() -> None:
    received = ReceivedNumbers(up_to=5)
    assert received.take(8)
    received.exist(10)
    assert list(received.holes()) == [Hole(6, 7), Hole(9, 10)]
