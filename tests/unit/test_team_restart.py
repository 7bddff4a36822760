"""A unit that begins anew amid a building whose axis is known, its own heading unknown.

The axis is alike modulo a right angle: it must not make sure of one of four headings.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest

from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.team_tracker import TeamTracker
from command_post.fusion.track import Estimate
from shared.messages import RssiPeak
from tests.stride_world import STRIDE_M, STRIDE_S, at_ns, installation, stride, track_start

UNKNOWN_SD_RAD = math.pi / math.sqrt(3.0)
LEGS = [(0.0, 20), (90.0, 15), (180.0, 20), (270.0, 15)]
"""A ring corridor: which way (degrees), and how many strides."""
REACH = math.sqrt(5.99)
"""In standard deviations, of the 95 % region of a Gaussian in the plane."""


class Walked(NamedTuple):
    """Where a responder was held to be, and how far off that was."""

    estimate: Estimate
    error_m: float

    @property
    def is_held_likely(self) -> bool:
        """Whether they were within the ellipse that was told."""
        nn, _, ee = self.estimate.covariance_m2
        return self.error_m < REACH * math.sqrt(max(nn, ee))


def walked(turned_rad: float, silent_s: float) -> list[Walked]:
    """Walk the ring corridor twice, the unit beginning anew at the start of the second round.

    It does so after ``silent_s``, its new frame turned by ``turned_rad``. On the second leg of each
    round a DAP is passed.
    """
    tracker = TeamTracker(TeamSettings())
    tracker.install("dap1", installation(0.0, None, (20 * STRIDE_M, 8 * STRIDE_M)))
    tracker.start("r1", track_start(0.0, heading_sd_rad=0.05))
    ways_rad = [math.radians(way) for way, count in LEGS * 2 for _ in range(count)]
    chance = np.random.default_rng(5)
    place_m, time_s, anew = 0j, 2.0, len(ways_rad) // 2
    since = []
    for number, way_rad in enumerate(ways_rad):
        if number == anew:
            time_s += silent_s
            start = track_start(time_s, UNKNOWN_SD_RAD, sequence=1, placed=False)
            tracker.start("r1", start)
        time_s += STRIDE_S
        place_m += STRIDE_M * complex(math.cos(way_rad), math.sin(way_rad))
        own_rad = way_rad - (turned_rad if number >= anew else 0.0)
        d_north_m, d_east_m = STRIDE_M * np.array([math.cos(own_rad), math.sin(own_rad)])
        jitter_m = 0.02 * chance.standard_normal(2)
        told = stride(time_s, d_north_m + jitter_m[0], d_east_m + jitter_m[1], sequence=number)
        tracker.move("r1", told)
        if number % anew == 27:
            peak = RssiPeak(event_time_ns=at_ns(time_s), sequence=number, responder_id="r1",
                            peak_dbm=-40.0, width_s=1.0, sample_count=9)  # fmt: skip
            tracker.peak("dap1", peak)
        if number >= anew:
            estimate = tracker.estimates["r1"]
            off_m = complex(estimate.north_m, estimate.east_m) - place_m
            since.append(Walked(estimate, abs(off_m)))
    return since


@pytest.mark.parametrize(("turned_deg", "silent_s"), [(-90.0, 0.1), (90.0, 3.0), (180.0, 1.0)])
def test_an_axis_does_not_tell_a_new_unit_which_of_four_ways_it_goes(
    turned_deg: float, silent_s: float
) -> None:
    since = walked(math.radians(turned_deg), silent_s)
    before_a_pass, long_after = since[:27], since[45:]
    for each in before_a_pass:
        assert each.estimate.heading_sd_rad > 1.0
        assert each.estimate.status == "recovering"
        assert "which way is not yet known" in each.estimate.reason
        assert each.is_held_likely
    for each in long_after:
        assert each.estimate.status == "tracking"
        assert each.estimate.reason == ""
        assert each.error_m < 2.0
