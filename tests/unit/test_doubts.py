"""One thing wrong with a patrol is named soon and does little harm; else nothing is doubted."""

from __future__ import annotations

import math
from bisect import bisect_left
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from command_post.fusion.interface import Doubt
from command_post.fusion.team.doubt_words import doubts_of
from command_post.fusion.team.doubts import (
    MOST_TRIED_OF_CROWD,
    PRICE,
    tried_of_crowd,
    with_one_more,
)
from command_post.fusion.team.estimates import estimate_of, first_pose
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import Held
from command_post.fusion.team.suspicions import Suspicion
from command_post.fusion.team.team_tracker import TeamTracker
from command_post.fusion.team.way_since import Ways
from shared.messages import (
    LocalPosition,
    Message,
    OdometryIncrement,
    PositionFix,
    RssiPeak,
)
from shared.units import NS_PER_S
from tests.patrol_world import Faults, patrol
from tests.stride_world import START_NS, at_ns, stride, track_start
from tests.unit.test_team_tracker import give

COMMIT_S = 10.0
LASTS_S = 300.0
"""Of a patrol's some 400 s: all that is looked at has come out by then."""


class Fused(NamedTuple):
    """What became of a patrol.

    ``named_s``: when each doubt was first raised; ``off_m`` (n, 2): time, error, by responder.
    """

    tracker: TeamTracker
    named_s: dict[tuple[str, str], float]
    off_m: dict[str, NDArray[np.float64]]

    @property
    def names(self) -> set[tuple[str, str]]:
        """What is doubted of whom in the end."""
        return {(doubt.kind, doubt.node_id) for doubt in self.tracker.doubts}

    def mean_m(self, responder_id: str, since_s: float) -> float:
        """Return a responder's mean error since a time."""
        time_s, off_m = self.off_m[responder_id].T
        return float(off_m[time_s > since_s].mean())


@cache
def fused(
    seed: int, faults: Faults | None, *, doubting: bool = True, lasts_s: float = LASTS_S
) -> Fused:
    """Return what became of a patrol's first ``lasts_s``, made once for all that look at it."""
    world = patrol(seed, faults)
    tracker = TeamTracker(TeamSettings(doubts=doubting))
    named_s: dict[tuple[str, str], float] = {}
    off_m: dict[str, list[tuple[float, float]]] = {name: [] for name in world.ways}
    for node_id, message in world.heard:
        time_s = (message.event_time_ns - START_NS) / 1e9
        if time_s > lasts_s:
            break
        give(tracker, node_id, message)
        if isinstance(message, OdometryIncrement):
            clock = faults.ahead_s if faults else None
            own_s = time_s - (clock[1] if clock and clock[0] == node_id else 0.0)
            place_m = world.place_m(node_id, own_s)
            held = tracker.estimates[node_id]
            off = math.hypot(held.north_m - place_m[0], held.east_m - place_m[1])
            off_m[node_id].append((time_s, off))
        for doubt in tracker.doubts:
            named_s.setdefault((doubt.kind, doubt.node_id), time_s)
    return Fused(tracker, named_s, {name: np.array(each) for name, each in off_m.items()})


@pytest.mark.parametrize("seed", range(6))
def test_nothing_is_doubted_where_nothing_is_wrong(seed: int) -> None:
    assert fused(seed, None).named_s == {}


@pytest.mark.parametrize(
    ("faults", "name", "sufferer", "commits"),
    [
        (Faults(since_s=120.0, swapped=("r4", "r1")), ("swapped", "r4"), "r1", 5),
        (Faults(renewed=("r3", math.radians(110.0))), ("renewed", "r3"), "r3", 6),
        (Faults(since_s=60.0, ahead_s=("r2", 2.0)), ("clock", "r2"), "r2", 16),
    ],
    ids=lambda each: each[0] if isinstance(each, tuple) else "",
)
def test_what_is_wrong_with_a_responder_is_named_and_does_half_the_harm(
    faults: Faults, name: tuple[str, str], sufferer: str, commits: int
) -> None:
    with_doubts, without = fused(1, faults), fused(1, faults, doubting=False)
    assert with_doubts.named_s[name] < faults.since_s + commits * COMMIT_S
    assert name in with_doubts.names
    assert {kind for kind, _ in with_doubts.named_s} == {name[0]}
    since_s = faults.since_s + commits * COMMIT_S
    assert with_doubts.mean_m(sufferer, since_s) < 0.5 * without.mean_m(sufferer, since_s)


def test_strides_a_fifth_too_long_are_named_and_do_little_harm_before() -> None:
    faults = Faults(since_s=60.0, scale=("r3", 1.2))
    with_doubts, without = fused(1, faults), fused(1, faults, doubting=False)
    since_s = faults.since_s + 13 * COMMIT_S
    assert with_doubts.named_s.keys() == {("scale", "r3")}
    assert with_doubts.named_s["scale", "r3"] < since_s
    assert max(each.mean_m("r3", since_s) for each in (with_doubts, without)) < 0.5


