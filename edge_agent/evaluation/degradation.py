"""The same recording from a worse sensor: slower, coarser, clipped, noisier, with parts lost.

Each degradation is one fault alone, so that a table of them says what a method leans on. All are
computed from the samples; chance is a generator that is passed in.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from edge_agent.evaluation.course_truth import MountTruth
from edge_agent.evaluation.truth import Array, Truth
from edge_agent.sources.recording import Recording, at_times
from shared.messages import Mount
from shared.units import NS_PER_S

Degrade: TypeAlias = Callable[[Recording, np.random.Generator], Recording]

STANDARD_GRAVITY_M_S2 = 9.80665
NOISE_M_S2 = 0.1
NOISE_RAD_S = math.radians(0.5)
"""White, of each sample and axis: some ten times a good sensor's."""


class Degradation(NamedTuple):
    """One fault: what it makes of the samples, and how fast the sensor's clock runs with it."""

    degrade: Degrade
    clock_rate: float = 1.0

    def apply(
        self, recording: Recording, truth: MountTruth | None, chance: np.random.Generator
    ) -> tuple[Recording, MountTruth | None]:
        """Return the recording with this fault, and the truth on its clock.

        Raises ``ValueError`` where the clock cannot be changed of such a truth.
        """
        worse = self.degrade(recording, chance)
        if self.clock_rate == 1.0:
            return worse, truth
        if truth is not None and not isinstance(truth, Truth):
            raise ValueError("its truth has no stances: not a boot's recording")
        time_ns = np.rint(self.clock_rate * worse.time_ns).astype(np.int64)
        return replace(worse, time_ns=time_ns), truth and on_clock(truth, self.clock_rate)


def on_clock(truth: Truth, clock_rate: float) -> Truth:
    """Return ``truth`` by a clock that counts ``clock_rate`` seconds in one."""
    height, speed = truth.height, truth.speed
    return replace(
        truth,
        time_s=clock_rate * truth.time_s,
        height=height and replace(height, time_s=clock_rate * height.time_s),
        speed=speed
        and replace(
            speed, time_s=clock_rate * speed.time_s, speed_m_s=speed.speed_m_s / clock_rate
        ),
    )


def averaged(recording: Recording, rate_hz: float) -> Recording:
    """Return what a sensor reads that gives the mean of each period of ``rate_hz``.

    Each sample stands for the time nearer to it than to any other, so that the integrals of
    specific force and angular rate are kept at any pair of rates; a new sample is stamped with its
    period's middle. The field is the nearest sample's, the pressure the mean of the period's
    readings. A slower recording is returned as it is.
    Raises ``ValueError`` where time stamps do not rise.
    """
    time_s = recording.time_ns / NS_PER_S
    if _rate_hz(time_s) <= rate_hz:
        return recording
    middles_s = 0.5 * (time_s[1:] + time_s[:-1])
    edges_s = np.concatenate(
        ([2.0 * time_s[0] - middles_s[0]], middles_s, [2.0 * time_s[-1] - middles_s[-1]])
    )
    count = int((edges_s[-1] - edges_s[0]) * rate_hz + 1e-6)
    periods_s = edges_s[0] + np.arange(count + 1) / rate_hz
    field_ut, pressure_pa = recording.field_ut, recording.pressure_pa
    centres_s = periods_s[:-1] + 0.5 / rate_hz
    return Recording(
        np.rint(centres_s * NS_PER_S).astype(np.int64),
        _means(recording.force_m_s2, edges_s, periods_s),
        _means(recording.rate_rad_s, edges_s, periods_s),
        None if field_ut is None else field_ut[_nearest(time_s, centres_s)],
        None if pressure_pa is None else _mean_readings(pressure_pa, time_s, periods_s),
    )


def decimated(recording: Recording, rate_hz: float) -> Recording:
    """Return the samples nearest to the ticks of ``rate_hz``, the others thrown away.

    A slower recording is returned as it is. Raises ``ValueError`` where time stamps do not rise.
    """
    time_s = recording.time_ns / NS_PER_S
    if _rate_hz(time_s) <= rate_hz:
        return recording
    count = int((time_s[-1] - time_s[0]) * rate_hz + 1e-6) + 1
    ticks_s = time_s[0] + np.arange(count) / rate_hz
    return recording.rows(np.unique(_nearest(time_s, ticks_s)))


def clipped(
    recording: Recording, force_m_s2: float = math.inf, rate_rad_s: float = math.inf
) -> Recording:
    """Return what sensors read whose ranges end at ±``force_m_s2`` and ±``rate_rad_s``."""
    return replace(
        recording,
        force_m_s2=np.clip(recording.force_m_s2, -force_m_s2, force_m_s2),
        rate_rad_s=np.clip(recording.rate_rad_s, -rate_rad_s, rate_rad_s),
    )


