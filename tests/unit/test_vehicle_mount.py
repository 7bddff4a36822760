"""The vehicle's mounts: speed through turns and stops, slips, and samples that are not as asked."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.random import default_rng
from scipy.spatial.transform import Rotation

from edge_agent.evaluation.course_truth import DrivenSpeed, FixedDrive, MountedDrive
from edge_agent.evaluation.vehicle_mountings import Lie, mounted
from edge_agent.evaluation.vehicle_score import follow_drive, score_drive
from edge_agent.mounts.interface import Increment
from edge_agent.mounts.methods import Told, make_mount
from edge_agent.mounts.vehicle import VehicleMount
from edge_agent.mounts.vehicle_published import PublishedVehicleMount
from edge_agent.sources.recording import Recording
from shared.maths.angles import wrap_rad
from shared.messages import ImuSample
from tests.drive import Array, Drive, drive

MOUNTS: tuple[Callable[[], VehicleMount | PublishedVehicleMount], ...] = (
    VehicleMount,
    PublishedVehicleMount,
)
WHICH = pytest.mark.parametrize("new_mount", MOUNTS)


@cache
def town() -> Drive:
    """Speeding up, two turns, a stop of eight seconds, and on."""
    return drive(
        ((0, 8), (10, 11), (18, 6), (28, 0), (36, 0), (44, 9), (50, 9)),
        ((0, 0), (11, 0), (14, 0.35), (17, 0), (20, 0), (22, -0.3), (24, 0)),
    )


def speed_errors_m_s(told: Sequence[Increment], truth: Drive) -> Array:
    """Return what each increment's mean speed is off by."""
    time_s = truth.recording.time_ns / 1e9
    way_m = np.concatenate(([0.0], np.cumsum(truth.speed_m_s[1:] * np.diff(time_s))))
    starts_s = np.array([one.start_time_ns / 1e9 for one in told])
    ends_s = np.array([one.end_time_ns / 1e9 for one in told])
    true_m = np.interp(ends_s, time_s, way_m) - np.interp(starts_s, time_s, way_m)
    told_m = np.array([math.hypot(*one.displacement_m) for one in told])
    errors_m_s: Array = (told_m - true_m) / (ends_s - starts_s)
    return errors_m_s


@pytest.mark.parametrize("lie", [None, "tilted", "any"])
def test_speed_and_heading_hold_through_turns_a_stop_and_slips(lie: Lie | None) -> None:
    truth = town()
    samples = truth.recording
    if lie is not None:
        samples = mounted(samples, lie, default_rng(7)).recording
    mount = VehicleMount()
    mount.know_speed(8.0, 0.1)
    told = mount.steps(samples) + mount.finish()
    assert np.sqrt(np.mean(speed_errors_m_s(told, truth) ** 2)) < 1.0
    turned_rad = wrap_rad(told[-1].heading_rad - truth.heading_rad[-1] + truth.heading_rad[0])
    assert abs(turned_rad) < math.radians(20.0)
    stood_s = sum(
        one.end_time_ns - one.start_time_ns for one in told if 30e9 < one.end_time_ns < 35e9
    )
    assert stood_s == 0, "standing tells nothing"


def test_single_wild_readings_are_left_out() -> None:
    truth = town()
    chance = default_rng(5)
    wild = np.arange(len(truth.recording)) % 200 == 100
    force_m_s2, rate_rad_s = (
        readings + wild[:, None] * spread * chance.normal(size=readings.shape)
        for readings, spread in (
            (truth.recording.force_m_s2, 100.0),
            (truth.recording.rate_rad_s, 10.0),
        )
    )
    mount = VehicleMount()
    mount.know_speed(8.0, 0.1)
    told = mount.steps(replace(truth.recording, force_m_s2=force_m_s2, rate_rad_s=rate_rad_s))
    told += mount.finish()
    assert mount.faults.unusable == wild.sum()
    assert np.sqrt(np.mean(speed_errors_m_s(told, truth) ** 2)) < 1.0


def test_a_start_from_rest_needs_no_speed_told() -> None:
    truth = drive(((0.0, 0.0), (4.0, 0.0), (12.0, 12.0), (20.0, 11.0), (30.0, 12.0)))
    turned = mounted(truth.recording, "any", default_rng(3)).recording
    rows = slice(0, int(np.searchsorted(turned.time_ns, round(14e9))))
    mount = VehicleMount()
    told = mount.steps(turned.rows(rows)) + mount.finish()
    assert mount.ready
    assert told[0].start_time_ns > 2.9e9, "it stood"
    assert np.sqrt(np.mean(speed_errors_m_s(told, truth) ** 2)) < 1.0


def test_an_unknown_speed_is_found_from_the_road() -> None:
    truth = drive(((0.0, 14.0), (15.0, 15.0), (30.0, 13.0)))
    mount = VehicleMount()
    told = mount.steps(truth.recording) + mount.finish()
    assert np.abs(speed_errors_m_s(told, truth)[-8:]).max() < 1.5


