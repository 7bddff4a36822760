"""Packed or not, a log gives back what was told: in the order of its time, whatever came late."""

from __future__ import annotations

import pickle
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from command_post.fusion.team import move_log
from command_post.fusion.team.move_log import MoveLog
from shared.messages import OdometryIncrement
from tests.traffic import increment


@pytest.fixture(autouse=True, scope="module")
def _small_blocks() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(move_log, "BLOCK", 3)
        patch.setattr(move_log, "UNPACKED", 4)
        yield


def at(time_ns: int) -> OdometryIncrement:
    return structs.replace(increment(time_ns), event_time_ns=time_ns, start_time_ns=time_ns - 1)


@given(st.permutations(range(1, 30)), st.integers(0, 31), st.integers(0, 31))
def test_all_is_there_in_order(order: list[int], since_ns: int, until_ns: int) -> None:
    moves = MoveLog()
    for number, time_ns in enumerate(order):
        assert moves.add(at(time_ns))
        assert not moves.add(at(time_ns))
        if number % 7 == 0:
            moves = pickle.loads(pickle.dumps(moves, 5))  # noqa: S301
    told = [at(time_ns) for time_ns in range(1, 30)]
    later = moves.later_than(since_ns)
    later = later.later_than(since_ns + 2) if since_ns % 2 else later
    first_ns = since_ns + 2 if since_ns % 2 else since_ns
    again = pickle.loads(pickle.dumps(later))  # noqa: S301
    for each, since in ((moves, 0), (later, first_ns), (again, first_ns)):
        expected = [message for message in told if message.event_time_ns > since]
        assert len(each) == len(expected)
        before = [message for message in expected if message.event_time_ns <= until_ns]
        assert each.messages_until(until_ns) == before
        assert each.messages_after(until_ns) == expected[len(before) :]
        assert each.until(until_ns).end_ns.tolist() == [one.event_time_ns for one in before]
    # What is added later is of the whole log alone.
    moves.add(at(40))
    assert [each.event_time_ns for each in later.messages_after(0)] == list(range(first_ns + 1, 30))
