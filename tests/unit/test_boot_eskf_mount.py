"""The error-state boot mount: frames, what is told when, and what it does with bad samples."""

from __future__ import annotations

import copy
import itertools
import math
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from edge_agent.inertial import boot_strides
from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD
from edge_agent.mounts.boot_eskf import EskfBootMount
from edge_agent.mounts.interface import Increment
from shared.maths.angles import wrap_rad
from shared.messages import ImuSample, Vector3
from shared.simulation.boot_imu import simulate_boot_imu
from shared.simulation.legs import Leg, Move, Ride, Stand
from shared.units import NS_PER_S
from tests.simulated_walks import lone_walk
from tests.synthetic_boot import BROKEN_READINGS, SyntheticWalk

FIELD_UT = (22.0, 0.0, 41.0)


def follow(mount: EskfBootMount, samples: Iterable[ImuSample]) -> list[Increment]:
    found = [found for sample in samples if (found := mount.step(sample)) is not None]
    return found + mount.finish()


def total_m(increments: list[Increment]) -> Vector3:
    north, east, down = np.sum([i.displacement_m for i in increments], axis=0)
    return float(north), float(east), float(down)


def test_a_walk_up_and_round_comes_out_right() -> None:
    walk = SyntheticWalk(rise_m=0.17, turn_rad=0.3)
    increments = follow(EskfBootMount(), walk.samples(200.0))
    assert len(increments) == walk.strides
    strides_m = np.diff(np.array(walk.stance_places_m), axis=0)
    for increment, stride_m in zip(increments, strides_m, strict=True):
        np.testing.assert_allclose(increment.displacement_m, stride_m, atol=0.01)
        assert increment.d_heading_rad == pytest.approx(walk.turn_rad, abs=0.01)
    # This boot always turns half as far again as its strides lead: it is worn toe-in.
    facing_rad = (walk.strides - 0.5) * walk.turn_rad
    assert increments[-1].heading_rad == pytest.approx(facing_rad, abs=0.02)


@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 400.0])
def test_a_stride_is_told_within_half_a_second_of_its_end(rate_hz: float) -> None:
    mount = EskfBootMount()
    lags_s = [
        (sample.time_ns - increment.end_time_ns) / NS_PER_S
        for sample in SyntheticWalk().samples(rate_hz)
        if (increment := mount.step(sample)) is not None
    ]
    assert len(lags_s) == 6
    assert max(lags_s) <= 0.5


def test_the_last_stride_of_a_recording_is_told_at_its_end() -> None:
    walk, mount = SyntheticWalk(), EskfBootMount()
    end_ns = round((walk.stance_times_s[-1] + 0.05) * NS_PER_S)
    for sample in walk.samples(100.0):
        if sample.time_ns < end_ns:
            mount.step(sample)
    (last,) = mount.finish()
    assert last.displacement_m == pytest.approx((1.2, 0.0, 0.0), abs=0.01)


def test_paths_lead_through_their_increments() -> None:
    walk = SyntheticWalk(heading_rad=0.4, field_ut=FIELD_UT)
    increments = follow(EskfBootMount(), walk.samples(200.0))
    for before, after in itertools.pairwise(increments):
        assert before.end_time_ns <= after.start_time_ns
    for increment in increments:
        assert increment.path[0][0] == increment.start_time_ns
        assert increment.path[0][1:] == pytest.approx((0.0, 0.0, 0.0), abs=0.05)
        assert increment.path[-1] == (increment.end_time_ns, *increment.displacement_m)


def test_who_only_stands_makes_no_increment() -> None:
    mount = EskfBootMount()
    assert follow(mount, SyntheticWalk(strides=0, standing_s=10.0).samples(100.0)) == []
    assert mount.ready


