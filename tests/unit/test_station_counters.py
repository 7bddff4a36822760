"""One poll is one sample, and only of those whose counters moved."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.radios.nl80211_stations import polled_station
from shared.radios.readings import Reading
from shared.radios.station_counters import Polled, StationCounters
from tests.netlink_answers import IFINDEX, attribute, message, station

nl80211 = pytest.importorskip("pyroute2.netlink.nl80211", reason="pyroute2 is for Linux")

A, B = "02:00:5e:10:00:01", "02:00:5e:10:00:02"


def answer(raw: bytes) -> Polled | None:
    """Return what is made of a kernel's message, taken apart by the library that the DAP uses."""
    decoded = nl80211.nl80211cmd(raw)
    decoded.decode()
    return polled_station(decoded)


def test_the_kernels_answer_is_taken_apart() -> None:
    raw = station(
        A, packets=1000, inactive_ms=12, signal_dbm=-50, average_dbm=-52, chains_dbm=(-53, -55)
    )
    assert answer(raw) == Polled(A, (1000, 100_000), -50.0, -52.0, (-53.0, -55.0), 12)


def test_a_driver_that_tells_little_is_believed_as_far_as_it_goes() -> None:
    assert answer(station(A, packets=3)) == Polled(A, (3, 300))
    # 0 dBm is what drivers say who know none.
    assert answer(station(A, packets=3, signal_dbm=0, average_dbm=-61)) == Polled(
        A, (3, 300), None, -61.0
    )


def test_an_answer_of_no_station_is_passed_over() -> None:
    assert answer(message(attribute(IFINDEX, b"\4\0\0\0"))) is None


def polled(address: str, packets: int, dbm: float | None = -50.0) -> Polled:
    return Polled(address, (packets,), dbm, -60.0, (), 30)


def addresses(readings: tuple[Reading, ...]) -> list[str]:
    return [reading.address for reading in readings]


def test_who_has_not_been_heard_since_is_not_reported() -> None:
    counters = StationCounters()
    assert counters.readings([polled(A, 5), polled(B, 9)]) == ()
    assert counters.readings([polled(A, 6), polled(B, 9)]) == (
        Reading(A, -50.0, 30_000_000, -60.0, ()),
    )
    assert counters.readings([polled(A, 6), polled(B, 9)]) == ()
    assert addresses(counters.readings([polled(A, 7), polled(B, 10)])) == [A, B]


def test_who_comes_has_been_heard_and_who_comes_back_too() -> None:
    counters = StationCounters()
    counters.readings([])
    assert addresses(counters.readings([polled(A, 1)])) == [A]
    assert counters.readings([]) == ()
    assert addresses(counters.readings([polled(A, 1)])) == [A]


def test_after_a_radio_was_away_the_first_poll_compares_with_nothing() -> None:
    counters = StationCounters()
    counters.readings([polled(A, 1)])
    counters.forget()
    assert counters.readings([polled(A, 900)]) == ()
    assert addresses(counters.readings([polled(A, 901)])) == [A]


def test_the_running_mean_stands_for_a_frame_without_a_signal() -> None:
    counters = StationCounters()
    counters.readings([])
    (reading,) = counters.readings([polled(A, 1, dbm=None)])
    assert reading.rssi_dbm == -60.0
    assert counters.readings([Polled(A, (2,))]) == ()


@given(st.lists(st.dictionaries(st.sampled_from([A, B]), st.integers(0, 3)), max_size=20))
def test_nobody_is_reported_more_often_than_their_counters_move(
    polls: list[dict[str, int]],
) -> None:
    counters = StationCounters()
    reported = [
        addresses(counters.readings([polled(address, count) for address, count in poll.items()]))
        for poll in polls
    ]
    for before, poll, heard in zip([{}, *polls], polls, reported, strict=False):
        moved = [each for each in poll if before.get(each) != poll[each]]
        assert heard == ([] if poll is polls[0] else moved)