def test_a_dap_that_was_moved_is_named_and_found_again() -> None:
    found = fused(1, Faults(moved=("dap4", (3.0, 30.0))))
    lost = fused(1, Faults(moved=("dap4", (3.0, 30.0))), doubting=False)
    assert found.named_s.keys() == {("moved", "dap4")}
    assert found.named_s["moved", "dap4"] < 150.0 + 5 * COMMIT_S
    (doubt,) = found.tracker.doubts
    assert 140.0 < (doubt.since_ns - START_NS) / 1e9 < 180.0
    assert _off_m(found) < 2.0
    assert _off_m(lost) > 10.0


def _off_m(after: Fused) -> float:
    place = after.tracker.daps["dap4"].position
    return math.hypot(place.north_m - 3.0, place.east_m - 30.0)


def test_a_jammed_dap_is_named_and_not_used() -> None:
    faults = Faults(astray="dap4")
    clean, found = fused(2, None), fused(2, faults)
    harmed = fused(2, faults, doubting=False)
    assert found.named_s.keys() == {("astray", "dap4")}
    assert found.named_s["astray", "dap4"] < faults.since_s + 5 * COMMIT_S

    def harm_m(after: Fused) -> float:
        return sum(after.mean_m(name, 200.0) - clean.mean_m(name, 200.0) for name in clean.off_m)

    assert harm_m(found) < 0.5 * harm_m(harmed)


def test_a_daps_clock_is_put_right() -> None:
    found = fused(2, Faults(ahead_s=("dap4", 2.0)))
    assert found.named_s.keys() == {("clock", "dap4")}
    (doubt,) = found.tracker.doubts
    assert isinstance(doubt, Doubt)
    assert doubt.words == "clock 2.0 s ahead"
    assert 0.9 < doubt.certainty < 1.0


def test_a_clock_far_off_is_put_right_and_no_other_is_doubted_for_it() -> None:
    found = fused(0, Faults(ahead_s=("r2", 10.0)), lasts_s=150.0)
    assert found.named_s.keys() == {("clock", "r2")}
    (doubt,) = found.tracker.doubts
    assert 9.5 <= float(doubt.words.split()[1]) <= 10.5
    assert found.mean_m("r2", 130.0) < 1.5


def test_a_clock_that_is_further_off_than_was_held_is_held_to_be_so_by_both() -> None:
    once = Suspicion("clock", "responder", "r2", 0, ahead_s=6.0)
    more, another = once._replace(ahead_s=2.5), once._replace(node_id="r3")
    held = (Held(once, 30.0, stood=True), Held(another, 25.0))
    assert with_one_more(held, Held(more, 28.0)) == (
        held[1], Held(once._replace(ahead_s=8.5), 58.0, stood=True),
    )  # fmt: skip
    moved = Held(Suspicion("moved", "dap", "dap4", 0), 40.0)
    assert with_one_more(held, moved) == (*held, moved)


def test_whose_clock_is_ahead_is_dated_by_the_others() -> None:
    found = fused(1, Faults(since_s=60.0, ahead_s=("r2", 2.0)))
    after = found.tracker.afterwards()
    for name, ahead_s in {"r1": 0.0, "r2": 2.0, "r3": 0.0}.items():
        told_s = START_NS / 1e9 + float(found.off_m[name][-1, 0])
        assert after.tracks[name].time_s[-1] == pytest.approx(told_s - ahead_s, abs=1e-5)


def test_an_estimate_is_dated_on_the_clock_of_the_post() -> None:
    log = TeamLog()
    log.add_start("r2", track_start(0.0))
    log.add_move("r2", stride(10.0, 1.2, 0.0, sequence=1))
    own, settings = log.responders["r2"], TeamSettings()
    pose = first_pose(own, settings)._replace(ahead_ns=2 * NS_PER_S)
    for now_s, told_s in ((0.0, 8.0), (9.0, 9.0)):
        since = Ways(settings).of("r1", own.moves, pose.time_ns)
        told = estimate_of(pose, since, own, at_ns(now_s), (), settings)
        assert told.time_ns == at_ns(told_s)


def test_what_is_hardly_likelier_is_told_once_it_has_stood() -> None:
    suspicion = Suspicion("moved", "dap", "dap4", 0)
    hardly, surely = PRICE["moved"] + 1.0, PRICE["moved"] + 10.0
    assert doubts_of((Held(suspicion, hardly),)) == ()
    for held in (Held(suspicion, hardly, stood=True), Held(suspicion, surely)):
        (doubt,) = doubts_of((held,))
        assert (doubt.kind, doubt.node_id) == ("moved", "dap4")


def test_what_one_responder_alone_contradicts_is_told_once_it_has_stood() -> None:
    moved = Held(Suspicion("moved", "dap", "dap4", 0), PRICE["moved"] + 30.0, of_one=True)
    assert doubts_of((moved,)) == ()
    assert [each.node_id for each in doubts_of((moved._replace(stood=True),))] == ["dap4"]