def pivoted(turn_rad: float) -> Iterable[ImuSample]:
    """A stride, a turn on the spot over one second, and a stride."""
    walk = SyntheticWalk(strides=1, standing_s=3.0)
    for sample in walk.samples(100.0):
        turning = 4.0 <= sample.time_ns / NS_PER_S < 5.0
        yield ImuSample(
            sample.time_ns,
            sample.force_m_s2,
            (0.0, 0.0, turn_rad) if turning else sample.rate_rad_s,
        )
    for sample in walk.samples(100.0, start_s=2.0):
        later_ns = sample.time_ns + round((walk.duration_s - 1.99) * NS_PER_S)
        yield ImuSample(later_ns, sample.force_m_s2, sample.rate_rad_s)


def test_turning_on_the_spot_turns_the_next_stride() -> None:
    increments = follow(EskfBootMount(), pivoted(1.0))
    assert sum(i.d_heading_rad for i in increments) == pytest.approx(1.0, abs=0.03)
    north, east, _ = increments[-1].displacement_m
    assert math.atan2(east, north) == pytest.approx(1.0, abs=0.03)


def test_without_a_magnetometer_the_heading_is_zero_and_unknown() -> None:
    mount = EskfBootMount()
    increments = follow(mount, SyntheticWalk(heading_rad=1.0).samples(100.0))
    assert mount.heading_sd_rad == UNKNOWN_HEADING_SD_RAD
    assert mount.heading_rad == pytest.approx(0.0, abs=5e-3)
    assert total_m(increments)[1] == pytest.approx(0.0, abs=0.02)


def test_the_magnetometer_says_which_way_the_walk_began() -> None:
    walk = SyntheticWalk(heading_rad=-2.0, turn_rad=0.2, field_ut=FIELD_UT)
    mount = EskfBootMount()
    increments = follow(mount, walk.samples(100.0))
    assert mount.heading_sd_rad < UNKNOWN_HEADING_SD_RAD
    assert mount.heading_rad == pytest.approx(wrap_rad(-2.0 + 5.5 * 0.2), abs=0.01)
    assert total_m(increments) == pytest.approx(walk.stance_places_m[-1], abs=0.05)


def test_a_magnetometer_upside_down_on_the_boot_says_the_same() -> None:
    walk = SyntheticWalk(heading_rad=-2.0, field_ut=FIELD_UT)

    def turned(vector: Vector3) -> Vector3:
        x, y, z = vector
        return (x, -y, -z)

    rolled = (
        ImuSample(s.time_ns, turned(s.force_m_s2), turned(s.rate_rad_s), turned(s.field_ut))
        for s in walk.samples(100.0)
        if s.field_ut is not None
    )
    assert total_m(follow(EskfBootMount(), rolled)) == pytest.approx(
        walk.stance_places_m[-1], abs=0.05
    )


def test_what_is_told_are_plain_numbers_as_the_wire_takes_them() -> None:
    walk = SyntheticWalk(strides=12, turn_rad=0.2, field_ut=FIELD_UT)
    increments = follow(EskfBootMount(), walk.samples(200.0))
    for told in increments:
        numbers = (*told.displacement_m, told.d_heading_rad, told.heading_rad, *told.covariance)
        assert {type(number) for number in numbers} == {float}
    assert increments


def test_heading_is_known_before_the_first_stride() -> None:
    mount = EskfBootMount()
    walk = SyntheticWalk(strides=0, heading_rad=0.7, field_ut=FIELD_UT)
    assert follow(mount, walk.samples(100.0)) == []
    assert mount.heading_rad == pytest.approx(0.7, abs=1e-6)
    assert mount.heading_sd_rad < UNKNOWN_HEADING_SD_RAD


def test_the_sender_of_broken_fields_is_not_believed() -> None:
    mount = EskfBootMount()
    for sample in SyntheticWalk(strides=0).samples(100.0):
        mount.step(ImuSample(sample.time_ns, sample.force_m_s2, sample.rate_rad_s, (math.nan,) * 3))
    assert mount.heading_sd_rad == UNKNOWN_HEADING_SD_RAD


def test_repeated_samples_change_nothing_and_are_counted() -> None:
    samples = list(SyntheticWalk().samples(100.0))
    doubled = [sample for s in samples for sample in (s, s)]
    mount = EskfBootMount()
    assert follow(mount, doubled) == follow(EskfBootMount(), samples)
    assert mount.faults.out_of_order == len(samples)