def biased(recording: Recording, rate_rad_s: float) -> Recording:
    """Return what a gyroscope reads that is off by ``rate_rad_s`` on each axis."""
    return replace(recording, rate_rad_s=recording.rate_rad_s + rate_rad_s)


def magnetised(recording: Recording, iron_ut: float) -> Recording:
    """Return what a magnetometer reads that has ``iron_ut`` of iron beside each of its axes."""
    field_ut = recording.field_ut
    return replace(recording, field_ut=None if field_ut is None else field_ut + iron_ut)


def scaled(recording: Recording, scale: float) -> Recording:
    """Return what an accelerometer reads that shows ``scale`` times the specific force."""
    return replace(recording, force_m_s2=scale * recording.force_m_s2)


def noisy(recording: Recording, chance: np.random.Generator) -> Recording:
    """Return the recording with white noise of ``NOISE_M_S2`` and ``NOISE_RAD_S`` added."""
    return replace(
        recording,
        force_m_s2=recording.force_m_s2 + chance.normal(0.0, NOISE_M_S2, (len(recording), 3)),
        rate_rad_s=recording.rate_rad_s + chance.normal(0.0, NOISE_RAD_S, (len(recording), 3)),
    )


def thinned(recording: Recording, chance: np.random.Generator, lost_share: float) -> Recording:
    """Return what is left when each sample is lost with a probability of ``lost_share``."""
    return recording.rows(np.flatnonzero(chance.random(len(recording)) >= lost_share))


def repeated(recording: Recording, chance: np.random.Generator, share: float) -> Recording:
    """Return what comes when a sample is sent twice with a probability of ``share``."""
    times = 1 + (chance.random(len(recording)) < share)
    return recording.rows(np.repeat(np.arange(len(recording)), times))


def delayed(
    recording: Recording, chance: np.random.Generator, share: float, longest_s: float
) -> Recording:
    """Return the order in which samples come, ``share`` of them late by up to ``longest_s``."""
    late_ns = longest_s * NS_PER_S * chance.random(len(recording))
    come_ns = recording.time_ns + np.where(chance.random(len(recording)) < share, late_ns, 0.0)
    return recording.rows(np.argsort(come_ns, kind="stable"))


def interrupted(recording: Recording, gap_s: float, every_s: float) -> Recording:
    """Return what is left when the last ``gap_s`` of each ``every_s`` are lost."""
    since_s = (recording.time_ns - recording.time_ns[0]) / NS_PER_S
    return recording.rows(np.flatnonzero(since_s % every_s < every_s - gap_s))


def in_order(recording: Recording) -> Recording:
    """Return the samples that are later than all before them: what a mount takes of them."""
    newest_ns = np.maximum.accumulate(recording.time_ns)
    return recording.rows(np.flatnonzero(np.diff(newest_ns, prepend=newest_ns[0] - 1) > 0))


def interpolated(recording: Recording, rate_hz: float) -> Recording:
    """Return what straight lines between the samples read at ``rate_hz``, a higher rate."""
    time_s = recording.time_ns / NS_PER_S
    field_ut = recording.field_ut
    ticks_s = np.arange(time_s[0], time_s[-1], 1.0 / rate_hz)
    return Recording(
        np.rint(ticks_s * NS_PER_S).astype(np.int64),
        at_times(ticks_s, time_s, recording.force_m_s2),
        at_times(ticks_s, time_s, recording.rate_rad_s),
        None if field_ut is None else at_times(ticks_s, time_s, field_ut),
    )


def jittered(recording: Recording, chance: np.random.Generator, sd_s: float) -> Recording:
    """Return the samples, in order, with stamps that are off by ``sd_s``, and rise."""
    off_ns = np.rint(sd_s * NS_PER_S * chance.normal(size=len(recording))).astype(np.int64)
    return replace(recording, time_ns=np.sort(recording.time_ns + off_ns))


def scattered(recording: Recording, chance: np.random.Generator) -> Recording:
    """Return what a busy program hears: 5 % are lost, and stamps jitter by 5 ms."""
    return jittered(thinned(recording, chance, 0.05), chance, 0.005)


def with_holes(
    recording: Recording, chance: np.random.Generator, share: float, lasting_s: float
) -> Recording:
    """Return what is left when each piece of ``lasting_s`` is lost with a probability."""
    piece = ((recording.time_ns - recording.time_ns[0]) / NS_PER_S / lasting_s).astype(np.int64)
    lost = chance.random(int(piece.max()) + 1) < share
    return recording.rows(np.flatnonzero(~lost[piece]))


