"""What the last seconds tell of a sensor, in words that say what to do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import fmean, median
from typing import NamedTuple

import numpy as np

from edge_agent.self_check.second import SECONDS, Second
from edge_agent.self_check.settings import SelfCheckSettings
from shared.messages import HealthLevel

STRIDES = 20


class Finding(NamedTuple):
    """How bad something is, and what it is."""

    level: HealthLevel
    words: str


class Seen(NamedTuple):
    """All that findings are drawn from.

    ``worn`` names where the sensor is, ``slow_hz`` the rates below which it is too slow there.
    ``bias_rad_s`` and ``gravity_off_m_s2`` are of when it last stood still; then comes whether its
    forces, or its compass, contradict its turns; ``strides`` are how long the last movements took
    (s).
    """

    worn: str
    slow_hz: tuple[float, float] | None
    settings: SelfCheckSettings
    seconds: Sequence[Second]
    bias_rad_s: float
    gravity_off_m_s2: float
    forces_contradict: bool
    compass_contradicts: bool
    strides: Sequence[float]

    @property
    def sensor(self) -> str:
        """What findings call it."""
        return f"{self.worn} sensor"


def findings_of(seen: Seen) -> tuple[Finding, ...]:
    """Return what is wrong, faults first."""
    found = [
        *_of_stream(seen),
        *_of_units(seen),
        *_of_axes(seen),
        *_of_range(seen),
        *_of_calibration(seen),
        *_of_temperature(seen),
        *_of_stances(seen),
    ]
    return tuple(sorted(found, key=lambda finding: finding.level != "fault"))


def _of_stream(seen: Seen) -> list[Finding]:
    settings, seconds, sensor = seen.settings, seen.seconds, seen.sensor
    count = sum(second.size for second in seconds)
    found: list[Finding] = []
    unusable = sum(second.faults.unusable for second in seconds) / count
    if level := _level(unusable, settings.unusable):
        words = f"{sensor} sends {unusable:.1%} unreadable values: check its plug and cable"
        found.append(Finding(level, words))
    lost = sum(second.missing for second in seconds)
    missing = lost / (lost + count)
    if level := _level(missing, settings.missing):
        words = f"{missing:.0%} of the {sensor.lower()}'s readings are missing: check its link"
        found.append(Finding(level, words))
    if any(second.faults.restarts for second in seconds):
        found.append(Finding("warning", f"{sensor}'s clock was set back: restart the unit"))
    elif any(second.faults.out_of_order for second in seconds):
        found.append(Finding("warning", f"{sensor}'s readings come out of order"))
    found += _of_rate(seen)
    return found


def _of_rate(seen: Seen) -> list[Finding]:
    nominal_hz, sensor = seen.settings.nominal_rate_hz, seen.sensor
    rate_hz = median(second.rate_hz for second in seen.seconds)
    if seen.slow_hz is not None and 0.0 < rate_hz < seen.slow_hz[0]:
        words = f"{sensor} reads only {rate_hz:.0f} times a second, too few: set it to 100"
        return [Finding("warning" if rate_hz >= seen.slow_hz[1] else "fault", words)]
    if nominal_hz is None or abs(rate_hz / nominal_hz - 1.0) <= seen.settings.rate_share:
        return []
    words = f"{sensor} reads {rate_hz:.1f} times a second, not {nominal_hz:.0f}: set it up"
    return [Finding("warning", words)]


def _of_units(seen: Seen) -> list[Finding]:
    settings, sensor = seen.settings, seen.sensor
    if len(seen.seconds) < settings.stuck_seconds:
        return []
    recent = list(seen.seconds)[-settings.stuck_seconds :]
    largest = np.array([np.maximum(-second.low, second.high) for second in recent])
    force_m_s2, rate_rad_s = largest[:, :3].max(axis=1), largest[:, 3:].max(axis=1)
    found = []
    if (force_m_s2 < settings.least_m_s2).all():
        found.append(Finding("fault", f"{sensor} tells forces in g: set it to m/s²"))
    if (rate_rad_s > settings.most_rad_s).all():
        found.append(Finding("fault", f"{sensor} tells turns in °/s: set it to rad/s"))
    if (np.isnan(rate_rad_s) & ~np.isnan(force_m_s2)).all():
        words = f"{sensor} tells no turns: steps count, but nobody knows where they lead"
        found.append(Finding("warning", words))
    if seen.forces_contradict:
        found.append(Finding("fault", f"{sensor}'s turns contradict its forces: check axes"))
    if seen.compass_contradicts:
        found.append(Finding("fault", f"{sensor}'s turns contradict its compass: check axes"))
    return found


def _of_axes(seen: Seen) -> list[Finding]:
    settings, sensor = seen.settings, seen.sensor
    if len(seen.seconds) < settings.stuck_seconds:
        return []
    recent = list(seen.seconds)[-settings.stuck_seconds :]
    low = np.min([second.low for second in recent], axis=0)
    span = np.max([second.high for second in recent], axis=0) - low
    stuck = span == 0.0
    if stuck.all():
        return [Finding("fault", f"{sensor} repeats one reading: restart it, or swap it")]
    # At rest, a coarse sensor may well read the same for a while.
    moves = span[:3].max() > settings.moving_m_s2 or span[3:].max() > settings.moving_rad_s
    if stuck.any() and moves:
        words = f"{sensor} reads the same value on one axis: swap it"
        return [Finding("fault", words)]
    return []


def _of_range(seen: Seen) -> list[Finding]:
    worn, count = seen.worn, sum(second.size for second in seen.seconds)
    tops = (
        ("impacts", sum(second.flat_top_force for second in seen.seconds) / count),
        ("turns", sum(second.flat_top_rate for second in seen.seconds) / count),
    )
    return [
        Finding(level, f"{worn} {what} are beyond the sensor's range: positions get worse")
        for what, share in tops
        if (level := _level(share, seen.settings.flat_top))
    ]


def _of_calibration(seen: Seen) -> list[Finding]:
    settings, sensor = seen.settings, seen.sensor
    found = []
    if level := _level(seen.bias_rad_s, settings.bias_rad_s):
        bias_deg_s = math.degrees(seen.bias_rad_s)
        words = f"{sensor} turns by {bias_deg_s:.1f} °/s while it rests: headings will drift"
        found.append(Finding(level, words))
    if level := _level(abs(seen.gravity_off_m_s2), settings.gravity_off_m_s2):
        gravity_m_s2 = settings.gravity_m_s2 + seen.gravity_off_m_s2
        words = f"{sensor} reads gravity as {gravity_m_s2:.1f}, not 9.8: have it calibrated"
        found.append(Finding(level, words))
    return found


def _of_temperature(seen: Seen) -> list[Finding]:
    settings, sensor = seen.settings, seen.sensor
    told = [second.temperature_c for second in seen.seconds if second.temperature_c is not None]
    if not told:
        return []
    found = []
    coldest_c, hottest_c = settings.bears_c
    now_c = told[-1]
    beyond_c = max(coldest_c - now_c, now_c - hottest_c)
    if level := _level(beyond_c, (-settings.near_c, 0.0)):
        what = "hot: get it out of the heat" if now_c > 0.0 else "cold: warm it"
        found.append(Finding(level, f"{sensor} is at {now_c:.0f} °C, too {what}"))
    half = len(told) // 2
    change_c = fmean(told[-half:]) - fmean(told[:half]) if half >= SECONDS // 4 else 0.0
    change_c_min = 60.0 * change_c / max(len(told) - half, 1)
    if abs(change_c_min) > settings.drift_c_min:
        way = "warms" if change_c > 0.0 else "cools"
        words = f"{sensor} {way} by {abs(change_c_min):.0f} °C a minute: headings may drift"
        found.append(Finding("warning", words))
    return found


def _of_stances(seen: Seen) -> list[Finding]:
    settings, strides = seen.settings, seen.strides
    if len(strides) < STRIDES // 4:
        return []
    lost_s = sum(stride_s for stride_s in strides if stride_s > settings.long_swing_s)
    level = _level(lost_s / sum(strides), settings.no_stance)
    words = f"{seen.worn} is rarely found at rest while moving: fasten the sensor tightly"
    return [Finding(level, words)] if level else []


def _level(measure: float, limits: tuple[float, float]) -> HealthLevel | None:
    """Return how bad a measure is, ``None`` for not at all."""
    warning, fault = limits
    if measure > fault:
        return "fault"
    return "warning" if measure > warning else None
