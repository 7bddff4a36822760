"""The published waist method, rule by rule."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest

from edge_agent.inertial.foot_strikes import FootStrikes
from edge_agent.inertial.gyro_or_compass import GyroOrCompass
from edge_agent.inertial.momentary_stop import WINDOW, MomentaryStop
from edge_agent.inertial.velocity_high_pass import HighPassedVelocity
from edge_agent.mounts.methods import make_mount
from edge_agent.mounts.waist_published import PublishedWaistMount
from shared.messages import ImuSample

PERIOD_S = 0.01
G_M_S2 = 9.80665


@pytest.mark.parametrize(("swing_g", "stops"), [(0.039, True), (0.041, False)])
def test_a_stop_is_eleven_samples_that_hardly_differ(swing_g: float, *, stops: bool) -> None:
    stop = MomentaryStop()
    # Half above and half below: the standard deviation is the swing, but for the odd sample.
    size_m_s2 = swing_g * G_M_S2 / math.sqrt(1.0 - 1.0 / WINDOW**2)
    for index in range(WINDOW):
        stop.step((0.0, (-1.0) ** index * size_m_s2, -G_M_S2), PERIOD_S)
        assert stop.stopped == (stops and index == WINDOW - 1)


def test_gravity_is_found_again_when_the_unit_was_turned() -> None:
    stop = MomentaryStop()
    for _ in range(150):
        stop.step((0.0, 0.0, -G_M_S2), PERIOD_S)
    assert stop.gravity_m_s2 == pytest.approx((0.0, 0.0, -G_M_S2))
    turned = (0.6 * G_M_S2, 0.0, -0.8 * G_M_S2)
    for _ in range(WINDOW + 95):
        stop.step(turned, PERIOD_S)
    assert stop.gravity_m_s2 == pytest.approx((0.0, 0.0, -G_M_S2))
    for _ in range(10):
        stop.step(turned, PERIOD_S)
    assert stop.gravity_m_s2 == pytest.approx(turned)


@pytest.mark.parametrize(("hertz", "gain"), [(0.05, 0.1), (0.5, math.sqrt(0.5)), (5.0, 1.0)])
def test_velocity_is_high_passed_at_half_a_hertz(hertz: float, gain: float) -> None:
    velocity = HighPassedVelocity()
    rate = 2.0 * math.pi * hertz
    time_s = np.arange(round(40.0 / PERIOD_S)) * PERIOD_S
    passed = [velocity.step(value, PERIOD_S) for value in (rate * np.cos(rate * time_s)).tolist()]
    assert np.std(passed[2000:]) * math.sqrt(2.0) == pytest.approx(gain, abs=0.03)
    velocity.stop()
    assert velocity.velocity_m_s == 0.0


@pytest.mark.parametrize(
    ("gyro_deg_s", "compass_deg_s", "believed_deg_s"),
    [
        (0.0, 40.0, 0.0),  # iron: the compass swings, nobody turns
        (1.0, -20.0, 1.0),
        (30.0, 0.0, 0.0),  # the compass stands still
        (30.0, -20.0, 30.0),  # signs differ
        (30.0, 20.0, 20.0),  # both turn alike
        (1.0, 2.0, 2.0),
    ],
)
def test_each_sample_believes_gyro_or_compass(
    gyro_deg_s: float, compass_deg_s: float, believed_deg_s: float
) -> None:
    selection = GyroOrCompass()
    selection.step(0.0, math.radians(10.0), 0.0)
    compass_deg = 10.0 + compass_deg_s * PERIOD_S
    selection.step(math.radians(gyro_deg_s), math.radians(compass_deg), PERIOD_S)
    turned_deg = math.degrees(selection.heading_rad) - 10.0
    assert turned_deg == pytest.approx(believed_deg_s * PERIOD_S, abs=1e-9)


def test_without_a_compass_the_gyro_is_believed() -> None:
    selection = GyroOrCompass()
    for _ in range(100):
        selection.step(0.5, None, PERIOD_S)
    assert selection.heading_rad == pytest.approx(0.5)


def test_of_peaks_close_together_the_highest_is_the_strike() -> None:
    strikes = FootStrikes()
    up_m_s2 = np.zeros(300)
    up_m_s2[[50, 60, 120, 130, 200]] = 3.0, 5.0, 4.0, 2.0, 1.0
    told = [strikes.step(10_000_000 * index, value) for index, value in enumerate(up_m_s2.tolist())]
    assert [one for one in told if one is not None] == [600_000_000, 1_200_000_000]


def swings(count: int) -> list[ImuSample]:
    """Return a unit that rests for two seconds, then swings ahead and up twice a second."""
    samples = []
    for index in range(200 + 50 * count):
        phase = 2.0 * math.pi * max(0, index - 200) / 50
        force = (2.0 * math.cos(phase), 0.0, -G_M_S2 - 3.0 * math.sin(phase))
        if index < 200:
            force = (0.0, 0.0, -G_M_S2)
        samples.append(ImuSample(10_000_000 * index, force, (0.0, 0.0, 0.0)))
    return samples


def test_a_step_is_as_long_as_its_velocity_swings_times_its_period() -> None:
    mount = PublishedWaistMount()
    told = [one for sample in swings(10) if (one := mount.step(sample)) is not None]
    assert len(told) == 10
    assert math.hypot(*told[0].displacement_m) == 0.0
    # 2 m/s² at 2 Hz swings by 2·2/(2π·2) m/s; the filter, here some 3 % too strict, takes 3 %.
    expected_m = 0.5 * 2.0 * 2.0 / (4.0 * math.pi) / math.hypot(1.0, 0.25)
    assert math.hypot(*told[-1].displacement_m) == pytest.approx(expected_m, rel=0.05)


def test_a_copy_goes_on_alike_and_bad_samples_are_counted() -> None:
    samples = swings(8)
    mount = make_mount("waist", "published")
    first = [mount.step(sample) for sample in samples[:300]]
    other = copy.deepcopy(mount)
    assert [mount.step(one) for one in samples[300:]] == [other.step(one) for one in samples[300:]]
    assert any(one is not None for one in first)
    bad = (math.nan, 0.0, 0.0)
    assert mount.step(ImuSample(10**12, bad, bad)) is None
    assert mount.step(samples[0]) is None
    assert (mount.faults.unusable, mount.faults.out_of_order) == (1, 1)