def test_a_sample_from_the_past_changes_nothing_and_is_counted() -> None:
    samples = list(SyntheticWalk().samples(100.0))
    disturbed = [*samples[:500], samples[3], *samples[500:]]
    mount = EskfBootMount()
    assert follow(mount, disturbed) == follow(EskfBootMount(), samples)
    assert mount.faults.out_of_order == 1


@pytest.mark.parametrize("why", BROKEN_READINGS)
def test_a_broken_sample_is_bridged(why: str) -> None:
    samples = list(SyntheticWalk().samples(100.0))
    force, rate = BROKEN_READINGS[why]
    mount = EskfBootMount()
    increments = follow(
        mount,
        [s if k % 97 else ImuSample(s.time_ns, force, rate) for k, s in enumerate(samples)],
    )
    assert mount.faults.unusable == math.ceil(len(samples) / 97)
    assert total_m(increments) == pytest.approx((7.2, 0.0, 0.0), abs=0.05)


def in_swing(gap_s: float) -> tuple[EskfBootMount, list[Increment]]:
    """Follow a walk that loses ``gap_s`` of its third swing."""
    mount = EskfBootMount()
    return mount, follow(mount, SyntheticWalk().samples_with_gap(100.0, gap_s))


def test_a_short_gap_is_bridged_and_owned_to() -> None:
    mount, increments = in_swing(0.15)
    assert mount.faults.gaps == 1
    assert len(increments) == 6
    assert increments[2].displacement_m == pytest.approx((1.2, 0.0, 0.0), abs=0.1)
    assert increments[2].covariance[9] > 1.2 * increments[1].covariance[9]


def test_over_a_long_gap_the_boot_is_lost() -> None:
    mount, increments = in_swing(1.5)
    (lost,) = (i for i in increments if not i.path)
    at = increments.index(lost)
    assert at == 2
    assert mount.faults.restarts == 1
    assert lost.displacement_m == (0.0, 0.0, 0.0)
    assert lost.covariance[0] > 1.0
    assert lost.end_time_ns - lost.start_time_ns > 1.5 * NS_PER_S
    after = increments[at + 1 :]
    assert total_m(after) == pytest.approx((1.2 * len(after), 0.0, 0.0), abs=0.1)


def test_a_boot_that_is_thrown_is_lost_and_found_again() -> None:
    samples = list(SyntheticWalk().samples(100.0))
    thrown = [
        ImuSample(s.time_ns, (300.0, 20.0, 9.0), (1.0, 7.0, 0.0)) if 400 <= k < 1000 else s
        for k, s in enumerate(samples + later(samples))
    ]
    mount = EskfBootMount()
    increments = follow(mount, thrown)
    assert mount.faults.restarts >= 1
    assert any(not i.path for i in increments)
    assert all(math.hypot(*i.displacement_m) < 40.0 for i in increments)
    found = [i for i in increments if i.start_time_ns > samples[-1].time_ns + 2 * NS_PER_S]
    lengths_m = [math.hypot(*i.displacement_m) for i in found[-4:]]
    assert lengths_m == pytest.approx([1.2] * 4, abs=0.05)


def later(samples: list[ImuSample]) -> list[ImuSample]:
    """The same once more, after the last."""
    shift_ns = samples[-1].time_ns + 10_000_000 - samples[0].time_ns
    return [ImuSample(s.time_ns + shift_ns, s.force_m_s2, s.rate_rad_s) for s in samples]


def test_when_the_clock_is_set_back_the_mount_goes_on_in_the_new_time() -> None:
    samples = list(SyntheticWalk().samples(100.0))
    mount = EskfBootMount()
    for sample in later(samples):
        mount.step(sample)
    again = follow(mount, samples)
    assert mount.faults.restarts == 1
    lost = next(i for i in again if not i.path)
    assert lost.start_time_ns <= lost.end_time_ns
    assert lost.covariance[0] > 1.0
    strides = again[again.index(lost) + 1 :]
    assert total_m(strides)[0] == pytest.approx(7.2, abs=0.1)


