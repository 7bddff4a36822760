"""The step that closes a walk: told where the trunk still went on at the last landing."""

from __future__ import annotations

import numpy as np
import pytest

from edge_agent.inertial.closing_step import LEFT_M_S, ClosingStep

RATE_HZ = 100.0
LANDED_NS = 1_000_000_000


def closings(
    braking_m_s2: float,
    *,
    shaken_s: float = 1.5,
    off_level_m_s2: float = 0.0,
    heading_rad: float = 0.0,
) -> list[float]:
    """Return when closing steps landed, s, of who brakes for half a second after 1 s.

    The trunk shakes until ``shaken_s`` and is quiet from then on.
    """
    detector = ClosingStep(RATE_HZ)
    ahead = np.array([np.cos(heading_rad), np.sin(heading_rad)])
    told = []
    for index in range(400):
        time_s = index / RATE_HZ
        north, east = off_level_m_s2 - ahead * braking_m_s2 * (1.0 < time_s <= 1.5)
        up = 2.0 if time_s < shaken_s else 0.1
        if index == round(LANDED_NS / 1e9 * RATE_HZ):
            detector.land(LANDED_NS)
        closed_ns = detector.step(round(time_s * 1e9), (float(north), float(east), up))
        if closed_ns is not None:
            told.append(closed_ns / 1e9)
    return told


def test_who_still_went_on_has_set_another_foot_down() -> None:
    assert closings(1.6) == pytest.approx([1.5])


def test_who_had_hardly_any_speed_left_has_not() -> None:
    least_m_s2 = LEFT_M_S / 0.5
    assert closings(0.9 * least_m_s2) == []
    assert closings(1.1 * least_m_s2) == pytest.approx([1.5])


@pytest.mark.parametrize("heading_rad", [0.0, 1.0, 3.0])
def test_a_level_that_is_off_and_any_heading_change_nothing(heading_rad: float) -> None:
    assert closings(1.6, off_level_m_s2=0.4, heading_rad=heading_rad) == pytest.approx([1.5])
    assert closings(0.3, off_level_m_s2=0.8, heading_rad=heading_rad) == []


def test_who_goes_on_shaking_for_long_is_not_told() -> None:
    assert closings(1.6, shaken_s=2.1) == pytest.approx([2.1])
    assert closings(1.6, shaken_s=2.4) == []


def test_a_landing_closes_once() -> None:
    detector = ClosingStep(RATE_HZ)
    detector.land(0)
    told = []
    for index in range(1, 400):
        up = 2.0 if index < 50 or 150 < index < 200 else 0.0
        braked = -2.0 if index < 50 else 0.0
        told.append(detector.step(index * 10_000_000, (braked, 0.0, up)))
    assert [one for one in told if one is not None] == [500_000_000]
