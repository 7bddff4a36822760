"""The inbox between a handler and the program's own thread."""

from __future__ import annotations

import threading

import pytest

from shared.bus.inbox import Inbox
from tests.waiting import DEADLINE_S, wait_for


def test_first_in_first_out() -> None:
    inbox = Inbox[int](10)
    for number in range(4):
        inbox.put(number)
    assert inbox.get(0.0) == 0
    assert len(inbox) == 3
    assert inbox.get_all() == [1, 2, 3]
    assert inbox.get_all() == []
    assert inbox.get(0.0) is None


def test_the_oldest_makes_room_and_is_counted() -> None:
    inbox = Inbox[int](3)
    for number in range(8):
        inbox.put(number)
    assert inbox.dropped == 5
    assert inbox.get_all() == [5, 6, 7]


@pytest.mark.parametrize("take", [Inbox[int].get, Inbox[int].get_all])
def test_who_waits_is_woken(take: object) -> None:
    assert callable(take)
    inbox = Inbox[int](3)
    taken: list[object] = []
    waiter = threading.Thread(target=lambda: taken.append(take(inbox, DEADLINE_S)))
    waiter.start()
    inbox.put(7)
    waiter.join(DEADLINE_S)
    assert taken in ([7], [[7]])


def test_nothing_is_lost_between_threads_while_there_is_room() -> None:
    inbox = Inbox[tuple[int, int]](4000)

    def send(sender: int) -> None:
        for number in range(1000):
            inbox.put((sender, number))

    senders = [threading.Thread(target=send, args=(sender,)) for sender in range(4)]
    for thread in senders:
        thread.start()
    taken: list[tuple[int, int]] = []

    def drained() -> bool:
        taken.extend(inbox.get_all(0.01))
        return len(taken) == 4000

    wait_for(drained, "all messages")
    for sender in range(4):
        assert [number for source, number in taken if source == sender] == list(range(1000))
    assert inbox.dropped == 0


def test_room_for_none_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 1"):
        Inbox[int](0)