def cut(recording: Recording, gap_s: float) -> Recording:
    """Return what is left when ``gap_s`` in the middle are lost: a phone that was locked."""
    return recording.rows(np.flatnonzero(~_midway(recording, gap_s)))


def frozen(recording: Recording, lasting_s: float) -> Recording:
    """Return what a sensor reads that repeats one reading for ``lasting_s`` in the middle."""
    rows = np.flatnonzero(_midway(recording, lasting_s))
    if not rows.size:
        return recording
    force_m_s2, rate_rad_s = recording.force_m_s2.copy(), recording.rate_rad_s.copy()
    force_m_s2[rows], rate_rad_s[rows] = force_m_s2[rows[0]], rate_rad_s[rows[0]]
    return replace(recording, force_m_s2=force_m_s2, rate_rad_s=rate_rad_s)


def stuck(recording: Recording, *, force: bool) -> Recording:
    """Return what is read from midway on when the axis that is most upright has stuck.

    It is the accelerometer's if ``force``, else the gyroscope's.
    """
    half = len(recording) // 2
    axis = int(np.argmax(np.abs(recording.force_m_s2.mean(axis=0))))
    readings = (recording.force_m_s2 if force else recording.rate_rad_s).copy()
    readings[half:, axis] = readings[half, axis]
    if force:
        return replace(recording, force_m_s2=readings)
    return replace(recording, rate_rad_s=readings)


def turned(recording: Recording, chance: np.random.Generator) -> Recording:
    """Return what the sensor reads put on any other way round."""
    turn = Rotation.random(rng=chance)
    field_ut = recording.field_ut
    return replace(
        recording,
        force_m_s2=turn.apply(recording.force_m_s2),
        rate_rad_s=turn.apply(recording.rate_rad_s),
        field_ut=None if field_ut is None else turn.apply(field_ut),
    )


def _midway(recording: Recording, lasting_s: float) -> NDArray[np.bool_]:
    """Return which samples lie in the middle ``lasting_s``."""
    time_s = (recording.time_ns - recording.time_ns[0]) / NS_PER_S
    return np.asarray(np.abs(time_s - 0.5 * time_s[-1]) < 0.5 * lasting_s)


def _rate_hz(time_s: Array) -> float:
    """Return the usual rate; raise ``ValueError`` where time stamps repeat or go back."""
    periods_s = np.diff(time_s)
    if not (len(periods_s) and np.all(periods_s > 0.0)):
        raise ValueError("time stamps do not rise from sample to sample: no rate can be lowered")
    return 1.0 / float(np.median(periods_s))


def _means(values: Array, edges_s: Array, periods_s: Array) -> Array:
    """Return the means over ``periods_s`` (m + 1,) of (n, 3), held between ``edges_s`` (n + 1,)."""
    summed = np.vstack((np.zeros(3), np.cumsum(values * np.diff(edges_s)[:, None], axis=0)))
    at_periods = np.column_stack(
        [np.interp(periods_s, edges_s, summed[:, axis]) for axis in range(3)]
    )
    means: Array = np.diff(at_periods, axis=0) / np.diff(periods_s)[:, None]
    return means


def _mean_readings(readings: Array, time_s: Array, periods_s: Array) -> Array:
    """Return the mean of what of ``readings`` (n,) lies in each period (m + 1,); NaN for none."""
    there = np.isfinite(readings)
    period = np.searchsorted(periods_s, time_s[there], side="right") - 1
    inside = (period >= 0) & (period < len(periods_s) - 1)
    period, weights = period[inside], readings[there][inside]
    count = np.bincount(period, minlength=len(periods_s) - 1)
    total = np.bincount(period, weights, minlength=len(periods_s) - 1)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def _nearest(time_s: Array, wanted_s: Array) -> NDArray[np.intp]:
    """Return the row of rising ``time_s`` that is nearest to each of ``wanted_s``."""
    return np.searchsorted(0.5 * (time_s[1:] + time_s[:-1]), wanted_s)


def _sure(degrade: Callable[[Recording], Recording]) -> Degradation:
    """Return the degradation that leaves nothing to chance."""
    return Degradation(lambda recording, _: degrade(recording))


