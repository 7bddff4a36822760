"""The gyro's bias is learnt from whole seconds of stillness, and from nothing else."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from edge_agent.inertial.gyro_bias import GyroBias
from shared.maths.rotations import Vector3

BIAS = (0.01, -0.02, 0.005)


def rest(bias: GyroBias, seconds: float, rate: Callable[[int], Vector3]) -> None:
    for index in range(round(seconds * 100)):
        bias.add(rate(index), 0.01)


def test_a_second_of_stillness_tells_the_bias() -> None:
    bias = GyroBias()
    chance = np.random.default_rng(1)

    def noisy(_: int) -> Vector3:
        x, y, z = np.array(BIAS) + chance.normal(0.0, math.radians(0.3), 3)
        return (x, y, z)

    rest(bias, 1.0, noisy)
    assert bias.known
    assert bias.bias_rad_s == pytest.approx(BIAS, abs=math.radians(0.1))


@pytest.mark.parametrize(
    "rate",
    [
        pytest.param(lambda _: (0.0, 0.0, math.radians(10.0)), id="a boot that turns"),
        pytest.param(lambda k: (0.0, 0.05 * (-1.0) ** k, 0.0), id="a boot that trembles"),
    ],
)
def test_what_is_not_still_is_not_bias(rate: Callable[[int], Vector3]) -> None:
    bias = GyroBias()
    rest(bias, 3.0, rate)
    assert not bias.known
    assert bias.bias_rad_s == (0.0, 0.0, 0.0)


def test_stillness_that_is_interrupted_does_not_add_up() -> None:
    bias = GyroBias()
    for _ in range(5):
        rest(bias, 0.6, lambda _: BIAS)
        bias.interrupt()
    assert not bias.known


def test_a_bias_that_wanders_is_followed() -> None:
    bias = GyroBias()
    rest(bias, 1.0, lambda _: BIAS)
    rest(bias, 60.0, lambda _: (0.0, 0.0, 0.03))
    assert bias.bias_rad_s == pytest.approx((0.0, 0.0, 0.03), abs=1e-3)
