"""The boot mount, on a boot whose motion is a formula."""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Iterable

import numpy as np
import pytest

from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD
from edge_agent.mounts.boot import BootMount, BootSettings
from edge_agent.mounts.intake import RESTART_AFTER
from edge_agent.mounts.interface import Increment
from shared.messages import ImuSample
from shared.units import NS_PER_S
from tests.synthetic_boot import BROKEN_READINGS, SyntheticWalk


def follow(mount: BootMount, samples: Iterable[ImuSample]) -> list[Increment]:
    return [found for sample in samples if (found := mount.step(sample)) is not None]


def total_m(increments: list[Increment]) -> tuple[float, float, float]:
    north, east, down = np.sum([i.displacement_m for i in increments], axis=0)
    return float(north), float(east), float(down)


@pytest.mark.parametrize(
    ("rate_hz", "off_m"),
    [(50.0, 6e-3), (100.0, 2e-3), (200.0, 1e-3), (397.7, 1e-3), (1000.0, 1e-3)],
)
def test_an_error_free_walk_comes_out_right_at_any_rate(rate_hz: float, off_m: float) -> None:
    walk = SyntheticWalk(rise_m=0.17, turn_rad=0.3)
    increments = follow(BootMount(), walk.samples(rate_hz))
    assert len(increments) == walk.strides
    places = np.array(walk.stance_places_m)
    for increment, stride in zip(increments, np.diff(places, axis=0), strict=True):
        assert increment.displacement_m == pytest.approx(tuple(stride), abs=off_m)
        assert increment.d_heading_rad == pytest.approx(walk.turn_rad, abs=2e-3)
    assert increments[-1].heading_rad == pytest.approx(walk.strides * walk.turn_rad, abs=5e-3)


def test_a_stride_is_told_within_the_delay_of_its_end() -> None:
    mount = BootMount()
    for sample in SyntheticWalk().samples(100.0):
        increment = mount.step(sample)
        if increment is not None:
            lag_s = (sample.time_ns - increment.end_time_ns) / NS_PER_S
            assert lag_s <= BootSettings().stance.delay_s + 0.02


def test_the_last_stride_of_a_recording_is_told_at_its_end() -> None:
    walk = SyntheticWalk()
    mount = BootMount()
    end_ns = round((walk.stance_times_s[-1] + 0.05) * NS_PER_S)
    cut = [sample for sample in walk.samples(100.0) if sample.time_ns < end_ns]
    assert len(follow(mount, cut)) == walk.strides - 1
    (last,) = mount.finish()
    assert last.displacement_m == pytest.approx((1.2, 0.0, 0.0), abs=0.01)
    assert mount.finish() == []


def test_increments_follow_one_another_and_their_paths_lead_through_them() -> None:
    increments = follow(BootMount(), SyntheticWalk().samples(200.0))
    for before, after in itertools.pairwise(increments):
        assert before.start_time_ns < before.end_time_ns < after.start_time_ns
    for increment in increments:
        assert increment.path[0] == (increment.start_time_ns, 0.0, 0.0, 0.0)
        assert increment.path[-1] == (increment.end_time_ns, *increment.displacement_m)


def test_who_only_stands_makes_no_increment() -> None:
    mount = BootMount()
    assert follow(mount, SyntheticWalk(strides=0, standing_s=10.0).samples(100.0)) == []
    assert mount.ready


def test_turning_on_the_spot_is_told_with_the_next_stride() -> None:
    walk = SyntheticWalk(strides=1, standing_s=3.0)

    def pivoted() -> Iterable[ImuSample]:
        for sample in walk.samples(100.0):
            turning = 4.0 <= sample.time_ns / NS_PER_S < 5.0
            yield ImuSample(
                sample.time_ns, sample.force_m_s2, (0.0, 0.0, 1.0) if turning else sample.rate_rad_s
            )
        for sample in walk.samples(100.0, start_s=2.0):
            later_ns = sample.time_ns + round((walk.duration_s - 1.99) * NS_PER_S)
            yield ImuSample(later_ns, sample.force_m_s2, sample.rate_rad_s)

    first, second = follow(BootMount(), pivoted())
    assert first.d_heading_rad == pytest.approx(0.0, abs=1e-6)
    assert second.d_heading_rad == pytest.approx(1.0, abs=0.02)
    north, east, _ = second.displacement_m
    assert math.atan2(east, north) == pytest.approx(1.0, abs=0.02)


def test_without_a_magnetometer_the_heading_is_zero_and_unknown() -> None:
    mount = BootMount()
    increments = follow(mount, SyntheticWalk(heading_rad=1.0).samples(100.0))
    assert mount.heading_sd_rad == UNKNOWN_HEADING_SD_RAD
    assert mount.heading_rad == pytest.approx(0.0, abs=1e-6)
    assert total_m(increments)[1] == pytest.approx(0.0, abs=1e-3)


def test_the_magnetometer_says_which_way_the_walk_began() -> None:
    walk = SyntheticWalk(heading_rad=-2.0, field_ut=(22.0, 0.0, 41.0))
    mount = BootMount()
    increments = follow(mount, walk.samples(100.0))
    assert mount.heading_sd_rad < UNKNOWN_HEADING_SD_RAD
    assert mount.heading_rad == pytest.approx(-2.0, abs=1e-6)
    assert total_m(increments) == pytest.approx(walk.stance_places_m[-1], abs=0.02)


