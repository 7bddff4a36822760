"""What has come of a run, against a plain set."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared import received_numbers
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


@given(st.sets(numbers), st.integers(1, 40), st.integers(0, 10), st.integers(0, 60))
def test_what_is_forgotten_is_missing_and_new_again(
    came: set[int], first: int, more: int, highest: int
) -> None:
    received = ReceivedNumbers()
    for number in came:
        received.take(number)
    received.exist(max([highest, first + more]))
    forgotten = set(range(first, first + more + 1))
    received.forget(Hole(first, first + more))
    left = came - forgotten
    missing = {n for n in range(1, received.highest + 1) if n not in left}
    assert {n for hole in received.holes() for n in range(hole.first, hole.last + 1)} == missing
    assert received.missing == len(missing)
    assert all(received.take(number) for number in sorted(forgotten, reverse=True))


def test_the_first_that_is_missing_is_taken_however_many_stand_beyond(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(received_numbers, "MOST_BEYOND", 3)
    received = ReceivedNumbers()
    assert [received.take(number) for number in (3, 4, 5, 6)] == [True, True, True, False]
    assert received.take(1)
    assert received.take(2)
    assert received.up_to == 5
