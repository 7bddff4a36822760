"""Strides that nobody told of are supposed where just as much time is missing as they take."""

from __future__ import annotations

import math

import pytest
from msgspec.structs import replace

from command_post.fusion.team.chain import Chain, chain_of
from command_post.fusion.team.log import END_OF_TIME_NS, TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.team_tracker import TeamTracker
from command_post.fusion.team.unseen import MORE
from tests.stride_world import STRIDE_S, at_ns, stride, track_start

SETTINGS = TeamSettings(axis=False)
STRIDE_M = 1.2
STRIDES = 20


def chain(
    untold: set[int], *, renumbered: bool = True, pause_s: float = 0.0, swing_s: float = STRIDE_S
) -> Chain:
    """Return the chain of one who goes north, of whose strides some are not told.

    Numbers show nothing of that if they are ``renumbered``. In mid-way they pause; the unit dates
    only the last ``swing_s`` of each stride.
    """
    log = TeamLog()
    log.add_start("r1", track_start(0.0, heading_sd_rad=0.01))
    sequence = 0
    for k in range(STRIDES):
        if k not in untold:
            end_s = 2.0 + k * STRIDE_S + (pause_s if k >= STRIDES // 2 else 0.0)
            told = stride(end_s, STRIDE_M, 0.0, sequence=sequence if renumbered else k)
            log.add_move("r1", replace(told, start_time_ns=at_ns(end_s - swing_s)))
            sequence += 1
    found = chain_of("r1", log.responders["r1"], END_OF_TIME_NS, SETTINGS)
    assert found is not None
    return found


def length_m(found: Chain) -> float:
    return float(found.way_m[-1, 0])


def test_a_stride_that_goes_unnoticed_is_supposed_as_surely_as_it_may_be() -> None:
    whole, short = chain(set()), chain({7})
    supposed_m = MORE * SETTINGS.unseen_share * STRIDE_M
    assert length_m(whole) == pytest.approx(STRIDES * STRIDE_M)
    assert length_m(short) == pytest.approx((STRIDES - 1) * STRIDE_M + supposed_m)
    sd_m = math.sqrt(short.variance[-1, 0] - whole.variance[-1, 0])
    assert abs(STRIDE_M - supposed_m) < sd_m < STRIDE_M
    assert short.variance[-1, 1] > whole.variance[-1, 1]


def test_in_the_middle_of_an_unseen_stride_its_wearer_is_half_way() -> None:
    _, north_m, _ = chain({7}).nearest(at_ns(2.0 + 7.0 * STRIDE_S))
    assert abs(north_m) == pytest.approx(0.5 * (1.0 + MORE * SETTINGS.unseen_share) * STRIDE_M)


@pytest.mark.parametrize("pause_s", [0.4, 1.7, 30.0])
def test_a_pause_is_no_stride(pause_s: float) -> None:
    assert length_m(chain(set(), pause_s=pause_s)) == pytest.approx(STRIDES * STRIDE_M)


def test_a_foot_at_rest_between_two_swings_misses_nothing() -> None:
    half_s = 0.5 * STRIDE_S
    told, short = (chain(untold, swing_s=half_s) for untold in (set(), {7}))
    assert length_m(told) == pytest.approx(STRIDES * STRIDE_M)
    assert length_m(short) > (STRIDES - 0.5) * STRIDE_M


def test_two_lost_on_the_way_are_supposed_by_their_numbers_alone() -> None:
    lost, unnoticed = (chain({7, 8}, renumbered=renumbered) for renumbered in (False, True))
    told_m = (STRIDES - 2) * STRIDE_M
    assert length_m(lost) == pytest.approx(told_m + 2.0 * SETTINGS.unseen_share * STRIDE_M)
    assert length_m(unnoticed) == pytest.approx(told_m)


def test_what_goes_unseen_is_in_the_live_estimate_at_once() -> None:
    tracker = TeamTracker(SETTINGS)
    tracker.start("r1", track_start(0.0, heading_sd_rad=0.01))
    for k in (0, 1, 3):
        tracker.move("r1", stride(0.2 + k * STRIDE_S, STRIDE_M, 0.0, sequence=k))
    assert tracker.estimates["r1"].north_m == pytest.approx(
        (3.0 + SETTINGS.unseen_share) * STRIDE_M, abs=0.05
    )