def test_a_hand_that_turns_the_phone_slowly_turns_no_vehicle() -> None:
    truth = drive(((0.0, 12.0), (16.0, 12.0)))
    samples = truth.recording
    time_s = samples.time_ns / 1e9
    turned_rad = 0.18 * np.clip(time_s - 9.0, 0.0, 3.0)
    turned = Rotation.from_rotvec(np.outer(turned_rad, [0.0, 0.0, 1.0])).inv()
    rate_rad_s = samples.rate_rad_s + [[0.0, 0.0, 1.0]] * np.gradient(turned_rad, time_s)[:, None]
    mount = VehicleMount()
    mount.know_speed(12.0, 0.1)
    held = replace(
        samples, force_m_s2=turned.apply(samples.force_m_s2), rate_rad_s=turned.apply(rate_rad_s)
    )
    told = mount.steps(held) + mount.finish()
    assert abs(told[-1].heading_rad) < math.radians(12.0), "the hand turned by 31°"
    assert np.abs(speed_errors_m_s(told, truth)).max() < 1.5


def test_a_turn_at_a_speed_told_wrong_is_still_the_vehicles() -> None:
    truth = drive(((0, 9), (19, 9)), ((0, 0), (9, 0), (10, 0.35), (14, 0.35), (15, 0), (19, 0)))
    mount = VehicleMount()
    mount.know_speed(9.0, 0.1)
    told = mount.steps(truth.recording.rows(slice(0, 884)))
    mount.know_speed(15.0, 0.1)
    told += mount.steps(truth.recording.rows(slice(884, len(truth.recording)))) + mount.finish()
    turned_rad = sum(one.d_heading_rad for one in told)
    assert turned_rad == pytest.approx(truth.heading_rad[-1] - truth.heading_rad[0], abs=0.3)


def test_who_reverses_out_first_goes_forward_in_the_end() -> None:
    truth = drive(((0, 0), (5, 0), (8, -2.0), (12, -2.0), (14, 0), (16, 0), (20, 6), (28, 9)))
    mount = VehicleMount()
    told = mount.steps(truth.recording) + mount.finish()
    assert mount.speed_m_s == pytest.approx(truth.speed_m_s[-1], abs=2.0)
    ways_m = np.array([one.displacement_m[:2] for one in told])
    assert ways_m[1] @ ways_m[-1] < 0.0, "it went the other way at first"
    heading_rad = told[-1].heading_rad
    assert ways_m[-1] @ [math.cos(heading_rad), math.sin(heading_rad)] > 5.0
    assert abs(sum(one.d_heading_rad for one in told)) < 0.5, "nor did it turn about"


def test_satellites_tell_a_speed_that_the_road_does_not() -> None:
    truth = drive(((0.0, 30.0), (8.0, 31.0)))
    mount, told = VehicleMount(), []
    for second, rows in enumerate((slice(0, 104), slice(104, 800))):
        if second:
            mount.know_speed(truth.speed_m_s[104], 0.5)
        told += mount.steps(truth.recording.rows(rows))
    assert np.abs(speed_errors_m_s(told, truth)).max() < 4.0
    unaided = VehicleMount().steps(truth.recording.rows(slice(0, 600)))
    assert np.abs(speed_errors_m_s(unaided, truth)).max() > 12.0


def test_the_published_method_needs_no_wheelbase_and_a_boot_has_none() -> None:
    engine = Told(wheelbase_m=4.5)
    assert isinstance(make_mount("vehicle", "robust", engine), VehicleMount)
    assert isinstance(make_mount("vehicle", "published", engine), PublishedVehicleMount)
    with pytest.raises(ValueError, match="--wheelbase: only of a vehicle"):
        make_mount("boot", "eskf", engine)


@WHICH
def test_single_steps_and_a_copy_tell_what_a_batch_does(
    new_mount: Callable[[], VehicleMount | PublishedVehicleMount],
) -> None:
    samples = town().recording.rows(slice(0, 1200))
    batch = new_mount()
    told = batch.steps(samples) + batch.finish()
    single = new_mount()
    stepped = [one for sample in samples.rows(slice(0, 700)) if (one := single.step(sample))]
    resumed = copy.deepcopy(single)
    stepped += resumed.steps(samples.rows(slice(700, 1200))) + resumed.finish()
    assert told
    assert stepped == told


