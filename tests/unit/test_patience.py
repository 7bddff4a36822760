"""What of a flood is looked at and kept."""

from __future__ import annotations

import pytest

from command_post.nodes.patience import (
    BURST_BYTES,
    BURST_BYTES_IN_ALL,
    BURST_MESSAGES,
    BYTES_PER_S,
    MESSAGES_PER_S,
    MOST_SENDERS,
    Patience,
)
from shared.token_bucket import TokenBucket


def test_a_bucket_gives_its_burst_then_its_rate() -> None:
    bucket = TokenBucket(per_s=2.0, burst=10.0, now_s=5.0)
    assert bucket.take(10.0, 5.0)
    assert not bucket.take(1.0, 5.4)
    assert bucket.take(1.0, 5.5)
    assert not bucket.holds(10.5, 1e9), "no more than the burst, however long"
    assert not bucket.take(1.0, 0.0) or bucket.take(9.0, 0.0), (
        "a clock that is behind gives nothing"
    )


def test_garbage_is_borne_up_to_a_burst_and_then_at_a_rate() -> None:
    patience = Patience(0.0)
    borne = sum(patience.charge("responder/mad", 10, 0.0) for _ in range(3 * BURST_MESSAGES))
    assert borne == BURST_MESSAGES
    assert not patience.bears("responder/mad", 10, 0.0)
    assert patience.bears("responder/r1", 10, 0.0)
    later = sum(patience.charge("responder/mad", 10, 100.0) for _ in range(3 * BURST_MESSAGES))
    assert later == pytest.approx(min(BURST_MESSAGES, 100.0 * MESSAGES_PER_S))


def test_large_garbage_is_bounded_by_its_bytes() -> None:
    patience = Patience(0.0)
    size = 60_000
    kept = sum(patience.charge("responder/mad", size, float(now_s)) for now_s in range(1000)) * size
    assert BURST_BYTES - size < kept <= BURST_BYTES + 1000 * BYTES_PER_S


def test_all_together_are_bounded_and_so_is_what_is_remembered_of_them() -> None:
    patience = Patience(0.0)
    senders = [f"responder/r{number}" for number in range(MOST_SENDERS + 500)]
    kept = sum(patience.charge(sender, 50_000, 0.0) for sender in senders) * 50_000
    assert kept <= BURST_BYTES_IN_ALL
    for sender in senders:
        patience.count(sender)
    assert len(patience.only_counted) <= MOST_SENDERS + 1
    assert patience.only_counted.total() == len(senders)