def test_a_rate_that_doubles_is_followed() -> None:
    walk = SyntheticWalk(strides=12)
    half = walk.duration_s / 2
    slow = [s for s in walk.samples(200.0) if s.time_ns / NS_PER_S < half]
    fast = walk.samples(100.0, start_s=half)
    mount = EskfBootMount()
    increments = follow(mount, [*slow, *fast])
    assert mount.faults.restarts == 1
    lengths_m = [math.hypot(*i.displacement_m) for i in increments[-3:]]
    assert lengths_m == pytest.approx([1.2] * 3, abs=0.03)


@pytest.mark.parametrize("strides", [6, 30])
def test_a_copy_made_midway_goes_on_alike(strides: int) -> None:
    walk = SyntheticWalk(strides=strides, turn_rad=0.2 if strides < 10 else 0.02, field_ut=FIELD_UT)
    samples = list(walk.samples(100.0))
    mount = EskfBootMount(dominant_direction=True)
    half = len(samples) // 2
    for sample in samples[:half]:
        mount.step(sample)
    resumed = copy.deepcopy(mount)
    assert follow(resumed, samples[half:]) == follow(mount, samples[half:])


def test_what_corrects_the_heading_is_in_what_is_told() -> None:
    """A gyro that drifts along a straight corridor: what is told turns back, in every part."""
    bias_rad_s = math.radians(0.3)
    walk = SyntheticWalk(strides=60, standing_s=3.0)
    samples = [
        ImuSample(s.time_ns, s.force_m_s2, (0.0, 0.0, bias_rad_s))
        if s.time_ns > 3 * NS_PER_S and s.rate_rad_s == (0.0, 0.0, 0.0)
        else ImuSample(s.time_ns, s.force_m_s2, s.rate_rad_s)
        for s in walk.samples(100.0)
    ]
    free = follow(EskfBootMount(), samples)
    held = follow(EskfBootMount(dominant_direction=True), samples)
    assert len(free) == len(held)

    def last_direction_rad(increments: list[Increment]) -> float:
        north_m, east_m, _ = increments[-1].displacement_m
        return math.atan2(east_m, north_m)

    corrected_rad = last_direction_rad(free) - last_direction_rad(held)
    assert abs(last_direction_rad(held)) < 0.9 * abs(last_direction_rad(free))
    turned_rad = [sum(i.d_heading_rad for i in told) for told in (free, held)]
    assert turned_rad[0] - turned_rad[1] == pytest.approx(corrected_rad, abs=1e-6)
    assert sum(i.covariance[9] for i in held) > sum(i.covariance[9] for i in free)
    # Who sends it takes plain numbers only.
    assert {type(each) for i in held for each in (*i.covariance, i.d_heading_rad)} == {float}


COUNT_COMPILED = """
from edge_agent.inertial.sample_intake import compile_kernels, take as step
compile_kernels()
print(sum(step.stats.cache_hits.values()), sum(step.stats.cache_misses.values()))
"""


def test_a_second_process_reads_the_kernels_from_disk() -> None:
    EskfBootMount()
    project = Path(boot_strides.__file__).parents[2]
    told = subprocess.run(
        [sys.executable, "-c", COUNT_COMPILED], capture_output=True, check=True, cwd=project
    ).stdout
    assert told.split() == [b"1", b"0"]


def test_a_ride_in_a_lift_is_taken_for_no_error_of_the_sensor() -> None:
    """A walk after it sinks as much as one without it."""
    way = Move("walk", ((10.0, 0.0),))

    def sunk_m(*legs: Leg) -> float:
        boot = simulate_boot_imu(lone_walk(Stand(8.0), *legs, way, floor="first"), "r1", seed=2)
        walked = follow(EskfBootMount(), boot.samples(0))
        strides_m = [one.displacement_m for one in walked]
        return sum(down_m for north_m, east_m, down_m in strides_m if north_m**2 + east_m**2 > 0.1)

    assert sunk_m(Ride("fifth"), Stand(2.0)) == pytest.approx(sunk_m(Stand(2.0)), abs=0.02)
