"""The published chest: steps, their length, and where they lead."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable

import pytest

from edge_agent.mounts.chest_published import PublishedChestMount
from edge_agent.mounts.interface import Increment
from shared.messages import WITHOUT_GYRO, ImuSample
from tests.bouncing_phone import Phone


def follow(mount: PublishedChestMount, samples: Iterable[ImuSample]) -> list[Increment]:
    return [told for sample in samples if (told := mount.step(sample)) is not None]


@pytest.mark.parametrize("cadence_hz", [1.2, 2.0, 2.8])
def test_each_bounce_is_a_step_as_long_as_weinberg_has_it(cadence_hz: float) -> None:
    told = follow(PublishedChestMount(), Phone(steps=20, cadence_hz=cadence_hz).samples())
    assert len(told) == 20
    for one in told:
        length_m = math.hypot(*one.displacement_m)
        assert length_m == pytest.approx(0.48 * (2.0 * 3.0) ** 0.25, rel=0.02)
        assert one.steps == 1


def test_steps_follow_the_phone_round_a_corner() -> None:
    told = follow(PublishedChestMount(), Phone(steps=20, turn_rad_s=0.1).samples())
    assert told[-1].heading_rad == pytest.approx(1.0, abs=0.05)
    north_m, east_m, _ = told[-1].displacement_m
    assert math.atan2(east_m, north_m) == pytest.approx(0.97, abs=0.05)
    assert sum(one.d_heading_rad for one in told) == pytest.approx(told[-1].heading_rad)


def test_without_a_gyroscope_steps_are_counted_and_lead_nowhere() -> None:
    samples = [
        ImuSample(one.time_ns, one.force_m_s2, WITHOUT_GYRO) for one in Phone(steps=20).samples()
    ]
    mount = PublishedChestMount()
    told = follow(mount, samples)
    assert sum(one.steps for one in told) == 20
    assert all(one.displacement_m == (0.0, 0.0, 0.0) for one in told)
    assert all(one.covariance[0] > 0.1 for one in told)
    assert mount.faults.unusable == 0


def test_standing_is_no_step() -> None:
    assert not follow(PublishedChestMount(), Phone(steps=0).samples())


def test_a_copy_resumes_alike() -> None:
    mount, samples = PublishedChestMount(), list(Phone(steps=12).samples())
    begun = [mount.step(sample) for sample in samples[:500]]
    again = copy.deepcopy(mount)
    rest = [mount.step(sample) for sample in samples[500:]]
    assert [again.step(sample) for sample in samples[500:]] == rest
    assert sum(one is not None for one in begun + rest) == 12


def test_bad_samples_are_counted_and_passed_over() -> None:
    mount, samples = PublishedChestMount(), list(Phone(steps=10).samples())
    bad = ImuSample(samples[99].time_ns + 1, (math.nan, 0.0, 0.0), (0.0, 0.0, 0.0))
    told = follow(mount, [*samples[:100], bad, samples[40], *samples[100:]])
    assert len(told) == 10
    assert (mount.faults.unusable, mount.faults.out_of_order) == (1, 1)
