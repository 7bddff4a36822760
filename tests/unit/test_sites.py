"""A further DAP is wanted where many pass who are badly known, and not beside one that stands."""

from __future__ import annotations

import math

import pytest

from command_post.coverage import COVERED_M, MOST_CELLS, Coverage, Site
from command_post.roster import DapRow, Roster
from command_post.web.board import Board
from shared.codec import encode
from shared.messages import LocalPosition, TrackEstimate


def track(responder_id: str, north_m: float, east_m: float, sd_m: float) -> TrackEstimate:
    return TrackEstimate(
        event_time_ns=1, sequence=0, responder_id=responder_id, north_m=north_m, east_m=east_m,
        down_m=0.0, covariance_m2=(sd_m**2, 0.0, sd_m**2), heading_rad=0.0, heading_sd_rad=0.1,
        last_proximity_time_ns=None,
    )  # fmt: skip


def dap(north_m: float, east_m: float) -> LocalPosition:
    return LocalPosition(
        north_m=north_m, east_m=east_m, down_m=0.0, covariance_m2=(0.1, 0.0, 0.1)
    )  # fmt: skip


def walked(sd_m: float = 3.0) -> Coverage:
    """Everybody goes north and comes by 20 m; r1 alone turns east there."""
    coverage = Coverage()
    for name in ("r1", "r2", "r3"):
        for step in range(21):
            coverage.take(track(name, float(step), 0.0, 0.5 + sd_m * step / 20.0))
    for step in range(1, 20):
        coverage.take(track("r1", 20.0, float(step), 6.0))
    return coverage


def test_the_best_site_is_where_all_pass_and_are_known_worst() -> None:
    first, *_ = walked().sites([dap(0.0, 0.0)])
    assert first.north_m > 16.0
    assert abs(first.east_m) < 3.0
    assert "passed 3 times by 3" in first.reason
    assert "m from the nearest DAP" in first.reason


def test_where_nobody_came_twice_nothing_is_gained() -> None:
    assert all(site.east_m < 3.0 for site in walked().sites([]))


def test_a_dap_that_stands_there_and_a_better_site_are_near_enough() -> None:
    sites = walked().sites([dap(20.0, 1.0)])
    places = [(site.north_m, site.east_m) for site in sites]
    assert all(20.0 - north_m >= COVERED_M - 1.0 for north_m, _ in places)
    assert len(places) == len({round(north_m / COVERED_M) for north_m, _ in places})
    gains = [site.gain_bits for site in sites]
    assert gains == sorted(gains, reverse=True)


def test_the_gain_is_the_information_of_a_tie() -> None:
    coverage = Coverage()
    for name in ("r1", "r2", "r3"):
        coverage.take(track(name, 0.0, 0.0, 3.0))
    # Three known to ±3 m, a tie to ±1 m: twice ½ log₂ det(P + R) / det(R), that is log₂ 1.9 each.
    (site,) = coverage.sites([])
    assert site.gain_bits == pytest.approx(2.0 * math.log2(1.9), abs=0.05)


def test_the_memory_is_bounded() -> None:
    coverage = Coverage()
    for step in range(MOST_CELLS + 10):
        coverage.take(track("r1", 3.0 * step, 0.0, 1.0))
    coverage.take(track("r2", 3.0 * (MOST_CELLS + 5), 0.0, 1.0))
    assert coverage.sites([]) == []


def test_the_page_is_told_of_sites_once_they_change() -> None:
    board = Board()
    for name in ("r1", "r2", "r3"):
        for step in range(0, 21, 2):
            board.publish(
                "clew/v1/test/post/post/track", encode(track(name, float(step), 0.0, 4.0))
            )
    place = dap(0.0, 0.0)
    row = DapRow("dap1", "installed", "at a known point", place, (0.2, 0.2), 1.0, None, None)
    roster = Roster(10**9, (), (row,))
    board.show(roster)
    told = board.since(0)
    assert told.sites
    assert isinstance(told.sites[0], Site)
    board.show(roster)
    assert board.since(told.version).sites is None
