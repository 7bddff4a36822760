"""The post's inbox: everybody in turn, nobody at another's cost."""

from __future__ import annotations

import threading
from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.bus.fair_inbox import (
    LONGEST_HEARD_BYTES,
    OVERHEAD_BYTES,
    SLOWED_FOR_S,
    SLOWED_PER_S,
    FairInbox,
    sender_of,
)
from shared.bus.interface import Received
from tests.traffic import key_of
from tests.waiting import DEADLINE_S

ROOMY = 1 << 30


def message(sender: str, number: int, size: int = 0) -> Received:
    return Received(key_of("responder", sender, "increment"), b"%d" % number + bytes(size))


def offer(inbox: FairInbox[Received], received: Received) -> None:
    if inbox.wanted(received.key, len(received.payload)):
        inbox.put(received)


def taken(inbox: FairInbox[Received], most: int = 1 << 20) -> list[Received]:
    return inbox.get_some(most)


@pytest.mark.parametrize(
    ("key", "sender"),
    [
        ("clew/v1/fire/responder/r1/increment", "responder/r1"),
        ("clew/v9/fire/dap/d-1/what/ever", "dap/d-1"),
        ("clew/v1/fire/dragon/r1/increment", "?"),
        ("clew/v1/fire/post", "?"),
        ("clew/v1/fire/dap//rssi", "?"),
        (f"clew/v1/fire/dap/{'d' * 33}/rssi", "?"),
        ("", "?"),
    ],
)
def test_who_sends_is_read_off_the_key(key: str, sender: str) -> None:
    assert sender_of(key) == sender


def test_all_are_heard_in_turn_each_in_their_own_order() -> None:
    inbox = FairInbox[Received](1000, ROOMY)
    for number in range(100):
        inbox.put(message("loud", number))
    for number in range(2):
        inbox.put(message("r1", number))
        inbox.put(message("r2", number))
    first = taken(inbox, 6)
    assert Counter(sender_of(one.key) for one in first) == {
        "responder/loud": 2, "responder/r1": 2, "responder/r2": 2,
    }  # fmt: skip
    rest = taken(inbox)
    loud = [int(one.payload) for one in first + rest if "loud" in one.key]
    assert loud == list(range(100))
    assert not inbox.lost()
    assert len(inbox) == 0


def test_what_is_said_now_waits_for_one_at_most_that_was_refilled() -> None:
    inbox, now_s, waited_s = FairInbox[Received](1000, ROOMY), 0.0, []
    due_s = 0.0
    for number in range(271):
        inbox.put(message("r1", 1000 + number), refilled=True)
    assert inbox.refilled_of("responder/r1") == 271
    refilled: list[int] = []
    while len(inbox) or due_s < 60.0:
        while due_s <= min(now_s, 60.0):
            for sender in ("r1", "r2"):
                inbox.put(message(sender, round(due_s * 10)))
            due_s += 0.5
        for one in inbox.get_some(256):
            if (number := int(one.payload)) >= 1000:
                refilled.append(number)
                now_s += 0.2  # so long it takes to be fused where it belongs
            else:
                waited_s.append(now_s - number / 10)
        now_s += 0.001
    assert refilled == list(range(1000, 1271)), "all, once, in their order"
    assert len(waited_s) == 2 * 120
    assert max(waited_s) < 0.25


def test_who_floods_does_not_keep_out_what_was_refilled() -> None:
    inbox = FairInbox[Received](1000, ROOMY)
    for number in range(5):
        inbox.put(message("r1", number), refilled=True)
    heard: list[Received] = []
    for _ in range(5):
        for number in range(100):
            inbox.put(message("loud", number))
        heard += taken(inbox, 50)
    assert [int(one.payload) for one in heard if "r1" in one.key] == list(range(5))
    assert inbox.refilled_of("responder/r1") == 0
    assert inbox.queued() == {"responder/loud": 250}


