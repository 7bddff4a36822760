"""The chest: steps that lead where the phone turns, whichever way round it is worn."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable
from itertools import chain, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from edge_agent.mounts.chest import ChestMount
from edge_agent.mounts.interface import Increment
from edge_agent.sources.recording import Recording
from shared.maths.rotations import from_rotation_vector, rotate
from shared.messages import WITHOUT_GYRO, ImuSample
from tests.bouncing_phone import Phone


def follow(mount: ChestMount, samples: Iterable[ImuSample]) -> list[Increment]:
    told = [one for sample in samples if (one := mount.step(sample)) is not None]
    return told + mount.finish()


def way_m(told: Iterable[Increment]) -> tuple[float, float, float]:
    north_m, east_m, down_m = np.sum([one.displacement_m for one in told], axis=0).tolist()
    return north_m, east_m, down_m


def test_a_straight_walk_is_straight_and_as_long_as_it_is_hard() -> None:
    told = follow(ChestMount(), Phone(steps=40).samples())
    assert sum(one.steps for one in told) == 40
    north_m, east_m, _ = way_m(told)
    # The mean of |sin| is 2/π; at 2 Hz the window leaves four fifths of it.
    assert 40 * 0.46 * math.sqrt(0.75 * 3.0 * 2.0 / math.pi) < math.hypot(north_m, east_m)
    assert math.hypot(north_m, east_m) < 40 * 0.46 * math.sqrt(3.0 * 2.0 / math.pi)
    assert all(one.activity == "walk" for one in told)


@settings(max_examples=25)
@given(st.tuples(*[st.floats(-2.0, 2.0)] * 3), st.sampled_from([0.0, 0.15]))
def test_how_it_is_worn_does_not_matter(
    rotation_rad: tuple[float, float, float], turn_rad_s: float
) -> None:
    worn = Phone(steps=12, turn_rad_s=turn_rad_s, rate_hz=50.0)
    level = follow(ChestMount(), worn.samples())
    turned = follow(
        ChestMount(), worn._replace(sensor_from_level=from_rotation_vector(rotation_rad)).samples()
    )
    assert len(level) == len(turned)
    for one, other in zip(level, turned, strict=True):
        assert one.d_heading_rad == pytest.approx(other.d_heading_rad, abs=1e-6)
        assert math.hypot(*one.displacement_m) == pytest.approx(math.hypot(*other.displacement_m))


def test_turning_is_followed_and_the_bias_is_learnt() -> None:
    phone = Phone(steps=40, turn_rad_s=0.1, rest_s=5.0, bias_rad_s=(0.004, -0.006, 0.02))
    told = follow(ChestMount(), phone.samples())
    # From the middle of the first step to that of the last.
    turned_rad = sum(one.d_heading_rad for one in told)
    assert turned_rad == pytest.approx(0.1 * 39 * 0.5, abs=0.03)
    assert told[-1].covariance[9] < math.radians(1.0) ** 2


def test_without_a_gyroscope_steps_are_counted_and_lead_nowhere() -> None:
    samples = [
        ImuSample(one.time_ns, one.force_m_s2, WITHOUT_GYRO) for one in Phone(steps=30).samples()
    ]
    mount = ChestMount()
    told = follow(mount, samples)
    assert sum(one.steps for one in told) == 30
    assert way_m(told) == (0.0, 0.0, 0.0)
    assert mount.ready
    assert mount.faults.unusable == 0


def test_the_magnetometer_tells_north_where_the_wearer_stands() -> None:
    # The phone lies flat, screen up, before a wearer who faces east.
    east = [
        ImuSample(one.time_ns, (0.0, 0.0, -one.force_m_s2[2]), (0.0, 0.0, 0.0), (-20.0, 0.0, -40.0))
        for one in Phone(steps=20).samples()
    ]
    mount = ChestMount()
    told = follow(mount, east)
    assert mount.heading_rad == pytest.approx(math.pi / 2.0, abs=1e-6)
    assert math.radians(15.0) < mount.heading_sd_rad < math.radians(45.0)
    north_m, east_m, _ = way_m(told)
    assert (abs(north_m) < 1e-6, east_m > 10.0) == (True, True)


def test_a_gap_loses_the_wearer_for_its_time() -> None:
    first = Phone(steps=20)
    begin_ns = list(first.samples())[-1].time_ns + 5_000_000_000
    mount = ChestMount()
    told = follow(mount, chain(first.samples(), Phone(steps=20).samples(begin_ns)))
    (lost,) = [one for one in told if not one.steps]
    assert (lost.end_time_ns - lost.start_time_ns) / 1e9 == pytest.approx(5.0)
    assert lost.covariance[0] > 25.0
    assert sum(one.steps for one in told) == 40
    assert mount.faults.gaps == 1
    ends_ns = [(one.start_time_ns, one.end_time_ns) for one in told]
    assert all(a[1] <= b[0] for a, b in pairwise(ends_ns))


def test_a_clock_set_back_begins_anew() -> None:
    mount = ChestMount()
    later = list(Phone(steps=20).samples(10**12))
    told = follow(mount, chain(later, Phone(steps=20).samples(10**9)))
    assert mount.faults.restarts == 1
    assert sum(one.steps for one in told) == 40


def test_batch_is_the_single_steps() -> None:
    samples = list(Phone(steps=15, turn_rad_s=0.1).samples())
    recording = Recording(
        np.array([one.time_ns for one in samples]),
        np.array([one.force_m_s2 for one in samples]),
        np.array([one.rate_rad_s for one in samples]),
    )
    mount = ChestMount()
    assert mount.steps(recording) + mount.finish() == follow(ChestMount(), samples)


def test_a_copy_resumes_alike() -> None:
    samples = list(Phone(steps=20, turn_rad_s=0.2).samples())
    mount = ChestMount()
    for sample in samples[:600]:
        mount.step(sample)
    again = copy.deepcopy(mount)
    assert follow(again, samples[600:]) == follow(mount, samples[600:])


def test_bad_samples_are_counted_and_passed_over() -> None:
    samples = list(Phone(steps=10).samples())
    bad = ImuSample(samples[99].time_ns + 1, (math.nan, 0.0, 0.0), (0.0, 0.0, 0.0))
    mount = ChestMount()
    told = follow(mount, [*samples[:100], bad, samples[40], *samples[100:]])
    assert sum(one.steps for one in told) == 10
    assert (mount.faults.unusable, mount.faults.out_of_order) == (1, 1)


def test_tilting_the_phone_is_no_turn() -> None:
    # Nodded by 40° over a second while its wearer stands; then they walk on.
    samples = list(Phone(steps=20, rest_s=6.0).samples())
    nod_rad = math.radians(40.0)
    tilted = []
    for index, one in enumerate(samples):
        share = min(1.0, max(0.0, (index - 200) / 100.0))
        rate_rad_s = (0.0, -nod_rad if 0.0 < share < 1.0 else 0.0, 0.0)
        turn = from_rotation_vector((0.0, share * nod_rad, 0.0))
        tilted.append(ImuSample(one.time_ns, rotate(turn, one.force_m_s2), rate_rad_s))
    plain, nodded = follow(ChestMount(), samples), follow(ChestMount(), tilted)
    assert way_m(nodded) == pytest.approx(way_m(plain), abs=0.1)
