"""Bursts of lost samples: filled from the stride before, where there was one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
import pytest

from edge_agent.inertial.walk_bridge import WalkBridge
from edge_agent.mounts.chest import ChestMount
from edge_agent.mounts.interface import Increment
from shared.messages import ImuSample
from shared.units import NS_PER_S
from tests.bouncing_phone import Phone


def without(samples: Iterable[ImuSample], first_s: float, lasting_s: float) -> list[ImuSample]:
    begin_ns, end_ns = first_s * NS_PER_S, (first_s + lasting_s) * NS_PER_S
    return [one for one in samples if not begin_ns < one.time_ns < end_ns]


def filled(samples: Iterable[ImuSample], longest_s: float = 1.0) -> list[ImuSample]:
    bridge = WalkBridge(longest_s)
    return [one for sample in samples for one in bridge.take(sample)]


def follow(samples: Iterable[ImuSample]) -> list[Increment]:
    mount = ChestMount()
    told = [one for sample in samples if (one := mount.step(sample)) is not None]
    return told + mount.finish()


@pytest.mark.parametrize("lasting_s", [0.3, 0.5, 0.9])
def test_what_a_walk_lost_is_laid_in_as_it_was(lasting_s: float) -> None:
    whole = list(Phone(steps=20, turn_rad_s=0.2).samples())
    made = filled(without(whole, 8.0, lasting_s))
    assert [one.time_ns for one in made] == pytest.approx([one.time_ns for one in whole], abs=2e7)
    true, told = (np.array([one.force_m_s2[2] for one in each]) for each in (whole, made))
    assert np.abs(true - told).max() < 0.3
    assert sum(one.rate_rad_s[2] for one in made) == pytest.approx(0.2 * 100 * 10.0, rel=0.01)


@pytest.mark.parametrize("lasting_s", [0.3, 0.5, 0.9])
def test_no_step_is_lost_with_a_burst_but_the_turn_is_doubted(lasting_s: float) -> None:
    whole = list(Phone(steps=20).samples())
    told, plain = follow(without(whole, 8.0, lasting_s)), follow(whole)
    assert [one.steps for one in told] == [1] * 20
    doubt_rad2 = max(one.covariance[9] for one in told)
    assert doubt_rad2 > (0.4 * lasting_s) ** 2 > 10.0 * max(one.covariance[9] for one in plain)


def test_what_does_not_repeat_itself_is_not_filled() -> None:
    chance = np.random.default_rng(3)
    shaken = [replace_force(one, chance.normal(0.0, 3.0, 3)) for one in Phone(steps=20).samples()]
    lossy = without(shaken, 8.0, 0.5)
    assert filled(lossy) == lossy


def test_a_long_gap_is_not_filled_nor_what_came_before_a_clock_was_set_back() -> None:
    lossy = without(Phone(steps=20).samples(), 8.0, 1.2)
    assert filled(lossy) == lossy
    bridge, begun = WalkBridge(1.0), list(Phone(steps=20).samples())[:900]
    for sample in begun:
        bridge.take(sample)
    again = ImuSample(1, (0.0, 0.0, -9.81), (0.0, 0.0, 0.0))
    assert bridge.take(again, restart=True) == [again]


def test_a_sensor_that_repeats_one_reading_is_lost_and_not_at_rest() -> None:
    told = follow(frozen(Phone(steps=40).samples(), 8.0, 13.0))
    (lost,) = [one for one in told if not one.steps]
    assert (lost.end_time_ns - lost.start_time_ns) / NS_PER_S == pytest.approx(4.5, abs=0.1)
    assert math.sqrt(lost.covariance[0]) > 5.0


@pytest.mark.parametrize("scale", [1.0 / 9.81, 1000.0 / 9.81])
def test_forces_in_g_tell_no_step(scale: float) -> None:
    other = [
        ImuSample(one.time_ns, scaled(one, scale), one.rate_rad_s)
        for one in Phone(steps=20, bounce_m_s2=9.0).samples()
    ]
    assert follow(other) == []


def replace_force(sample: ImuSample, more_m_s2: np.ndarray) -> ImuSample:
    x, y, z = (np.array(sample.force_m_s2) + more_m_s2).tolist()
    return ImuSample(sample.time_ns, (x, y, z), sample.rate_rad_s)


def scaled(sample: ImuSample, scale: float) -> tuple[float, float, float]:
    x, y, z = sample.force_m_s2
    return scale * x, scale * y, scale * z


def frozen(samples: Iterable[ImuSample], begin_s: float, end_s: float) -> Iterator[ImuSample]:
    held: ImuSample | None = None
    for one in samples:
        if begin_s * NS_PER_S <= one.time_ns < end_s * NS_PER_S:
            held = held or one
            yield ImuSample(one.time_ns, held.force_m_s2, held.rate_rad_s)
        else:
            yield one