@pytest.mark.parametrize("sticks", [False, True])
def test_over_a_gap_the_vehicle_goes_on_as_it_did_and_is_known_less_well(sticks: bool) -> None:
    """Samples are lost; or the sensor reads the same, to the last digit, all that time."""
    samples = drive(((0.0, 12.0), (11.0, 12.0))).recording
    since_s = (samples.time_ns - samples.time_ns[0]) / 1e9
    rows = np.arange(len(samples))
    lost = (since_s > 6.0) & (since_s < 8.5)
    held = samples.rows(np.where(lost, rows[lost][0], rows) if sticks else rows[~lost])
    mount = VehicleMount()
    mount.know_speed(12.0, 0.1)
    told = mount.steps(replace(held, time_ns=samples.time_ns) if sticks else held) + mount.finish()
    way_m = sum(math.hypot(*one.displacement_m) for one in told)
    assert way_m == pytest.approx(12.0 * since_s[-1], rel=0.04)
    (over,) = [one for one in told if one.end_time_ns - one.start_time_ns > 2e9]
    assert over.covariance[0] > 3.0**2
    assert all(one.covariance[0] < 1.0 for one in told if one.end_time_ns <= over.start_time_ns)
    assert (mount.faults.unusable > 200) == sticks


def test_over_a_longer_gap_nobody_knows_where_it_went() -> None:
    samples = drive(((0.0, 12.0), (11.0, 12.0))).recording
    later = samples.time_ns + np.where(np.arange(len(samples)) < 650, 0, 15 * 10**9)
    mount = VehicleMount()
    mount.know_speed(12.0, 0.1)
    told = mount.steps(replace(samples, time_ns=later)) + mount.finish()
    (over,) = [one for one in told if one.end_time_ns - one.start_time_ns > 10**10]
    assert over.displacement_m == (0.0, 0.0, 0.0)
    assert 15.0 * 12.0 < math.sqrt(over.covariance[0]) < 15.0 * 40.0
    assert over.covariance[9] > 3.0
    assert [one for one in told if one.start_time_ns >= over.end_time_ns]


def test_a_gyroscope_may_be_one_that_nobody_has_calibrated() -> None:
    truth = drive(((0.0, 14.0), (12.0, 15.0), (14.0, 14.5)))
    mount = VehicleMount()
    mount.know_speed(14.0, 0.1)
    zero_rad_s = np.array([0.02, -0.02, 0.01])
    off = replace(truth.recording, rate_rad_s=truth.recording.rate_rad_s + zero_rad_s)
    told = mount.steps(off) + mount.finish()
    assert np.sqrt(np.mean(speed_errors_m_s(told, truth) ** 2)) < 1.5


def test_a_drive_too_short_to_tell_has_no_score() -> None:
    truth = town()
    samples = truth.recording.rows(slice(0, 60))
    speed = DrivenSpeed(truth.recording.time_ns / 1e9, truth.speed_m_s)
    drive = follow_drive(VehicleMount(), samples, speed)
    row = score_drive("short", "x", drive, None, MountedDrive(FixedDrive(samples, speed), ()))
    assert row.speed_rmse_m_s is None
    assert row.failure is not None
    assert "nothing told of 0.6 s" in row.failure


@WHICH
def test_missing_repeated_and_unreadable_samples_are_counted(
    new_mount: Callable[[], VehicleMount | PublishedVehicleMount],
) -> None:
    samples = list(town().recording.rows(slice(0, 2000)))
    nothing = ImuSample(samples[1].time_ns + 1, (math.nan, 0.0, 0.0), (0.0, 0.0, 0.0))
    broken = [*samples[:900], samples[400], nothing, *samples[930:1300], *samples[1600:]]
    mount = new_mount()
    told = [one for sample in broken if (one := mount.step(sample))] + mount.finish()
    assert (mount.faults.unusable, mount.faults.out_of_order, mount.faults.gaps) == (1, 1, 2)
    assert all(abs(number) <= 100.0 for one in told for number in one.displacement_m)
    ends_ns = [one.end_time_ns for one in told]
    assert ends_ns == sorted(ends_ns)


@WHICH
@given(
    seed=st.integers(0, 10_000),
    size=st.sampled_from([0.0, 1.0, 1e2, 1e5]),
    turn=st.sampled_from([0.0, 1.0, 1e2, 1e5]),
)
@settings(max_examples=12, deadline=None)
def test_nothing_that_a_sample_holds_makes_it_raise(
    new_mount: Callable[[], VehicleMount | PublishedVehicleMount],
    seed: int,
    size: float,
    turn: float,
) -> None:
    chance = default_rng(seed)
    count = 400
    steps_s = chance.choice([0.01, 0.03, 0.3, 1.5], size=count, p=[0.9, 0.07, 0.02, 0.01])
    samples = Recording(
        np.rint(1e9 * np.cumsum(steps_s)).astype(np.int64),
        np.clip(chance.normal(0.0, 1.0, (count, 3)) * size, -1e5, 1e5) - [0.0, 0.0, 9.8],
        np.clip(chance.normal(0.0, 1.0, (count, 3)) * turn, -1e5, 1e5),
    )
    samples = replace(samples, force_m_s2=np.clip(samples.force_m_s2, -1e5, 1e5))
    mount = new_mount()
    for one in mount.steps(samples) + mount.finish():
        assert all(abs(number) <= 100.0 for number in one.displacement_m)
        assert all(math.isfinite(number) and abs(number) < 1e12 for number in one.covariance)
        assert min(one.covariance[0], one.covariance[4], one.covariance[9]) >= 0.0
