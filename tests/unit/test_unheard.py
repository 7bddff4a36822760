"""Whose strides come no more, and whom others still hear: near those, and nobody is drawn along."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from command_post.fusion.team.known import Known, Span
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.team_tracker import TeamTracker
from command_post.fusion.track import Estimate
from shared.messages import Contact, LocalPosition, Message, PositionFix
from shared.units import NS_PER_S
from tests.stride_world import STRIDE_S, at_ns, installation, stride, track_start
from tests.unit.test_team_tracker import give, heard, peak_at

BEAT_S = 0.5
END_S = 170.0
NEVER, CUT_S = (0.0, 0.0), (90.0, 130.0)
LAST_S = 12.0
"""The last stride of who falls silent, 12 m north of where they began."""


def two_out() -> TeamTracker:
    """Return a team of two, one gone 12 m north and one 12 m east, and a DAP 30 m north."""
    tracker = TeamTracker(TeamSettings(axis=False))
    tracker.install("dap1", installation(0.0, None, (30.0, 0.0)))
    for responder_id in ("r1", "r2"):
        tracker.start(responder_id, track_start(0.0, heading_sd_rad=0.03))
    for k in range(10):
        time_s = LAST_S - STRIDE_S * (9 - k)
        tracker.move("r1", stride(time_s, 1.2, 0.0, sequence=k))
        tracker.move("r2", stride(time_s + 0.1, 0.0, 1.2, sequence=k))
    for responder_id in ("r1", "r2"):
        beat(tracker, responder_id, 0.0, LAST_S)
    return tracker


def beat(tracker: TeamTracker, responder_id: str, since_s: float, until_s: float) -> None:
    for time_s in np.arange(since_s, until_s + 0.01, BEAT_S).tolist():
        tracker.heard(responder_id, at_ns(time_s), BEAT_S)


def told_at(tracker: TeamTracker, time_s: float) -> Estimate:
    """Return where r1 is told to be once the other, who stands, has been heard of again."""
    beat(tracker, "r2", LAST_S, time_s)
    tracker.move("r2", stride(time_s, 0.0, 0.0, sequence=10))
    tracker.pass_time(at_ns(time_s))
    return tracker.estimates["r1"]


def sd_m(told: Estimate) -> float:
    return math.sqrt(max(told.covariance_m2[0], told.covariance_m2[2]))


def test_who_is_silent_is_where_a_dap_hears_them() -> None:
    tracker = two_out()
    alone = told_at(two_out(), 44.0)
    tracker.peak("dap1", peak_at(40.0, "r1"))
    told = told_at(tracker, 44.0)
    assert (told.north_m, told.east_m) == pytest.approx((30.0, 0.0), abs=1.0)
    # As far as a DAP tells, and as one may walk in four seconds.
    assert 2.0 < sd_m(told) < 3.5
    assert sd_m(alone) > 15.0
    assert told.status == "dead_reckoning"
    assert told.reason == "nothing heard for 32 s, but by dap1 4 s ago"
    later = told_at(tracker, 70.0)
    assert later.status == "lost"
    assert sd_m(later) == pytest.approx(15.0, abs=1.5)
    assert tracker.doubts == ()


def test_who_is_heard_far_off_is_there_all_the_same() -> None:
    tracker = two_out()
    tracker.install("dap2", installation(0.0, None, (50.0, 5.0)))
    tracker.peak("dap2", peak_at(40.0, "r1"))
    told = told_at(tracker, 44.0)
    assert (told.north_m, told.east_m) == pytest.approx((50.0, 5.0), abs=1.5)


def test_where_they_were_known_to_be_nothing_is_said_against() -> None:
    tracker = two_out()
    tracker.peak("dap1", peak_at(40.0, "r1"))
    told_at(tracker, 44.0)
    track = tracker.afterwards().tracks["r1"]
    time_s = track.time_s - at_ns(0.0) / NS_PER_S
    north_m = np.interp([LAST_S, 26.0, 40.0], time_s, track.position_m[:, 0])
    np.testing.assert_allclose(north_m, [12.0, 21.0, 30.0], atol=1.0)


@pytest.mark.parametrize("silent_id", ["r1", "r2"])
def test_whom_they_meet_is_not_drawn_along(silent_id: str) -> None:
    tracker = two_out()
    other_id = {"r1": "r2", "r2": "r1"}[silent_id]
    met = Contact(
        event_time_ns=at_ns(40.0), sequence=0, other_id=silent_id, peak_dbm=-45.0, width_s=1.0,
        sample_count=9,
    )  # fmt: skip
    beat(tracker, other_id, LAST_S, 44.0)
    before = tracker.estimates[other_id]
    tracker.contact(other_id, met)
    tracker.move(other_id, stride(44.0, 0.0, 0.0, sequence=10))
    tracker.pass_time(at_ns(44.0))
    one, other = tracker.estimates[silent_id], tracker.estimates[other_id]
    assert (other.north_m, other.east_m) == pytest.approx((before.north_m, before.east_m), abs=0.2)
    assert sd_m(other) < 1.0
    assert math.hypot(one.north_m - other.north_m, one.east_m - other.east_m) < 1.0
    assert one.reason == f"nothing heard for 32 s, but by {other_id} 4 s ago"


def test_a_commanders_word_of_who_is_silent_is_taken() -> None:
    tracker = two_out()
    place = LocalPosition(north_m=5.0, east_m=20.0, down_m=0.0, covariance_m2=(1.0, 0.0, 1.0))
    fix = PositionFix(
        event_time_ns=at_ns(40.0), sequence=0, responder_id="r1", source="commander", position=place
    )
    tracker.fix(fix)
    told = told_at(tracker, 44.0)
    assert (told.north_m, told.east_m) == pytest.approx((5.0, 20.0), abs=0.5)
    assert told.reason == "nothing heard for 32 s, but by somebody's word 4 s ago"


def test_who_stands_and_beats_is_where_they_stand() -> None:
    tracker = two_out()
    beat(tracker, "r1", LAST_S, 44.0)
    before = tracker.estimates["r1"]
    tracker.peak("dap1", peak_at(40.0, "r1", -49.0))
    told = told_at(tracker, 44.0)
    assert (told.north_m, told.east_m) == pytest.approx((before.north_m, before.east_m), abs=0.5)
    assert sd_m(told) < 1.0
    assert "nothing heard" not in told.reason


def test_strides_that_are_lost_for_good_leave_a_way_that_nobody_knows() -> None:
    tracker = two_out()
    tracker.peak("dap1", peak_at(40.0, "r1"))
    for k in range(40, 43):
        tracker.move("r1", stride(LAST_S + STRIDE_S * (k - 9), 1.2, 0.0, sequence=k))
    beat(tracker, "r1", 46.5, 50.0)
    told = told_at(tracker, 50.0)
    track = tracker.afterwards().tracks["r1"]
    time_s = track.time_s - at_ns(0.0) / NS_PER_S
    north_m = np.interp([LAST_S, 40.0], time_s, track.position_m[:, 0])
    np.testing.assert_allclose(north_m, [12.0, 30.0], atol=1.0)
    assert "nothing heard" not in told.reason
    # Of thirty strides that are lost some five came after they were heard.
    assert sd_m(told) < 8.0


def test_a_unit_that_begins_anew_does_not_say_that_they_stood() -> None:
    tracker = two_out()
    tracker.peak("dap1", peak_at(40.0, "r1"))
    tracker.start("r1", track_start(43.0, heading_sd_rad=3.1, sequence=1, placed=False))
    beat(tracker, "r1", 43.0, 44.0)
    told = told_at(tracker, 46.0)
    # They may have gone 1 m/s since the DAP heard them, and not for half a minute.
    assert (told.north_m, told.east_m) == pytest.approx((30.0, 0.0), abs=1.5)
    assert sd_m(told) < 6.0


def spoken(*, cut_s: tuple[float, float]) -> Iterator[tuple[str, Message | float]]:
    """Yield what a team and its units say in order: messages, and until when a unit has told all.

    The unit of r2 says nothing within ``cut_s``.
    """
    said: list[tuple[float, str, Message | float]] = [
        (message.event_time_ns / NS_PER_S - at_ns(0.0) / NS_PER_S, node, message)
        for node, message in heard(3)
        if message.event_time_ns < at_ns(END_S)
    ]
    beats = [(t, who, t) for who in ("r1", "r2", "r3") for t in range(1, round(END_S))]
    for time_s, node, what in sorted([*said, *beats], key=lambda each: (each[0], each[1])):
        if node != "r2" or not cut_s[0] < time_s < cut_s[1]:
            yield node, what


def take(tracker: TeamTracker, node_id: str, what: Message | float) -> None:
    if isinstance(what, int | float):
        tracker.heard(node_id, at_ns(what), 1.0)
    else:
        give(tracker, node_id, what)


def held(order: list[tuple[str, Message | float]], *, asked: bool = False) -> dict[str, Estimate]:
    """Return where all are held to be once all that was said has come in that order.

    Those who are silent are ``asked`` after time and again, or not at all.
    """
    tracker = TeamTracker(TeamSettings())
    for node_id, what in order:
        take(tracker, node_id, what)
        if asked and isinstance(what, int | float):
            tracker.pass_time(at_ns(what))
    tracker.move("r1", stride(END_S + 21.0, 0.0, 0.0, sequence=9999))
    return dict(tracker.estimates)


def test_late_strides_take_the_place_of_the_way_that_nobody_knew() -> None:
    whole = list(spoken(cut_s=NEVER))
    cut = list(spoken(cut_s=CUT_S))
    late = [each for each in whole if each not in cut]
    middle = next(
        at for at, (node, what) in enumerate(cut) if node == "r2" and what == math.ceil(CUT_S[1])
    )
    assert len(late) > 60
    assert held([*cut[:middle], *late, *cut[middle:]], asked=True) == held(whole)


@pytest.mark.parametrize("until_s", [CUT_S[1], END_S])
def test_the_order_of_arrival_leaves_no_trace_of_a_silence(until_s: float) -> None:
    cut = list(spoken(cut_s=(90.0, until_s)))
    chance = np.random.default_rng(7)
    scattered = [cut[index] for index in chance.permutation(len(cut))]
    in_order = held(cut)
    assert held(cut, asked=True) == in_order
    # So does one in which the silence is known of after all else.
    last = sorted(cut, key=lambda each: each[0] == "r2")
    assert held(last) == in_order
    assert held(scattered) == in_order


def test_moments_make_the_same_spans_in_any_order() -> None:
    chance = np.random.default_rng(5)
    times_ns = np.unique(chance.integers(0, 1000, 60)).tolist()
    spans = [[times_ns[0], times_ns[0]]]
    for time_ns in times_ns[1:]:
        if time_ns - spans[-1][1] > 20:
            spans.append([time_ns, time_ns])
        spans[-1][1] = time_ns
    assert 5 < len(spans) < 30
    for _ in range(5):
        known = Known()
        for time_ns in chance.permutation(times_ns).tolist():
            known.add(time_ns, 20)
        assert list(known.after(-1)) == [Span(*each) for each in spans]
        assert [known.add(time_ns, 20) for time_ns in times_ns] == [False] * len(times_ns)
        for time_ns in range(0, 1000, 7):
            before = [min(end, time_ns) for begin, end in spans if begin <= time_ns]
            assert known.by(time_ns) == max(before, default=0)
