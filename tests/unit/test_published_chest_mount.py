"""The published chest: steps, their length, and where they lead."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator

import pytest

from edge_agent.mounts.chest_published import PublishedChestMount
from edge_agent.mounts.interface import Increment
from shared.messages import WITHOUT_GYRO, ImuSample, Vector3

RATE_HZ = 50
BOUNCE_M_S2 = 3.0


def bounces(
    steps: int, rate_rad_s: Vector3 = (0.0, 0.0, 0.0), cadence_hz: float = 2.0
) -> Iterator[ImuSample]:
    """Yield a phone that lies flat, screen down, and bounces once a step after a second's rest."""
    for index in range(round((1.0 + steps / cadence_hz + 1.0) * RATE_HZ)):
        time_s = index / RATE_HZ
        phase = (time_s - 1.0) * cadence_hz
        bounce_m_s2 = BOUNCE_M_S2 * math.sin(2.0 * math.pi * phase) if 0.0 <= phase < steps else 0.0
        yield ImuSample(round(time_s * 1e9), (0.0, 0.0, -9.81 - bounce_m_s2), rate_rad_s)


def follow(mount: PublishedChestMount, samples: Iterator[ImuSample]) -> list[Increment]:
    return [told for sample in samples if (told := mount.step(sample)) is not None]


@pytest.mark.parametrize("cadence_hz", [1.2, 2.0, 2.8])
def test_each_bounce_is_a_step_as_long_as_weinberg_has_it(cadence_hz: float) -> None:
    told = follow(PublishedChestMount(), bounces(20, cadence_hz=cadence_hz))
    assert len(told) == 20
    for one in told:
        length_m = math.hypot(*one.displacement_m)
        assert length_m == pytest.approx(0.48 * (2.0 * BOUNCE_M_S2) ** 0.25, rel=0.02)
        assert one.steps == 1


def test_steps_follow_the_phone_round_a_corner() -> None:
    told = follow(PublishedChestMount(), bounces(20, (0.0, 0.0, 0.1)))
    # 0.1 rad/s from the first sample on, to the end of the last step.
    assert told[-1].heading_rad == pytest.approx(1.1, abs=0.05)
    north_m, east_m, _ = told[-1].displacement_m
    assert math.atan2(east_m, north_m) == pytest.approx(1.08, abs=0.05)
    assert sum(one.d_heading_rad for one in told) == pytest.approx(told[-1].heading_rad)


def test_without_a_gyroscope_steps_are_counted_and_lead_nowhere() -> None:
    mount = PublishedChestMount()
    told = follow(mount, bounces(20, WITHOUT_GYRO))
    assert sum(one.steps for one in told) == 20
    assert all(one.displacement_m == (0.0, 0.0, 0.0) for one in told)
    assert all(one.covariance[0] > 0.1 for one in told)
    assert mount.faults.unusable == 0


def test_standing_is_no_step() -> None:
    assert not follow(PublishedChestMount(), bounces(0))


def test_a_copy_resumes_alike() -> None:
    mount, samples = PublishedChestMount(), list(bounces(12))
    begun = [mount.step(sample) for sample in samples[:200]]
    again = copy.deepcopy(mount)
    rest = [mount.step(sample) for sample in samples[200:]]
    assert [again.step(sample) for sample in samples[200:]] == rest
    assert sum(one is not None for one in begun + rest) == 12


def test_bad_samples_are_counted_and_passed_over() -> None:
    mount, samples = PublishedChestMount(), list(bounces(10))
    bad = ImuSample(samples[99].time_ns + 1, (math.nan, 0.0, 0.0), (0.0, 0.0, 0.0))
    late = samples[40]
    told = follow(mount, iter([*samples[:100], bad, late, *samples[100:]]))
    assert len(told) == 10
    assert (mount.faults.unusable, mount.faults.out_of_order) == (1, 1)
