"""What is wrong with the sensor (pure): found in its samples, said so that a firefighter can act.

Samples are looked at a second at a time, and findings are over the last ten of those, so that a
fault that comes and goes is neither missed nor flickers.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from itertools import chain
from statistics import fmean, median
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from edge_agent.gyro_agreement import GyroAgreement
from edge_agent.mounts.intake import LARGEST_READING
from edge_agent.mounts.interface import Faults, Increment
from shared.messages import HealthLevel, ImuSample, Mount
from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]

BLOCK_NS = NS_PER_S
BLOCKS = 10
STRIDES = 20
BUNCHED_SHARE = 0.02
"""More steps than this shorter than half the usual one: samples come in bunches."""

SHORTEST_PERIOD_S = 0.0005
"""No such sensor is read faster."""


class SelfCheckSettings(NamedTuple):
    """Limits. Where there are two, the first is a warning's and the second a fault's.

    A sensor stands still while rates scatter by less than ``still_rad_s`` and force by less than
    ``still_m_s2``. A flat top is ``flat_samples`` of the same reading beyond ``high_m_s2`` or
    ``high_rad_s``. Whatever carries a sensor, in a second its largest reading of force is
    ``least_m_s2`` or more, and none reads a rate above ``most_rad_s``. ``nominal_rate_hz`` is what
    the sensor ought to run at, if that is known. ``bears_c`` is what most sensors are made for,
    ``near_c`` how near that a warning is given; ``drift_c_min`` is how fast a temperature changes
    that takes the gyro's bias along.
    """

    period_s: float = 10.0
    stall_s: float = 1.0
    nominal_rate_hz: float | None = None
    rate_share: float = 0.01
    missing: tuple[float, float] = (0.02, 0.2)
    unusable: tuple[float, float] = (0.0, 0.05)
    flat_samples: int = 3
    high_m_s2: float = 30.0
    high_rad_s: float = 3.5
    flat_top: tuple[float, float] = (0.001, 0.01)
    still_rad_s: float = 0.03
    still_m_s2: float = 0.15
    bias_rad_s: tuple[float, float] = (math.radians(2.0), math.radians(6.0))
    gravity_m_s2: float = 9.81
    gravity_off_m_s2: tuple[float, float] = (0.4, 1.2)
    stuck_blocks: int = 3
    least_m_s2: float = 3.0
    most_rad_s: float = 40.0
    moving_m_s2: float = 1.0
    moving_rad_s: float = 0.3
    long_swing_s: float = 3.0
    no_stance: tuple[float, float] = (0.3, 0.6)
    bears_c: tuple[float, float] = (-40.0, 85.0)
    near_c: float = 15.0
    drift_c_min: float = 6.0


SLOW_HZ: dict[Mount, tuple[float, float]] = {
    "vehicle": (80.0, 40.0),
    "chest": (20.0, 10.0),
    "waist": (20.0, 10.0),
}
"""Rates below which a mount tells less, and next to nothing: the road is heard at 50 to 100 Hz."""


class HealthReport(NamedTuple):
    """Findings in words, worst first, and the level of the worst."""

    time_ns: int
    level: HealthLevel
    findings: tuple[str, ...]


class _Finding(NamedTuple):
    level: HealthLevel
    words: str


class _Block(NamedTuple):
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


class SelfCheck:
    """Takes samples and increments in order; reports on change, and every ``period_s``.

    ``faults`` are the counts of the mount that is given the same samples, ``worn`` says which.
    """

    def __init__(
        self, faults: Faults, settings: SelfCheckSettings | None = None, *, worn: Mount = "boot"
    ) -> None:
        self._faults = faults
        self._slow_hz = SLOW_HZ.get(worn)
        self._worn = worn.capitalize()
        self._sensor = f"{self._worn} sensor"
        words = f"{self._sensor} has stopped sending: check its battery and its cable"
        self._stalled = (_Finding("fault", words),)
        self._settings = settings or SelfCheckSettings()
        self._counted = replace(faults)
        self._samples: list[ImuSample] = []
        self._stall_ns = round(self._settings.stall_s * NS_PER_S)
        self._block_from_ns: int | None = None
        self._newest_ns = 0
        self._blocks: deque[_Block] = deque(maxlen=BLOCKS)
        self._agreement = GyroAgreement()
        self._bias_rad_s = 0.0
        self._gravity_off_m_s2 = 0.0
        self._strides: deque[float] = deque(maxlen=STRIDES)
        self._told: tuple[_Finding, ...] | None = None
        self._told_ns = 0
        self.worn: str | None = None
        """How the sensor was found to be worn, in words; to be set by who finds it."""

    def take_sample(self, sample: ImuSample) -> HealthReport | None:
        """Take in a sample as it came from the source; return a report if one is due."""
        self._samples.append(sample)
        now_ns = sample.time_ns
        self._newest_ns = now_ns
        if self._block_from_ns is None:
            self._block_from_ns = now_ns
        if 0 <= now_ns - self._block_from_ns < BLOCK_NS:
            return None
        samples, self._samples = self._samples, []
        self._block_from_ns = now_ns
        self._look_at(samples)
        return self._report(now_ns, self._findings())

    def take_increment(self, increment: Increment) -> None:
        """Take in a movement, for whether it ended in a stance in good time."""
        self._strides.append((increment.end_time_ns - increment.start_time_ns) / NS_PER_S)

    def pass_time(self, now_ns: int) -> HealthReport | None:
        """Return the report that samples have stopped, if by ``now_ns`` they have, once.

        It bears the time at which that became certain, whenever it is asked for.
        """
        stalled_ns = self._newest_ns + self._stall_ns
        if now_ns < stalled_ns or self._block_from_ns is None or self._told == self._stalled:
            return None
        return self._report(stalled_ns, self._stalled)

    def _report(self, now_ns: int, findings: tuple[_Finding, ...]) -> HealthReport | None:
        due = not 0 <= now_ns - self._told_ns < self._settings.period_s * NS_PER_S
        if self._told is not None and not due and _kinds(findings) == _kinds(self._told):
            return None
        self._told, self._told_ns = findings, now_ns
        level = findings[0].level if findings else "ok"
        return HealthReport(now_ns, level, tuple(finding.words for finding in findings))

    def _look_at(self, samples: list[ImuSample]) -> None:
        """Measure a block; bias and gravity too, if the sensor stood still in it."""
        if self._worn != "Boot":
            self._agreement.take(samples)
        faults, self._counted = self._counted, replace(self._faults)
        since = Faults(
            self._faults.unusable - faults.unusable,
            self._faults.out_of_order - faults.out_of_order,
            self._faults.gaps - faults.gaps,
            self._faults.restarts - faults.restarts,
        )
        values = chain.from_iterable((*one.force_m_s2, *one.rate_rad_s) for one in samples)
        readings = np.fromiter(values, np.float64, 6 * len(samples)).reshape(-1, 6)
        sound = np.abs(readings) <= LARGEST_READING
        whole = sound.all(axis=1)
        # Without a gyroscope there are forces to look at.
        readings = readings[whole if whole.any() else sound[:, :3].all(axis=1)]
        if not len(readings):
            readings = np.full((1, 6), np.nan)
        missing, rate_hz = _pace(np.diff([one.time_ns for one in samples]) / NS_PER_S)
        self._blocks.append(
            _Block(
                len(samples),
                missing,
                rate_hz,
                self._flat_tops(readings[:, :3], self._settings.high_m_s2),
                self._flat_tops(readings[:, 3:], self._settings.high_rad_s),
                readings.min(axis=0),
                readings.max(axis=0),
                since,
                _mean_temperature_c(samples),
            )
        )
        self._measure_stillness(readings)

    def _measure_stillness(self, readings: Array) -> None:
        settings = self._settings
        scatter = readings.std(axis=0)
        if len(readings) < 10 or scatter[3:].max() > settings.still_rad_s:
            return
        if scatter[:3].max() <= settings.still_m_s2:
            force, rate = readings[:, :3].mean(axis=0), readings[:, 3:].mean(axis=0)
            self._bias_rad_s = float(np.linalg.norm(rate))
            self._gravity_off_m_s2 = float(np.linalg.norm(force)) - settings.gravity_m_s2

    def _flat_tops(self, readings: Array, high: float) -> int:
        """Return how many samples are in runs of the same high reading."""
        same = (readings[1:] == readings[:-1]) & (np.abs(readings[1:]) > high)
        run = same
        for _ in range(self._settings.flat_samples - 2):
            run = run[1:] & same[: len(run) - 1]
        return int(np.count_nonzero(run.any(axis=1)))

    def _findings(self) -> tuple[_Finding, ...]:
        found = [
            *self._of_stream(),
            *self._of_units(),
            *self._of_axes(),
            *self._of_range(),
            *self._of_calibration(),
            *self._of_temperature(),
            *self._of_stances(),
        ]
        found.sort(key=lambda finding: finding.level != "fault")
        return (*found, *([_Finding("ok", self.worn)] if self.worn else []))

    def _of_stream(self) -> list[_Finding]:
        settings, blocks, sensor = self._settings, self._blocks, self._sensor
        count = sum(block.size for block in blocks)
        found: list[_Finding] = []
        unusable = sum(block.faults.unusable for block in blocks) / count
        if level := _level(unusable, settings.unusable):
            words = f"{sensor} sends {unusable:.1%} unreadable values: check its plug and cable"
            found.append(_Finding(level, words))
        lost = sum(block.missing for block in blocks)
        missing = lost / (lost + count)
        if level := _level(missing, settings.missing):
            words = f"{missing:.0%} of the {sensor.lower()}'s readings are missing: check its link"
            found.append(_Finding(level, words))
        if any(block.faults.restarts for block in blocks):
            found.append(_Finding("warning", f"{sensor}'s clock was set back: restart the unit"))
        elif any(block.faults.out_of_order for block in blocks):
            found.append(_Finding("warning", f"{sensor}'s readings come out of order"))
        found += self._of_rate()
        return found

    def _of_rate(self) -> list[_Finding]:
        nominal_hz, sensor = self._settings.nominal_rate_hz, self._sensor
        rate_hz = median(block.rate_hz for block in self._blocks)
        if self._slow_hz is not None and 0.0 < rate_hz < self._slow_hz[0]:
            words = f"{sensor} reads only {rate_hz:.0f} times a second, too few: set it to 100"
            return [_Finding("warning" if rate_hz >= self._slow_hz[1] else "fault", words)]
        if nominal_hz is None or abs(rate_hz / nominal_hz - 1.0) <= self._settings.rate_share:
            return []
        words = f"{sensor} reads {rate_hz:.1f} times a second, not {nominal_hz:.0f}: set it up"
        return [_Finding("warning", words)]

    def _of_units(self) -> list[_Finding]:
        settings, sensor = self._settings, self._sensor
        if len(self._blocks) < settings.stuck_blocks:
            return []
        recent = list(self._blocks)[-settings.stuck_blocks :]
        largest = np.array([np.maximum(-block.low, block.high) for block in recent])
        force_m_s2, rate_rad_s = largest[:, :3].max(axis=1), largest[:, 3:].max(axis=1)
        found = []
        if (force_m_s2 < settings.least_m_s2).all():
            found.append(_Finding("fault", f"{sensor} tells forces in g: set it to m/s²"))
        if (rate_rad_s > settings.most_rad_s).all():
            found.append(_Finding("fault", f"{sensor} tells turns in °/s: set it to rad/s"))
        if (np.isnan(rate_rad_s) & ~np.isnan(force_m_s2)).all():
            words = f"{sensor} tells no turns: steps count, but nobody knows where they lead"
            found.append(_Finding("warning", words))
        if self._agreement.contradicts:
            found.append(_Finding("fault", f"{sensor}'s turns contradict its forces: check axes"))
        return found

    def _of_axes(self) -> list[_Finding]:
        settings, sensor = self._settings, self._sensor
        if len(self._blocks) < settings.stuck_blocks:
            return []
        recent = list(self._blocks)[-settings.stuck_blocks :]
        low = np.min([block.low for block in recent], axis=0)
        span = np.max([block.high for block in recent], axis=0) - low
        stuck = span == 0.0
        if stuck.all():
            return [_Finding("fault", f"{sensor} repeats one reading: restart it, or swap it")]
        # At rest, a coarse sensor may well read the same for a while.
        moves = span[:3].max() > settings.moving_m_s2 or span[3:].max() > settings.moving_rad_s
        if stuck.any() and moves:
            words = f"{sensor} reads the same value on one axis: swap it"
            return [_Finding("fault", words)]
        return []

    def _of_range(self) -> list[_Finding]:
        worn, count = self._worn, sum(block.size for block in self._blocks)
        tops = (
            ("impacts", sum(block.flat_top_force for block in self._blocks) / count),
            ("turns", sum(block.flat_top_rate for block in self._blocks) / count),
        )
        return [
            _Finding(level, f"{worn} {what} are beyond the sensor's range: positions get worse")
            for what, share in tops
            if (level := _level(share, self._settings.flat_top))
        ]

    def _of_calibration(self) -> list[_Finding]:
        settings, sensor = self._settings, self._sensor
        found = []
        if level := _level(self._bias_rad_s, settings.bias_rad_s):
            bias_deg_s = math.degrees(self._bias_rad_s)
            words = f"{sensor} turns by {bias_deg_s:.1f} °/s while it rests: headings will drift"
            found.append(_Finding(level, words))
        if level := _level(abs(self._gravity_off_m_s2), settings.gravity_off_m_s2):
            gravity_m_s2 = settings.gravity_m_s2 + self._gravity_off_m_s2
            words = f"{sensor} reads gravity as {gravity_m_s2:.1f}, not 9.8: have it calibrated"
            found.append(_Finding(level, words))
        return found

    def _of_temperature(self) -> list[_Finding]:
        settings, sensor = self._settings, self._sensor
        told = [block.temperature_c for block in self._blocks if block.temperature_c is not None]
        if not told:
            return []
        found = []
        coldest_c, hottest_c = settings.bears_c
        now_c = told[-1]
        beyond_c = max(coldest_c - now_c, now_c - hottest_c)
        if level := _level(beyond_c, (-settings.near_c, 0.0)):
            what = "hot: get it out of the heat" if now_c > 0.0 else "cold: warm it"
            found.append(_Finding(level, f"{sensor} is at {now_c:.0f} °C, too {what}"))
        half = len(told) // 2
        change_c = fmean(told[-half:]) - fmean(told[:half]) if half >= BLOCKS // 4 else 0.0
        change_c_min = 60.0 * change_c / max(len(told) - half, 1)
        if abs(change_c_min) > settings.drift_c_min:
            way = "warms" if change_c > 0.0 else "cools"
            words = f"{sensor} {way} by {abs(change_c_min):.0f} °C a minute: headings may drift"
            found.append(_Finding("warning", words))
        return found

    def _of_stances(self) -> list[_Finding]:
        settings, strides = self._settings, self._strides
        if len(strides) < STRIDES // 4:
            return []
        lost_s = sum(stride_s for stride_s in strides if stride_s > settings.long_swing_s)
        level = _level(lost_s / sum(strides), settings.no_stance)
        words = f"{self._worn} is rarely found at rest while moving: fasten the sensor tightly"
        return [_Finding(level, words)] if level else []


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


def _mean_temperature_c(samples: list[ImuSample]) -> float | None:
    """Return the mean of what the samples say of the sensor's temperature, if any does."""
    told = [one.temperature_c for one in samples if one.temperature_c is not None]
    return fmean(told) if told and math.isfinite(sum(told)) else None


def _level(measure: float, limits: tuple[float, float]) -> HealthLevel | None:
    """Return how bad a measure is, ``None`` for not at all."""
    warning, fault = limits
    if measure > fault:
        return "fault"
    return "warning" if measure > warning else None


def _kinds(findings: tuple[_Finding, ...]) -> list[tuple[str, str]]:
    """Return what findings are about, without the numbers in their words."""
    return [
        (finding.level, "".join(letter for letter in finding.words if not letter.isdigit()))
        for finding in findings
    ]
