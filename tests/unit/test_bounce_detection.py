"""Steps by the bounce of the body: what counts as one, and what does not."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise

import pytest

from edge_agent.inertial.bounce_detection import Bounce, BounceDetector

RATE_HZ = 50
TICK_NS = 20_000_000


def bouts(*each: tuple[float, float, float]) -> list[float]:
    """Return forces of bouts (seconds, steps a second, m/s²) with three seconds' rest between."""
    forces = [9.81] * (3 * RATE_HZ)
    for lasts_s, cadence_hz, bounce_m_s2 in each:
        count = round(lasts_s * RATE_HZ)
        forces += [
            9.81 + bounce_m_s2 * math.sin(2.0 * math.pi * cadence_hz * index / RATE_HZ)
            for index in range(count)
        ]
        forces += [9.81] * (3 * RATE_HZ)
    return forces


def found(forces: Iterable[float]) -> list[Bounce]:
    detector = BounceDetector()
    told = [
        bounce
        for tick, force_m_s2 in enumerate(forces)
        for bounce in detector.step(tick * TICK_NS, force_m_s2)
    ]
    return told + detector.finish()


@pytest.mark.parametrize(
    ("cadence_hz", "bounce_m_s2"),
    [(0.7, 0.8), (1.0, 1.0), (1.5, 1.5), (2.0, 3.0), (2.5, 6.0), (3.0, 12.0)],
)
def test_every_pace_is_counted(cadence_hz: float, bounce_m_s2: float) -> None:
    steps = 20
    told = found(bouts((steps / cadence_hz, cadence_hz, bounce_m_s2)))
    assert len(told) == steps
    for bounce in told[1:]:
        assert (bounce.end_time_ns - bounce.start_time_ns) / 1e9 == pytest.approx(
            1.0 / cadence_hz, abs=0.05
        )


def test_soft_steps_after_hard_ones_count() -> None:
    assert len(found(bouts((10.0, 2.0, 6.0), (10.0, 1.0, 1.0)))) == 30


def test_a_step_follows_the_one_before() -> None:
    told = found(bouts((10.0, 2.0, 3.0)))
    assert all(a.end_time_ns == b.start_time_ns for a, b in pairwise(told))


def test_harder_steps_are_told_harder() -> None:
    soft, hard = (found(bouts((10.0, 2.0, bounce)))[10].mean_m_s2 for bounce in (2.0, 4.0))
    assert hard == pytest.approx(2.0 * soft, rel=1e-6)


def test_a_jolt_by_itself_is_no_step() -> None:
    forces = bouts((0.5, 2.0, 20.0))
    assert found(forces) == []


def test_standing_and_trembling_is_no_step() -> None:
    trembling = [9.81 + 0.25 * math.sin(0.9 * tick) for tick in range(1000)]
    assert found(trembling) == []


def test_steps_that_end_with_the_samples_are_told() -> None:
    whole = bouts((10.0, 2.0, 3.0))
    cut = whole[: len(whole) - 3 * RATE_HZ - RATE_HZ // 8]
    assert len(found(cut)) == 20


def test_nothing_comes_of_nothing() -> None:
    assert BounceDetector().finish() == []
