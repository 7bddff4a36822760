"""Phones that lie and slip as chance has it: what they read is the same drive, turned."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.random import default_rng
from scipy.spatial.transform import Rotation

from edge_agent.evaluation.vehicle_mountings import GYRO_RANGE_RAD_S, Lie, mounted
from edge_agent.inertial.gravity_alignment import GravityAlignment
from edge_agent.sources.recording import Recording

RATE_HZ = 100.0


def parked(seconds: float = 60.0) -> Recording:
    """A fixed sensor that reads nothing but gravity, forward-right-down."""
    count = round(seconds * RATE_HZ)
    force_m_s2 = np.tile([0.0, 0.0, -9.8], (count, 1))
    return Recording(
        np.rint(1e9 * np.arange(count) / RATE_HZ).astype(np.int64), force_m_s2, 0.0 * force_m_s2
    )


@pytest.mark.parametrize("lie", ["tilted", "any"])
@pytest.mark.parametrize("seed", range(6))
def test_a_gyroscope_reads_the_turn_of_every_slip_within_its_range(lie: Lie, seed: int) -> None:
    made = mounted(parked(), lie, default_rng(seed))
    assert [slip.begin_s for slip in made.slips] == sorted(slip.begin_s for slip in made.slips)
    assert np.abs(made.recording.rate_rad_s).max() <= GYRO_RANGE_RAD_S
    time_s = made.recording.time_ns / 1e9
    for slip in made.slips:
        rows = (time_s > slip.begin_s - 0.05) & (time_s <= slip.end_s + 0.05)
        turned = Rotation.identity()
        for rate in made.recording.rate_rad_s[rows]:
            turned = turned * Rotation.from_rotvec(rate / RATE_HZ)
        if slip.kind == "step":
            assert turned.magnitude() <= 1.05 * slip.angle_rad
        else:
            assert turned.magnitude() == pytest.approx(slip.angle_rad, rel=0.05)


def test_the_same_seed_makes_the_same_mounting() -> None:
    first, again = (mounted(parked(), "any", default_rng(4)) for _ in range(2))
    assert first.slips == again.slips
    assert np.array_equal(first.recording.force_m_s2, again.recording.force_m_s2)


@pytest.mark.parametrize("tilt_deg", [(20.0, 0.0), (0.0, -25.0), (15.0, 30.0)])
def test_the_published_alignment_is_renewed_within_a_fifth_of_a_second(
    tilt_deg: tuple[float, float],
) -> None:
    tilt_rad = [math.radians(angle) for angle in tilt_deg]
    sensor = Rotation.from_euler("YX", tilt_rad).inv()
    alignment = GravityAlignment()
    upright, slipped = np.array([0.0, 0.0, -9.8]), sensor.apply([0.0, 0.0, -9.8])
    slips_at_s = 3.0
    for row in range(600):
        time_s = row / RATE_HZ
        x, y, z = (upright if time_s < slips_at_s else slipped).tolist()
        alignment.step(time_s, (x, y, z), 1.0 / RATE_HZ)
        level = alignment.level((x, y, z))
        if 0.2 <= time_s < slips_at_s or time_s > slips_at_s + 0.2:
            assert math.hypot(*level[:2]) < 0.05 * 9.8


def test_the_published_alignment_holds_through_vibration() -> None:
    chance = default_rng(1)
    alignment = GravityAlignment()
    held = []
    for row in range(1000):
        x, y, z = (np.array([0.0, 0.0, -9.8]) + chance.normal(0.0, 0.5, 3)).tolist()
        alignment.step(row / RATE_HZ, (x, y, z), 1.0 / RATE_HZ)
        if row > 50:
            held.append(alignment.level_from_sensor)
    assert len(set(held)) == 1