def test_who_floods_displaces_themselves_alone() -> None:
    inbox = FairInbox[Received](100, ROOMY)
    inbox.put(message("r1", 0))
    for number in range(1000):
        inbox.put(message("loud", number))
    inbox.put(message("r2", 0))
    heard = taken(inbox)
    assert {"responder/r1", "responder/r2"} <= {sender_of(one.key) for one in heard}
    loud = [int(one.payload) for one in heard if "loud" in one.key]
    assert loud == list(range(1000 - len(loud), 1000)), "the newest stay"
    assert 40 <= len(loud) <= 50, "half of the room at most"
    assert inbox.lost() == {("crowded_out", "responder/loud"): 1000 - len(loud)}


def test_bytes_are_bounded_as_well() -> None:
    inbox = FairInbox[Received](1000, 50_000)
    for number in range(100):
        inbox.put(message("loud", number, 4000))
    inbox.put(message("r1", 0))
    heard = taken(inbox)
    assert sum(len(one.payload) + OVERHEAD_BYTES for one in heard) <= 50_000
    assert any("r1" in one.key for one in heard)
    inbox.put(message("r1", 0, 60_000))
    assert len(inbox) == 0
    assert inbox.lost()["crowded_out", "responder/r1"] == 1


@given(
    st.lists(
        st.tuples(st.sampled_from("abcdef"), st.integers(0, 5000), st.booleans()), max_size=300
    ),
    st.integers(2, 50),
    st.integers(2, 40_000),
)
def test_the_bounds_hold_and_every_message_is_heard_or_counted(
    sent: list[tuple[str, int, bool]], max_messages: int, max_bytes: int
) -> None:
    inbox = FairInbox[Received](max_messages, max_bytes)
    for number, (sender, size, refilled) in enumerate(sent):
        inbox.put(message(sender, number, size), refilled=refilled)
    assert len(inbox) <= max_messages
    assert sum(inbox.queued().values()) == len(inbox)
    heard: list[Received] = []
    while len(inbox):
        heard += taken(inbox)
    assert sum(len(one.key) + len(one.payload) + OVERHEAD_BYTES for one in heard) <= max_bytes
    assert len(heard) + sum(inbox.lost().values()) == len(sent)
    for sender in "abcdef":
        own = [int(one.payload.rstrip(b"\0")) for one in heard if f"/{sender}/" in one.key]
        for refilled in (False, True):
            of_line = [number for number in own if sent[number][2] == refilled]
            assert all(one < other for one, other in pairwise(of_line))


def test_who_is_slowed_down_gets_little_through_until_it_is_over() -> None:
    now_s = [0.0]
    inbox = FairInbox[Received](20_000, ROOMY, lambda: now_s[0])
    inbox.slow_down("responder/mad")
    for number in range(5000):
        now_s[0] += 0.001
        offer(inbox, message("mad", number))
        offer(inbox, message("r1", number))
    heard = Counter(sender_of(one.key) for one in taken(inbox))
    assert heard["responder/r1"] == 5000
    assert heard["responder/mad"] == pytest.approx(SLOWED_PER_S + 5.0 * SLOWED_PER_S, abs=2)
    assert inbox.lost() == {("slowed", "responder/mad"): 5000 - heard["responder/mad"]}
    now_s[0] += SLOWED_FOR_S
    for number in range(300):
        offer(inbox, message("mad", number))
    assert len(taken(inbox)) == 300


def test_what_is_too_long_is_counted_by_sender() -> None:
    inbox = FairInbox[Received](10, ROOMY)
    assert inbox.wanted(key_of("dap", "d1", "rssi"), LONGEST_HEARD_BYTES)
    assert not inbox.wanted(key_of("dap", "d1", "rssi"), LONGEST_HEARD_BYTES + 1)
    assert inbox.lost() == {("too_long", "dap/d1"): 1}


def test_who_waits_is_woken() -> None:
    inbox = FairInbox[Received](10, ROOMY)
    heard: list[Received] = []
    waiter = threading.Thread(target=lambda: heard.extend(inbox.get_some(5, DEADLINE_S)))
    waiter.start()
    inbox.put(message("r1", 7))
    waiter.join(DEADLINE_S)
    assert heard == [message("r1", 7)]


def test_room_for_one_is_refused() -> None:
    with pytest.raises(ValueError, match="two messages"):
        FairInbox[Received](1, ROOMY)
