"""A second of samples, measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain
from statistics import fmean, median
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from edge_agent.mounts.intake import LARGEST_READING
from edge_agent.mounts.interface import Faults
from edge_agent.self_check.settings import SelfCheckSettings
from shared.messages import ImuSample
from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]

SECONDS = 10
"""Findings are over so many."""

BUNCHED_SHARE = 0.02
"""More steps than this shorter than half the usual one: samples come in bunches."""

SHORTEST_PERIOD_S = 0.0005
"""No such sensor is read faster."""

FEWEST_AT_REST = 10


class Rest(NamedTuple):
    """What a sensor that stands still reads: the size of rate, and of force."""

    rate_rad_s: float
    force_m_s2: float


class Second(NamedTuple):
    """A second of samples. ``low`` and ``high`` (6,) bound what each axis read, force first."""

    size: int
    missing: float
    rate_hz: float
    flat_top_force: int
    flat_top_rate: int
    low: Array
    high: Array
    faults: Faults
    temperature_c: float | None
    rest: Rest | None


def measure(samples: Sequence[ImuSample], faults: Faults, settings: SelfCheckSettings) -> Second:
    """Measure ``samples``, a second of them and at least one; ``faults`` were found in them."""
    values = chain.from_iterable((*one.force_m_s2, *one.rate_rad_s) for one in samples)
    readings = np.fromiter(values, np.float64, 6 * len(samples)).reshape(-1, 6)
    sound = np.abs(readings) <= LARGEST_READING
    whole = sound.all(axis=1)
    # Without a gyroscope there are forces to look at.
    readings = readings[whole if whole.any() else sound[:, :3].all(axis=1)]
    if not len(readings):
        readings = np.full((1, 6), np.nan)
    missing, rate_hz = _pace(np.diff([one.time_ns for one in samples]) / NS_PER_S)
    return Second(
        len(samples),
        missing,
        rate_hz,
        _flat_tops(readings[:, :3], settings.high_m_s2, settings.flat_samples),
        _flat_tops(readings[:, 3:], settings.high_rad_s, settings.flat_samples),
        readings.min(axis=0),
        readings.max(axis=0),
        faults,
        _mean_temperature_c(samples),
        _rest(readings, settings),
    )


def _rest(readings: Array, settings: SelfCheckSettings) -> Rest | None:
    """Return what ``readings`` (n, 6) are in the mean, if the sensor stood still."""
    scatter = readings.std(axis=0)
    if len(readings) < FEWEST_AT_REST or scatter[3:].max() > settings.still_rad_s:
        return None
    if not scatter[:3].max() <= settings.still_m_s2:
        return None
    force, rate = readings[:, :3].mean(axis=0), readings[:, 3:].mean(axis=0)
    return Rest(float(np.linalg.norm(rate)), float(np.linalg.norm(force)))


def _flat_tops(readings: Array, high: float, fewest: int) -> int:
    """Return how many samples are in runs of the same reading beyond ``high``, ``fewest`` long."""
    same = (readings[1:] == readings[:-1]) & (np.abs(readings[1:]) > high)
    run = same
    for _ in range(fewest - 2):
        run = run[1:] & same[: len(run) - 1]
    return int(np.count_nonzero(run.any(axis=1)))


def _pace(step_s: Array) -> tuple[float, float]:
    """Return how many samples are missing between steps (n,) of time, and the rate in Hz.

    Where they come in bunches, time stamps say when they arrived, and not which are missing.
    """
    step_s = step_s[step_s >= 0.0]
    if not step_s.size or step_s.sum() == 0.0:
        return 0.0, 0.0
    usual_s = median(step_s.tolist())
    if np.mean(step_s < max(0.5 * usual_s, SHORTEST_PERIOD_S)) > BUNCHED_SHARE:
        return 0.0, step_s.size / float(step_s.sum())
    return float(np.sum(np.maximum(np.round(step_s / usual_s) - 1.0, 0.0))), 1.0 / usual_s


def _mean_temperature_c(samples: Sequence[ImuSample]) -> float | None:
    """Return the mean of what the samples say of the sensor's temperature, if any does."""
    told = [one.temperature_c for one in samples if one.temperature_c is not None]
    return fmean(told) if told and math.isfinite(sum(told)) else None
