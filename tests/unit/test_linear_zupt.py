"""The stride of a swing: what linear calibration removes, and what it leaves."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge_agent.inertial.linear_zupt import Stride, Swing
from shared.maths.rotations import Vector3
from shared.units import NS_PER_S

GRAVITY_M_S2 = 9.81
SWING_S = 0.8


def swing_along_x(time_s: float) -> float:
    """Acceleration of a stride of 1.3 m, at rest at both ends."""
    rate = 2.0 * math.pi / SWING_S
    return 1.3 / (2.0 * math.pi) * rate**2 * math.sin(rate * time_s)


def stride(
    acceleration_m_s2: Callable[[float], Vector3], rate_hz: float = 1000.0, start_ns: int = 7
) -> Stride:
    """Close a swing of ``SWING_S`` that reads ``acceleration_m_s2`` and gravity."""

    def force(time_s: float) -> Vector3:
        north, east, down = acceleration_m_s2(time_s)
        return (north, east, down - GRAVITY_M_S2)

    swing = Swing(start_ns, force(0.0), GRAVITY_M_S2)
    for index in range(1, round(SWING_S * rate_hz) + 1):
        time_s = index / rate_hz
        swing.add(start_ns + round(time_s * NS_PER_S), force(time_s))
    return swing.close()


def test_a_perfect_swing_is_integrated_twice() -> None:
    found = stride(lambda t: (swing_along_x(t), 0.0, 0.0))
    assert found.displacement_m == pytest.approx((1.3, 0.0, 0.0), abs=1e-5)
    assert found.residual_m_s == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert found.duration_s == pytest.approx(SWING_S)


vectors = st.tuples(*[st.floats(-5.0, 5.0)] * 3)


@given(vectors)
def test_a_constant_error_of_acceleration_is_removed_exactly(error_m_s2: Vector3) -> None:
    true = stride(lambda t: (swing_along_x(t), 0.2 * swing_along_x(t), 0.1 * swing_along_x(t)), 200)
    off = stride(
        lambda t: (
            swing_along_x(t) + error_m_s2[0],
            0.2 * swing_along_x(t) + error_m_s2[1],
            0.1 * swing_along_x(t) + error_m_s2[2],
        ),
        200,
    )
    assert off.displacement_m == pytest.approx(true.displacement_m, abs=1e-9)
    residual = tuple(e * SWING_S + r for e, r in zip(error_m_s2, true.residual_m_s, strict=True))
    assert off.residual_m_s == pytest.approx(residual, abs=1e-9)


def test_height_is_part_of_the_stride() -> None:
    found = stride(lambda t: (0.0, 0.0, -0.15 * swing_along_x(t)))
    assert found.displacement_m == pytest.approx((0.0, 0.0, -0.15 * 1.3), abs=1e-5)


def test_an_error_that_does_not_grow_evenly_is_not_removed() -> None:
    kick_s = 0.25 * SWING_S

    def kicked(t: float) -> Vector3:
        return (swing_along_x(t) + (100.0 if abs(t - kick_s) < 0.005 else 0.0), 0.0, 0.0)

    found = stride(kicked)
    # A kick of r at t0 leaves r·(T/2 − t0): here a quarter of r·T.
    expected_m = 1.3 + found.residual_m_s[0] * (SWING_S / 2.0 - kick_s)
    assert found.displacement_m[0] == pytest.approx(expected_m, abs=0.01 * found.residual_m_s[0])


def test_the_path_goes_from_the_start_to_the_stride() -> None:
    found = stride(lambda t: (swing_along_x(t), 0.0, 0.0), 100.0, start_ns=5_000_000_000)
    first, last = found.path[0], found.path[-1]
    assert first == (5_000_000_000, 0.0, 0.0, 0.0)
    assert last.time_ns == 5_800_000_000
    assert (last.north_m, last.east_m, last.down_m) == found.displacement_m
    assert len(found.path) == 81
    middle = found.path[40]
    assert middle.north_m == pytest.approx(0.65, abs=0.01)


def test_stamps_need_not_be_even() -> None:
    stamps_s = [SWING_S * (k / 400 + 0.001 * math.sin(k)) for k in range(1, 400)]
    swing = Swing(0, (0.0, 0.0, -GRAVITY_M_S2), GRAVITY_M_S2)
    for time_s in [*stamps_s, SWING_S]:
        force = (swing_along_x(time_s), 0.0, -GRAVITY_M_S2)
        swing.add(round(time_s * NS_PER_S), force)
    assert swing.close().displacement_m[0] == pytest.approx(1.3, abs=1e-3)