DEGRADATIONS: dict[str, Degradation] = {
    "100 Hz, averaged": _sure(partial(averaged, rate_hz=100.0)),
    "100 Hz, decimated": _sure(partial(decimated, rate_hz=100.0)),
    "50 Hz, averaged": _sure(partial(averaged, rate_hz=50.0)),
    "±8 g": _sure(partial(clipped, force_m_s2=8.0 * STANDARD_GRAVITY_M_S2)),
    "±4 g": _sure(partial(clipped, force_m_s2=4.0 * STANDARD_GRAVITY_M_S2)),
    "±500 °/s": _sure(partial(clipped, rate_rad_s=math.radians(500.0))),
    "±300 °/s": _sure(partial(clipped, rate_rad_s=math.radians(300.0))),
    "gyro bias +1 °/s": _sure(partial(biased, rate_rad_s=math.radians(1.0))),
    "accelerometer +1 %": _sure(partial(scaled, scale=1.01)),
    "clock +0.5 %": Degradation(lambda recording, _: recording, clock_rate=1.005),
    "noise 0.1 m/s², 0.5 °/s": Degradation(noisy),
    "5 % lost at random": Degradation(partial(thinned, lost_share=0.05)),
    "5 % sent twice": Degradation(partial(repeated, share=0.05)),
    "5 % late by up to 0.1 s": Degradation(partial(delayed, share=0.05, longest_s=0.1)),
    "without barometer": _sure(partial(replace, pressure_pa=None)),
    "without magnetometer": _sure(partial(replace, field_ut=None)),
    "magnetometer +20 µT": _sure(partial(magnetised, iron_ut=20.0)),
    "0.05 s lost every 1 s": _sure(partial(interrupted, gap_s=0.05, every_s=1.0)),
    "0.2 s lost every 10 s": _sure(partial(interrupted, gap_s=0.2, every_s=10.0)),
    "0.4 s lost every 10 s": _sure(partial(interrupted, gap_s=0.4, every_s=10.0)),
}
"""A boot's, by the name that tables give it. Gyro bias and iron are on each axis."""


def _ordered(lower: Callable[[Recording], Recording]) -> Degradation:
    """Return the degradation of what has come in order."""
    return _sure(lambda recording: lower(in_order(recording)))


_WORN: dict[str, Degradation] = {
    "25 Hz, averaged": _ordered(partial(averaged, rate_hz=25.0)),
    "25 Hz, decimated": _ordered(partial(decimated, rate_hz=25.0)),
    "50 Hz, averaged": _ordered(partial(averaged, rate_hz=50.0)),
    "52 Hz, decimated": _ordered(partial(decimated, rate_hz=52.0)),
    "100 Hz, decimated": _ordered(partial(decimated, rate_hz=100.0)),
    "200 Hz, interpolated": _ordered(partial(interpolated, rate_hz=200.0)),
    "stamps off by 5 ms": Degradation(partial(jittered, sd_s=0.005)),
    "5 % lost at random": Degradation(partial(thinned, lost_share=0.05)),
    "5 % lost, stamps off by 5 ms": Degradation(scattered),
    "20 % lost at random": Degradation(partial(thinned, lost_share=0.2)),
    "5 % lost, 0.1 s each": Degradation(partial(with_holes, share=0.05, lasting_s=0.1)),
    "5 % lost, 0.4 s each": Degradation(partial(with_holes, share=0.05, lasting_s=0.4)),
    "5 % lost, 0.8 s each": Degradation(partial(with_holes, share=0.05, lasting_s=0.8)),
    "12 s lost midway": _sure(partial(cut, gap_s=12.0)),
    "5 % sent twice": Degradation(partial(repeated, share=0.05)),
    "5 % late by up to 0.1 s": Degradation(partial(delayed, share=0.05, longest_s=0.1)),
    "put on any way round": Degradation(turned),
    "one reading for 5 s midway": _sure(partial(frozen, lasting_s=5.0)),
    "upright force stuck midway": _sure(partial(stuck, force=True)),
    "upright rate stuck midway": _sure(partial(stuck, force=False)),
    "±2 g": _sure(partial(clipped, force_m_s2=2.0 * STANDARD_GRAVITY_M_S2)),
    "gyro bias +1 °/s": _sure(partial(biased, rate_rad_s=math.radians(1.0))),
    "accelerometer +4 %": _sure(partial(scaled, scale=1.04)),
    "forces in g": _sure(partial(scaled, scale=1.0 / STANDARD_GRAVITY_M_S2)),
    "noise 0.1 m/s², 0.5 °/s": Degradation(noisy),
    "without magnetometer": _sure(partial(replace, field_ut=None)),
}
"""What a phone, or a unit on a belt, does to its samples."""


def degradations(mount: Mount) -> dict[str, Degradation]:
    """Return the faults that recordings of a ``mount`` are tried with."""
    return DEGRADATIONS if mount == "boot" else _WORN
