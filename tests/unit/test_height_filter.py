"""Boot and barometer weighed: better together, and the boot no worse for a bad barometer."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from edge_agent.evaluation.truth import Array
from edge_agent.inertial.boot_state import LOST, STANDING, STRIDE, Stride, lost_stride
from edge_agent.inertial.height_filter import HeightFilter
from edge_agent.inertial.stride_path import StridePath
from shared.messages import ImuSample
from shared.units import NS_PER_S

STRIDE_S = 1.1
SD_M, ALIKE_M = 0.012, 0.008
"""What a stride's height errs by at random, and what all of a walk's err by alike (sd)."""

READINGS_HZ = 25.0
NOISE_M = 0.12
PA_PER_M = 101_325.0 * 9.81 / (287.05 * 288.15)

Disturb = Callable[[float], float | None]


def stride(kind: int, index: int, up_m: float, sd_m: float) -> Stride:
    start_ns, end_ns = (round((index + k) * STRIDE_S * NS_PER_S) for k in (0, 1))
    time_ns = np.linspace(start_ns, end_ns, 12).astype(np.int64)
    share = np.linspace(0.0, 1.0, 12)
    covariance = tuple(map(tuple, np.diag([4e-4, 4e-4, sd_m**2, 1e-5]).tolist()))
    path = StridePath(time_ns, np.column_stack((share, 0.0 * share, -up_m * share)))
    return Stride(
        kind, start_ns, end_ns, (1.0, 0.0, -up_m), 0.0, 0.0, covariance,
        3.0, 0.0, 0.0, 0.01, 0.07, path,
    )  # fmt: skip


def walk(
    true_up_m: Array, disturb_pa: Disturb, seed: int = 0, alike_m: float | None = None
) -> Iterator[tuple[Stride, Stride, float]]:
    """Each stride as the boot told it, as it was corrected, and how far it really rose."""
    rng = np.random.default_rng(seed)
    alike_m = rng.normal(0.0, ALIKE_M) if alike_m is None else alike_m
    height_filter = HeightFilter()
    heights_m = np.concatenate(([0.0], np.cumsum(true_up_m)))
    strides_s = STRIDE_S * np.arange(len(heights_m))
    steps_s = (np.arange(round(STRIDE_S * READINGS_HZ)) + 0.5) / READINGS_HZ
    told_sd_m = math.hypot(SD_M, ALIKE_M)
    for index, rise_m in enumerate(true_up_m.tolist()):
        times_s = index * STRIDE_S + steps_s
        noisy_m = np.interp(times_s, strides_s, heights_m) - rng.normal(0.0, NOISE_M, steps_s.size)
        readings_pa = (98_000.0 - PA_PER_M * noisy_m).tolist()
        for step, (time_s, reading_pa) in enumerate(
            zip(times_s.tolist(), readings_pa, strict=True)
        ):
            added_pa = disturb_pa(time_s)
            pressure_pa = None if added_pa is None else reading_pa + added_pa
            # A boot that walks turns at each stride.
            sample = ImuSample(
                round(time_s * NS_PER_S), (0.0, 0.0, -9.81), (0.0, 3.0 * (step < 12), 0.0),
                None, pressure_pa,
            )  # fmt: skip
            height_filter.take(sample)
        told = stride(STRIDE, index, rise_m + alike_m + rng.normal(0.0, SD_M), told_sd_m)
        yield told, height_filter.correct(told), rise_m


def end_errors_m(disturb_pa: Disturb, true_up_m: Array, walks: int = 4) -> tuple[float, float]:
    """RMS errors of the height at the end over some walks: by the boot alone, and corrected."""
    errors = []
    for seed in range(walks):
        told, corrected, true_m = 0.0, 0.0, 0.0
        for boot, both, rise_m in walk(true_up_m, disturb_pa, seed):
            told, corrected = told - boot.displacement_m[2], corrected - both.displacement_m[2]
            true_m += rise_m
        errors.append((told - true_m, corrected - true_m))
    boot_m, both_m = np.sqrt(np.mean(np.square(errors), axis=0)).tolist()
    return boot_m, both_m


LEVEL = np.zeros(120)
FLIGHTS = np.concatenate([np.zeros(40), np.full(20, 0.33), np.zeros(40), np.full(20, -0.33)])


def calm(_: float) -> float:
    return 0.0


def test_without_readings_strides_are_as_they_were() -> None:
    for boot, both, _ in walk(FLIGHTS, lambda _: None):
        assert both is boot


@pytest.mark.parametrize("unit", [1e-2, 1e-3, math.nan, 10.0])
def test_readings_in_another_unit_change_nothing(unit: float) -> None:
    height_filter = HeightFilter()
    for index in range(50):
        sample = ImuSample(
            index * 40_000_000, (0.0, 0.0, -9.8), (0.0, 0.0, 0.0), None, 1e5 * unit + index
        )
        height_filter.take(sample)
    boot = stride(STRIDE, 0, 0.1, 0.02)
    assert height_filter.correct(boot) is boot


@pytest.mark.parametrize("true_up_m", [LEVEL, FLIGHTS])
def test_a_barometer_in_calm_air_takes_most_of_the_drift(true_up_m: Array) -> None:
    boot_m, both_m = end_errors_m(calm, true_up_m)
    assert both_m < 0.4 * boot_m


def test_what_is_told_is_as_sure_as_it_says() -> None:
    """Rather less sure than it might be: real barometers err alike over moments, this one not."""
    sigmas = np.array(
        [
            (both.displacement_m[2] + rise_m) / math.sqrt(both.covariance[2][2])
            for seed in range(8)
            for _, both, rise_m in walk(FLIGHTS, calm, seed)
        ]
    )
    assert np.mean(np.abs(sigmas) < 1.96) > 0.93
    assert 0.4 < np.sqrt(np.mean(sigmas**2)) < 1.1


SLOW = "up and down at 0.25 m/s"
BAD: dict[str, Disturb] = {
    "steps of 4 m": lambda time_s: 50.0 * (int(time_s / 10.0) % 2),
    "steps of 1 m": lambda time_s: 12.0 * (int(time_s / 7.0) % 2),
    "a fan that starts": lambda time_s: 40.0 * -math.expm1(-max(0.0, time_s - 50.0) / 5.0),
    SLOW: lambda time_s: 3.0 * abs(time_s % 40.0 - 20.0),
    "spikes": lambda time_s: 400.0 * (int(time_s * READINGS_HZ) % 12 == 0),
    "gaps": lambda time_s: 0.0 if int(time_s / 15.0) % 2 else None,
}


@pytest.mark.parametrize("disturbance", BAD)
@pytest.mark.parametrize("true_up_m", [LEVEL, FLIGHTS])
def test_a_bad_barometer_makes_it_little_worse(disturbance: str, true_up_m: Array) -> None:
    # What is slow errs by nearly as much as is allowed: it is looked at over more walks.
    walks = 12 if disturbance == SLOW else 4
    boot_m, both_m = end_errors_m(BAD[disturbance], true_up_m, walks)
    assert both_m < 1.25 * boot_m + 0.1


def test_a_barometer_that_hangs_on_a_flight_takes_little_of_it() -> None:
    """It reads on as it stood before the climb, and the filter knows after two seconds."""
    height_filter, total_m = HeightFilter(), 0.0
    for index in range(60):
        for step in range(27):
            time_ns = round((index * STRIDE_S + (step + 0.5) / READINGS_HZ) * NS_PER_S)
            moves = (step * 7 % 5) * (index < 40)
            height_filter.take(
                ImuSample(time_ns, (0.0, 0.0, -9.8), (0.0, 3.0, 0.0), None, 98_000.0 + moves)
            )
        rise_m = 0.33 if index >= 40 else 0.0
        total_m -= height_filter.correct(stride(STRIDE, index, rise_m, 0.015)).displacement_m[2]
    assert total_m == pytest.approx(20 * 0.33, abs=0.15)


def test_a_boot_that_was_lost_is_found_again_in_height() -> None:
    height_filter = HeightFilter()
    for index in range(40):
        rise_m = 6.0 if index >= 30 else 0.0
        for step in range(27):
            time_ns = round((index * STRIDE_S + (step + 0.5) / READINGS_HZ) * NS_PER_S)
            pressure_pa = 98_000.0 - PA_PER_M * rise_m + step * 7 % 5
            height_filter.take(
                ImuSample(time_ns, (0.0, 0.0, -9.8), (0.0, 3.0, 0.0), None, pressure_pa)
            )
        if index < 20:
            height_filter.correct(stride(STANDING, index, 0.0, 0.01))
    gap = lost_stride(round(20 * STRIDE_S * NS_PER_S), round(40 * STRIDE_S * NS_PER_S), 0.0)
    found = height_filter.correct(gap)
    assert found.kind == LOST
    assert -found.displacement_m[2] == pytest.approx(6.0 * 1.04, abs=0.4)
    assert 0.1 < math.sqrt(found.covariance[2][2]) < 1.5
