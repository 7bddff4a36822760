"""What an inertial sensor reads that moves as a pose says, wherever it is worn.

Specific force and angular rate come from differences of the pose at 2 kHz or more, pass the
sensor's errors, and are anti-aliased and sampled as a sensor does it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import repeat
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.messages import ImuSample
from shared.simulation.imu_errors import Sensor, ringing
from shared.simulation.magnetic import MagneticField
from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]

GRAVITY_M_S2 = 9.81
"""Gravity where the exercises are."""
FINE_RATE_HZ = 2000.0
CHUNK = 8192


class Motion(Protocol):
    """How a sensor moves."""

    def pose(self, time_s: Array) -> tuple[Array, Array]:
        """Return its position (n, 3) NED and roll, pitch, yaw (n, 3) at ``time_s`` (n,).

        The angles turn the wearer's forward-right-down frame in the order yaw, pitch, roll.
        """


class Strikes(NamedTuple):
    """Heel strikes (k,): when, and how hard they let the housing ring."""

    time_s: Array
    strength_m_s2: Array


@dataclass(frozen=True)
class ImuRecording:
    """Everything one sensor read: ``time_s`` (n,) true times since the exercise's start.

    ``force_m_s2``, ``rate_rad_s`` and ``field_ut`` are (n, 3) in the sensor's own axes, which are
    the wearer's forward-right-down but for the mounting. ``pressure_pa`` (n,) is NaN between the
    barometer's readings, ``None`` without one. The sampling rate is near the nominal one.
    """

    time_s: Array
    force_m_s2: Array
    rate_rad_s: Array
    field_ut: Array
    pressure_pa: Array | None

    def samples(self, start_ns: int) -> Iterator[ImuSample]:
        """Yield the samples in order, the exercise having begun at ``start_ns``."""
        times_ns = start_ns + np.rint(self.time_s * NS_PER_S).astype(np.int64)
        pressures = repeat(math.nan) if self.pressure_pa is None else self.pressure_pa.tolist()
        readings = zip(
            times_ns.tolist(),
            self.force_m_s2.tolist(),
            self.rate_rad_s.tolist(),
            self.field_ut.tolist(),
            pressures,
            strict=False,
        )
        for time_ns, force, rate, field, pa in readings:
            pressure_pa = None if math.isnan(pa) else pa
            yield ImuSample(time_ns, tuple(force), tuple(rate), tuple(field), pressure_pa)


Rotate: TypeAlias = Callable[[Array, Array, Array], tuple[Array, Array]]
"""Takes times (n,), forces and rates (n, 3) to what they are in the sensor as it was worn then."""


def read_motion(
    motion: Motion,
    start_s: float,
    end_s: float,
    sensor: Sensor,
    strikes: Strikes,
    field: MagneticField,
    chance: np.random.Generator,
    worn: Rotate | None = None,
) -> ImuRecording:
    """Return what ``sensor`` reads from ``start_s`` to ``end_s``, barometer apart."""
    fine = max(1, math.ceil(FINE_RATE_HZ / sensor.rate_hz))
    step_s = 1.0 / (fine * sensor.rate_hz)
    count = int((end_s - start_s) * sensor.rate_hz) + 1
    time_s = start_s + np.arange(count) / sensor.rate_hz
    fine_count = (count - 1) * fine + 2 * fine - 1
    fine_start_s = start_s - (fine - 1) * step_s
    force, rate = inertial_truth(motion, fine_start_s, step_s, fine_count)
    force += ringing(*strikes, fine_start_s, step_s, fine_count, chance)
    position_m, angles_rad = motion.pose(time_s)
    field_ut = np.einsum("nij,ni->nj", nav_from_body(angles_rad), field.at(position_m))
    if worn is not None:
        fine_s = fine_start_s + step_s * np.arange(fine_count, dtype=np.float64)
        force, rate = worn(fine_s, force, rate)
        field_ut, _ = worn(time_s, field_ut, np.zeros(field_ut.shape))
    force, rate = sensor.distort(force, rate)
    force, rate = sensor.read(_sampled(force, fine), _sampled(rate, fine), chance)
    return ImuRecording(time_s, force, rate, sensor.read_field(field_ut, chance), None)


def inertial_truth(
    motion: Motion, start_s: float, step_s: float, count: int
) -> tuple[Array, Array]:
    """Return true specific force and angular rate (count, 3) every ``step_s``, in its own axes."""
    force, rate = np.empty((count, 3)), np.empty((count, 3))
    for first in range(0, count, CHUNK):
        size = min(CHUNK, count - first)
        time_s = start_s + step_s * np.arange(first - 1.0, first + size + 1.0)
        position_m, angles_rad = motion.pose(time_s)
        acceleration = np.diff(position_m, 2, axis=0) / step_s**2
        acceleration[:, 2] -= GRAVITY_M_S2
        change = (angles_rad[2:] - angles_rad[:-2]) / (2.0 * step_s)
        middle = angles_rad[1:-1]
        there = slice(first, first + size)
        force[there] = np.einsum("nij,ni->nj", nav_from_body(middle), acceleration)
        rate[there] = _body_rate(middle, change)
    return force, rate


def nav_from_body(angles_rad: Array) -> Array:
    """Return the rotations (n, 3, 3) of roll, pitch, yaw (n, 3), turned in the order yaw first."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles_rad).T, np.cos(angles_rad).T
    rotation = np.empty((len(angles_rad), 3, 3))
    rotation[:, 0] = np.column_stack([cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr])
    rotation[:, 1] = np.column_stack([sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr])
    rotation[:, 2] = np.column_stack([-sp, cp * sr, cp * cr])
    return rotation


def _body_rate(angles_rad: Array, change_rad_s: Array) -> Array:
    """Angular rate in body axes of roll, pitch and yaw that change so (Euler's kinematics)."""
    roll, pitch, _ = angles_rad.T
    d_roll, d_pitch, d_yaw = change_rad_s.T
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    return np.column_stack(
        [
            d_roll - d_yaw * sp,
            d_pitch * cr + d_yaw * sr * cp,
            d_yaw * cr * cp - d_pitch * sr,
        ]
    )


def _sampled(signal: Array, fine: int) -> Array:
    """Return every ``fine``-th value of ``signal`` (n, 3), the first ``fine - 1`` before the first.

    The anti-alias filter is a triangle two samples wide: symmetric, and with zeros at all
    multiples of the sampling rate, so that nothing aliases to standstill.
    """
    weights = 1.0 - np.abs(np.arange(1 - fine, fine)) / fine
    windows = np.lib.stride_tricks.sliding_window_view(signal, 2 * fine - 1, axis=0)[::fine]
    return np.asarray(windows @ (weights / weights.sum()))
