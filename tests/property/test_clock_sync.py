"""The offset that is stated holds the true one, whatever the ways took, and however it drifts."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.clock_sync import MOST_DRIFT, RECENT_NS, Exchange, OffsetEstimator
from shared.units import NS_PER_S
from tests.faulty_clocks import FaultyClock

START_NS = 1_700_000_000 * NS_PER_S
DAY_NS = 86_400 * NS_PER_S

offsets_ns = st.integers(-400 * DAY_NS, 400 * DAY_NS)
drifts = st.floats(-0.95 * MOST_DRIFT, 0.95 * MOST_DRIFT)
delays_ns = st.integers(0, 5 * NS_PER_S)
ways = st.lists(
    st.tuples(st.integers(0, 1200 * NS_PER_S), delays_ns, st.integers(0, NS_PER_S), delays_ns),
    min_size=1,
    max_size=40,
)


def exchange_at(
    post: FaultyClock, asked_ns: int, there_ns: int, at_ns: int, back_ns: int
) -> Exchange:
    """Return an exchange of a node, whose clock is the true one, that takes so long each way."""
    heard_ns = asked_ns + there_ns
    answered_ns = heard_ns + at_ns
    return Exchange(asked_ns, post.at_ns(heard_ns), post.at_ns(answered_ns), answered_ns + back_ns)


@given(offset_ns=offsets_ns, drift=drifts, ways=ways, later_ns=st.integers(0, DAY_NS))
def test_the_true_offset_is_within_what_is_stated(
    offset_ns: int, drift: float, ways: list[tuple[int, int, int, int]], later_ns: int
) -> None:
    post = FaultyClock(offset_ns, drift, lambda: START_NS)
    estimator = OffsetEstimator()
    now_ns = START_NS
    for pause_ns, there_ns, at_ns, back_ns in ways:
        asked = exchange_at(post, now_ns + pause_ns, there_ns, at_ns, back_ns)
        # What the post thinks about for longer than the drift allows looks as if it went back.
        if asked.round_trip_ns < 0:
            continue
        assert estimator.take(asked)
        now_ns = asked.back_ns
        for at in (now_ns, now_ns + later_ns):
            known = estimator.at(at)
            assert known is not None
            true_ns = post.at_ns(at) - at
            assert abs(known.offset_ns - true_ns) <= known.uncertainty_ns
    assert estimator.steps == 0


@given(ways=ways, step_ns=st.integers(30 * NS_PER_S, DAY_NS), back=st.booleans())
def test_a_clock_that_is_set_is_followed_by_the_next_exchange(
    ways: list[tuple[int, int, int, int]], step_ns: int, back: bool
) -> None:
    post, estimator, now_ns = FaultyClock(0, 0.0, lambda: START_NS), OffsetEstimator(), START_NS
    for pause_ns, there_ns, at_ns, back_ns in ways:
        asked = exchange_at(post, now_ns + pause_ns, there_ns, at_ns, back_ns)
        estimator.take(asked)
        now_ns = asked.back_ns
    post.wrong_by_ns = -step_ns if back else step_ns
    asked = exchange_at(post, now_ns, NS_PER_S, 0, 0)
    assert estimator.take(asked)
    known = estimator.at(asked.back_ns)
    assert known is not None
    assert abs(known.offset_ns - post.wrong_by_ns) <= known.uncertainty_ns
    assert known.uncertainty_ns <= NS_PER_S
    assert estimator.steps == 1


@pytest.mark.parametrize("drift", [100e-6, -100e-6, 0.0])
def test_a_drift_that_was_found_is_carried_on_when_the_post_is_out_of_reach(drift: float) -> None:
    post, estimator = FaultyClock(40 * NS_PER_S, drift, lambda: START_NS), OffsetEstimator()
    for number in range(150):
        estimator.take(
            exchange_at(post, START_NS + number * 4 * NS_PER_S, 9_000_000, 10_000, 4_000_000)
        )
    heard_last_ns = START_NS + 600 * NS_PER_S
    for silent_s, most_ns in ((0, 10_000_000), (600, 35_000_000), (3600, 150_000_000)):
        now_ns = heard_last_ns + silent_s * NS_PER_S
        known = estimator.at(now_ns)
        assert known is not None
        assert abs(known.offset_ns - (post.at_ns(now_ns) - now_ns)) <= known.uncertainty_ns
        assert known.uncertainty_ns <= most_ns
        assert known.drift == pytest.approx(drift, abs=30e-6)


def test_the_shortest_round_trip_of_the_last_minute_counts() -> None:
    estimator = OffsetEstimator()
    quick = Exchange(START_NS, START_NS + 1_000_000, START_NS + 1_000_000, START_NS + 2_000_000)
    estimator.take(quick)
    for number in range(1, 10):
        asked_ns = START_NS + number * 4 * NS_PER_S
        estimator.take(Exchange(asked_ns, asked_ns, asked_ns, asked_ns + 200_000_000))
    known = estimator.at(START_NS + 36 * NS_PER_S)
    assert known is not None
    assert known.offset_ns == pytest.approx(0, abs=1_000_000)
    estimator.take(Exchange(*(4 * [START_NS + 2 * RECENT_NS])))
    known = estimator.at(START_NS + 2 * RECENT_NS)
    assert known is not None
    assert known.uncertainty_ns <= 2


@pytest.mark.parametrize("times", [(10, 0, 0, 5), (0, 10, 5, 20), (0, 0, 100, 20)])
def test_what_cannot_have_been_is_passed_over(times: tuple[int, int, int, int]) -> None:
    estimator = OffsetEstimator()
    assert not estimator.take(Exchange(*times))
    assert estimator.at(0) is None