def test_radios_that_are_swapped_back_are_doubted_no_more() -> None:
    once = Held(Suspicion("swapped", "responder", "r1", 0, "r3"), 90.0)
    back = Held(Suspicion("swapped", "responder", "r3", at_ns(100.0), "r1"), 90.0)
    other = Held(Suspicion("swapped", "responder", "r1", 0, "r2"), 90.0)
    assert {each.node_id for each in doubts_of((once,))} == {"r1", "r3"}
    assert doubts_of((once, back)) == ()
    assert {each.node_id for each in doubts_of((once, other, back))} == {"r1", "r2"}


def test_of_a_crowd_all_else_that_may_be_is_tried_by_turns_beside_what_is_held() -> None:
    at_once = tried_of_crowd(7, again=False)
    by_turns = [at for number in range(8, 12) for at in tried_of_crowd(number, again=True)]
    assert len(at_once) == MOST_TRIED_OF_CROWD
    assert sorted(by_turns) == list(at_once)


def test_who_is_doubted_says_so_in_the_estimate() -> None:
    found = fused(1, Faults(swapped=("r1", "r3")))
    assert "radio swapped with r3" in found.tracker.estimates["r1"].reason
    assert "radio swapped" not in found.tracker.estimates["r2"].reason


def test_doubts_leave_no_trace_of_the_order_of_arrival() -> None:
    heard = patrol(1, Faults(swapped=("r1", "r3"))).heard[:700]
    in_order, late = TeamTracker(TeamSettings()), TeamTracker(TeamSettings())
    held_back = [each for each in heard if isinstance(each[1], RssiPeak)]
    others = [each for each in heard if not isinstance(each[1], RssiPeak)]
    middle = len(held_back) // 2
    for tracker, told in (
        (in_order, heard),
        (late, [*others[:450], *held_back[:middle], *others[450:], *held_back[middle:]]),
    ):
        for node_id, message in told:
            give(tracker, node_id, message)
    assert {doubt.kind for doubt in in_order.doubts} == {"swapped"}
    one, other = in_order.afterwards(), late.afterwards()
    assert one.daps == other.daps
    for responder_id, track in one.tracks.items():
        assert np.array_equal(track.position_m, other.tracks[responder_id].position_m)


def test_who_did_not_begin_where_that_was_said_is_named_and_put_right() -> None:
    faults = Faults(begins_off_m=("r1", 15.0))
    found = fused(1, faults, lasts_s=110.0)
    assert found.named_s.keys() == {("misplaced", "r1")}
    assert found.named_s["misplaced", "r1"] < 90.0
    assert max(found.mean_m(each, 90.0) for each in found.off_m) < 1.5
    assert fused(1, faults, doubting=False, lasts_s=110.0).mean_m("r1", 90.0) > 3.0


def test_a_word_far_off_is_named_and_any_other_is_not() -> None:
    world = patrol(1)
    words = {100.0: 50.0, 110.0: 2.0}
    told = [("r2", _word(world.place_m("r2", at_s), at_s, off)) for at_s, off in words.items()]
    tracker = TeamTracker(TeamSettings())
    heard = sorted([*world.heard, *told], key=lambda each: (each[1].event_time_ns, each[0]))
    for node_id, message in heard[: bisect_left(heard, at_ns(160.0), key=_when)]:
        if isinstance(message, PositionFix):
            tracker.fix(message)
        give(tracker, node_id, message)
    (doubt,) = tracker.doubts
    assert (doubt.kind, doubt.node_id, doubt.since_ns) == ("misplaced", "r2", at_ns(100.0))


def _when(heard: tuple[str, Message]) -> int:
    return heard[1].event_time_ns


def _word(place_m: NDArray[np.float64], time_s: float, off_m: float) -> PositionFix:
    position = LocalPosition(
        north_m=place_m[0] + off_m, east_m=place_m[1], down_m=0.0, covariance_m2=(4.0, 0.0, 4.0)
    )
    return PositionFix(
        event_time_ns=at_ns(time_s), sequence=0, responder_id="r2", source="gnss",
        position=position,
    )  # fmt: skip


def test_what_one_dap_alone_contradicts_is_held_against_nobody_who_passes_it() -> None:
    found = fused(1, Faults(carried=("dap4", "r3")), lasts_s=250.0)
    assert {node_id for _, node_id in found.named_s} <= {"dap4"}
    assert found.mean_m("r3", 150.0) < 1.5


def test_no_more_than_a_quarter_of_all_daps_is_doubted() -> None:
    """Who finds most of them wrong is more likely wrong: here two are, of six."""
    seen = fused(2, Faults(moved=("dap4", (12.0, 15.0)), astray="dap3"))
    doubted = {node_id for _, node_id in seen.names if node_id.startswith("dap")}
    assert len(doubted) == 1