def test_heading_is_known_before_the_first_stride() -> None:
    mount = BootMount()
    walk = SyntheticWalk(strides=0, heading_rad=0.7, field_ut=(22.0, 0.0, 41.0))
    follow(mount, walk.samples(100.0))
    assert mount.heading_rad == pytest.approx(0.7, abs=1e-6)


def test_a_steady_gyro_bias_does_not_turn_the_walk() -> None:
    def biased() -> Iterable[ImuSample]:
        for sample in SyntheticWalk(strides=20).samples(100.0):
            x, y, z = sample.rate_rad_s
            yield ImuSample(sample.time_ns, sample.force_m_s2, (x + 0.01, y - 0.01, z + 0.01))

    increments = follow(BootMount(), biased())
    assert increments[-1].heading_rad == pytest.approx(0.0, abs=2e-3)
    assert total_m(increments) == pytest.approx((24.0, 0.0, 0.0), abs=0.1)


def test_an_accelerometer_bias_is_calibrated_away() -> None:
    def biased() -> Iterable[ImuSample]:
        for sample in SyntheticWalk().samples(100.0):
            x, y, z = sample.force_m_s2
            yield ImuSample(sample.time_ns, (x + 0.1, y - 0.1, z + 0.1), sample.rate_rad_s)

    assert total_m(follow(BootMount(), biased())) == pytest.approx((7.2, 0.0, 0.0), abs=0.08)


def test_repeated_and_backward_samples_change_nothing_and_are_counted() -> None:
    samples = list(SyntheticWalk().samples(100.0))
    disturbed = [sample for s in samples for sample in (s, s)]
    disturbed.insert(500, samples[3])
    mount = BootMount()
    assert follow(mount, disturbed) == follow(BootMount(), samples)
    assert mount.faults.out_of_order == len(samples) + 1


@pytest.mark.parametrize("why", BROKEN_READINGS)
def test_a_broken_sample_is_as_good_as_lost(why: str) -> None:
    samples = list(SyntheticWalk().samples(100.0))
    force, rate = BROKEN_READINGS[why]
    mount, spared = BootMount(), BootMount()
    increments = follow(
        mount,
        [s if k % 97 else ImuSample(s.time_ns, force, rate) for k, s in enumerate(samples)],
    )
    assert increments == follow(spared, [s for k, s in enumerate(samples) if k % 97])
    assert mount.faults.unusable == math.ceil(len(samples) / 97)
    assert total_m(increments) == pytest.approx((7.2, 0.0, 0.0), abs=0.05)


def in_swing(gap_s: float) -> tuple[BootMount, list[Increment]]:
    """Follow a walk that loses ``gap_s`` of its third swing."""
    mount = BootMount()
    return mount, follow(mount, SyntheticWalk().samples_with_gap(100.0, gap_s))


def test_a_short_gap_is_bridged_and_owned_to() -> None:
    mount, increments = in_swing(0.15)
    assert mount.faults.gaps == 1
    assert len(increments) == 6
    assert increments[2].path
    assert increments[2].covariance[0] > 4.0 * increments[1].covariance[0]
    assert increments[2].covariance[9] > 4.0 * increments[1].covariance[9]
    assert increments[3].covariance == pytest.approx(increments[1].covariance, rel=0.2)


def test_over_a_long_gap_the_boot_is_lost() -> None:
    mount, increments = in_swing(1.5)
    lost = increments[2]
    assert mount.faults.gaps == 1
    assert (lost.displacement_m, lost.path) == ((0.0, 0.0, 0.0), ())
    assert lost.covariance[0] > 1.0
    after = total_m(increments[3:])
    assert after == pytest.approx((1.2 * len(increments[3:]), 0.0, 0.0), abs=0.05)


def test_a_boot_that_never_stands_is_told_to_be_lost_again_and_again() -> None:
    walk = SyntheticWalk(strides=60, swing_s=0.5, stance_s=0.0)
    increments = follow(BootMount(), walk.samples(100.0))
    assert 3 <= len(increments) <= 4
    assert all(increment.displacement_m == (0.0, 0.0, 0.0) for increment in increments)
    assert all(increment.covariance[0] > 10.0 for increment in increments[:3])
    for before, after in itertools.pairwise(increments):
        assert before.end_time_ns == after.start_time_ns


def test_when_the_clock_is_set_back_the_mount_goes_on_in_the_new_time() -> None:
    walk = SyntheticWalk()
    shift_ns = round(20.0 * NS_PER_S)
    ahead = [
        ImuSample(s.time_ns + shift_ns, s.force_m_s2, s.rate_rad_s) for s in walk.samples(100.0)
    ]
    mount = BootMount()
    first = follow(mount, ahead)
    again = follow(mount, walk.samples(100.0))
    assert len(first) == walk.strides
    assert mount.faults.restarts == 1
    assert mount.faults.out_of_order == RESTART_AFTER
    lost, *strides = again
    assert lost.path == ()
    assert lost.covariance[9] > 1.0
    assert total_m(strides) == pytest.approx((7.2, 0.0, 0.0), abs=0.02)


def test_a_copy_made_midway_goes_on_alike() -> None:
    samples = list(SyntheticWalk(turn_rad=0.2).samples(100.0))
    mount = BootMount()
    follow(mount, samples[:450])
    resumed = copy.deepcopy(mount)
    assert follow(resumed, samples[450:]) == follow(mount, samples[450:])
