"""The unit on the belt: worn any way round, read as it is, followed through what goes wrong."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from edge_agent.evaluation.estimate import estimated_path
from edge_agent.mounts.interface import Increment
from edge_agent.mounts.waist import WaistMount
from edge_agent.sources.recording import Recording
from shared.maths.angles import wrap_rad
from shared.maths.rotations import IDENTITY, Quaternion, from_rotation_vector
from shared.messages import ImuSample
from shared.simulation.legs import Move, Stand
from shared.simulation.torso_imu import Slip, Worn, simulate_torso_imu
from shared.simulation.walker import simulate_walk
from tests.simulated_walks import lone_walk

COURSE = lone_walk(
    Stand(3.0), Move("walk", ((14.0, 0.0),)), Stand(3.0), Move("walk", ((14.0, 12.0),))
)
SEED = 2


@cache
def recorded(sensor_from_trunk: Quaternion = IDENTITY, slips: tuple[Slip, ...] = ()) -> Recording:
    read = simulate_torso_imu(COURSE, "r1", SEED, Worn("belt", sensor_from_trunk, slips))
    time_ns = np.rint(1e9 * read.time_s).astype(np.int64)
    return Recording(time_ns, read.force_m_s2, read.rate_rad_s)


def follow(samples: Recording | Iterable[ImuSample]) -> tuple[list[Increment], WaistMount]:
    mount = WaistMount()
    told = [one for sample in samples if (one := mount.step(sample)) is not None]
    return told + mount.finish(), mount


def ends_m(told: list[Increment]) -> np.ndarray:
    return estimated_path(told).position_m[-1, :2]


def pause_s() -> float:
    """Return when the second stand is half over."""
    walk = simulate_walk(COURSE, "r1", SEED)
    dwells_s = walk.left_s - walk.reached_s
    place = 1 + int(np.argmax(dwells_s[1:-1]))
    return float(0.5 * (walk.reached_s[place] + walk.left_s[place]))


def test_every_step_is_told_and_leads_on() -> None:
    told, mount = follow(recorded())
    walk = simulate_walk(COURSE, "r1", SEED)
    assert abs(sum(one.steps for one in told) - 2 * len(walk.gaits)) <= 2
    length_m = sum(math.hypot(*one.displacement_m) for one in told)
    assert length_m == pytest.approx(26.0, rel=0.12)
    before = [one.heading_rad for one in told if one.end_time_ns < pause_s() * 1e9]
    after = [one.heading_rad for one in told if one.end_time_ns > (pause_s() + 4.0) * 1e9]
    assert math.degrees(abs(np.mean(before))) < 6.0
    assert math.degrees(wrap_rad(float(np.mean(after)))) == pytest.approx(90.0, abs=8.0)
    assert all(one.start_time_ns < one.end_time_ns for one in told)
    assert mount.worn == "Unit on the belt: its +x side is ahead"


@pytest.mark.parametrize(
    ("turn_rad", "ahead"),
    [((0.0, 0.0, math.pi), "-x"), ((0.0, math.pi / 2, 0.0), "-z"), ((2.0, -1.0, 0.7), None)],
)
def test_however_it_is_worn_the_way_is_the_same(
    turn_rad: tuple[float, float, float], ahead: str | None
) -> None:
    straight, _ = follow(recorded())
    turned, mount = follow(recorded(from_rotation_vector(turn_rad)))
    assert abs(len(turned) - len(straight)) <= 1
    np.testing.assert_allclose(ends_m(turned), ends_m(straight), atol=1.0)
    assert ahead is None or f"its {ahead} side" in str(mount.worn)


def test_a_unit_that_turned_on_its_belt_is_right_again_after_some_steps() -> None:
    slip = Slip(pause_s(), (0.0, 0.6, 0.0))
    straight, _ = follow(recorded())
    slipped, _ = follow(recorded(slips=(slip,)))
    assert abs(len(slipped) - len(straight)) <= 2
    np.testing.assert_allclose(ends_m(slipped), ends_m(straight), atol=2.0)


def test_a_sensor_that_reads_too_much_of_gravity_makes_no_longer_way() -> None:
    samples = recorded()
    told, _ = follow(samples)
    more, _ = follow(replace(samples, force_m_s2=1.04 * samples.force_m_s2))
    assert len(more) == len(told)
    np.testing.assert_allclose(ends_m(more), ends_m(told), rtol=0.01)


def test_batch_is_as_single_steps_and_a_copy_goes_on_alike() -> None:
    samples = recorded()
    told, _ = follow(samples)
    mount = WaistMount()
    half = len(samples) // 2
    first = mount.steps(samples.rows(slice(0, half)))
    other = copy.deepcopy(mount)
    rest = samples.rows(slice(half, len(samples)))
    assert first + mount.steps(rest) + mount.finish() == told
    assert first + other.steps(rest) + other.finish() == told


def test_who_stands_is_told_nowhere() -> None:
    samples = recorded()
    told, mount = follow(samples.rows(np.flatnonzero(samples.time_ns < 5e9)))
    assert told == []
    assert mount.ready


def test_an_accelerometer_that_reads_nothing_but_zeros_is_no_walk() -> None:
    samples = recorded()
    dead = replace(samples, force_m_s2=np.zeros((len(samples), 3)))
    told, mount = follow(dead.rows(slice(0, 300)))
    assert told == []
    assert not mount.ready
    told, _ = follow(
        replace(samples, force_m_s2=np.vstack((samples.force_m_s2[:500], dead.force_m_s2[500:])))
    )
    assert all(math.isfinite(x) for one in told for x in one.displacement_m)


def test_what_is_no_reading_is_counted_and_passed_over() -> None:
    samples = list(recorded().rows(slice(0, 1500)))
    told, _ = follow(samples)
    bad = (math.nan, 0.0, 0.0)
    spoilt = [
        *samples[:900],
        ImuSample(samples[900].time_ns, bad, bad),
        samples[100],
        *samples[900:],
    ]
    again, mount = follow(spoilt)
    assert again == told
    assert (mount.faults.unusable, mount.faults.out_of_order) == (1, 1)


def test_a_long_gap_loses_the_wearer_and_a_short_one_does_not() -> None:
    samples = recorded()
    at_ns = round(1e9 * (pause_s() - 6.0))
    whole, _ = follow(samples)

    def without(gap_s: float) -> tuple[list[Increment], WaistMount]:
        lost = (samples.time_ns > at_ns) & (samples.time_ns < at_ns + gap_s * 1e9)
        return follow(samples.rows(np.flatnonzero(~lost)))

    bridged, mount = without(0.15)
    assert mount.faults.gaps == 1
    assert abs(len(bridged) - len(whole)) <= 1
    assert all(one.steps == 1 for one in bridged)
    broken, _ = without(2.0)
    (lost,) = [one for one in broken if one.steps == 0]
    assert lost.displacement_m == (0.0, 0.0, 0.0)
    assert lost.covariance[0] > 4.0


def test_a_clock_that_was_set_back_begins_a_new_time() -> None:
    samples = list(recorded().rows(slice(0, 2000)))
    back = [replace_time(one, one.time_ns - 10**10) for one in samples[1000:]]
    told, mount = follow([*samples[:1000], *back])
    assert mount.faults.restarts == 1
    assert told[-1].end_time_ns < samples[1000].time_ns


def replace_time(sample: ImuSample, time_ns: int) -> ImuSample:
    return ImuSample(time_ns, sample.force_m_s2, sample.rate_rad_s)
