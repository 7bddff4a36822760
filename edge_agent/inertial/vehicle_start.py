"""How a vehicle's tracking begins: the first seconds are kept until they tell which way is forward.

Then they are followed from their beginning, twice: the level that the first time finds, by the road
or by standing, is the second time's to begin with. A vehicle that already brakes or speeds up when
the sensor wakes is levelled right all the same.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from edge_agent.inertial.forward_axis import AXIS_SD_RAD, ForwardAxis, forward_axes
from edge_agent.inertial.vehicle_filter import Array, Uncertainty, VehicleFilter
from edge_agent.inertial.vehicle_tracker import Second, VehicleTracker
from edge_agent.inertial.wheelbase_echo import LATE_S
from shared.maths.rotations import (
    Quaternion,
    Vector3,
    about_down,
    from_gravity,
    inverse,
    multiply,
)

LEVELLED_S = 0.5
GOING_TILT_SD_RAD = 0.1
STANDING_TILT_SD_RAD = 0.005
STANDING_BIAS_SD_RAD_S = math.radians(0.05)
FOUND_TILT_SHARE = 2.0
"""A level found in the same seconds is doubted more than these seconds alone would."""

UNKNOWN_SPEED_M_S = 12.0
UNKNOWN_SPEED_SD_M_S = 8.0
STANDING_SD_M_S = 0.05

ROAD_TILTS_RAD_S = math.radians(0.3)
"""Over some seconds roads mostly tilt a vehicle by less. More is likely the gyroscope's zero, of a
sensor that nobody has calibrated, which is then doubted by as much."""

CHANGE_M_S2 = 1.5
"""By so much a second speed may have changed before it was told."""

CLEAR_START_M_S = 1.5
"""Speed gained in the first seconds after standing that tells which way is forward."""

CLEARNESS_POWER = 8.0
"""What a clear axis of vibration counts against the echo's evidence, as a power of its ratio."""


class Reading(NamedTuple):
    """One sample, in the sensor's axes."""

    time_s: float
    force_m_s2: Vector3
    rate_rad_s: Vector3


class Stood(NamedTuple):
    """What the sensor read while the vehicle stood, on the mean."""

    force_m_s2: Vector3
    rate_rad_s: Vector3


class KnownSpeed(NamedTuple):
    """A speed, and how well it is known."""

    speed_m_s: float
    sd_m_s: float


class Fix(NamedTuple):
    """A speed that somebody knows at ``time_s`` of the readings."""

    time_s: float
    speed: KnownSpeed


class Known(NamedTuple):
    """What is known as the first of the readings comes, and by ``fixes`` while they do.

    ``speed`` may be nothing; ``fixes`` are in the order of time.
    """

    wheelbase_m: float
    speed: KnownSpeed | None = None
    stood: Stood | None = None
    fixes: tuple[Fix, ...] = ()


class Start(NamedTuple):
    """The tracker at the end of the first readings, and what it told of them."""

    tracker: VehicleTracker
    told: list[Second]


def start(readings: Sequence[Reading], known: Known) -> Start:
    """Return tracking begun at the first of ``readings``, two or more over some seconds.

    Forward is the direction that vibration tells, or the one at right angles where the road's echo
    says so. Raises ``ValueError`` on readings without gravity.
    """
    first_m_s2 = known.stood.force_m_s2 if known.stood else first_force(readings)
    level_from_sensor = from_gravity(first_m_s2)
    unaided = _tracker(readings, level_from_sensor, known, GOING_TILT_SD_RAD)
    unaided.corrects = False
    for reading in readings[1:]:
        unaided.step(*reading)
    ended = unaided.filter.level_from_sensor
    starts = [
        _start_along(axis, readings, known, (level_from_sensor, ended))
        for axis in _forward(unaided.memory.columns(), known)
    ]
    return max(starts, key=lambda one: one[0])[1]


def _start_along(
    axis: ForwardAxis,
    readings: Sequence[Reading],
    known: Known,
    unaided: tuple[Quaternion, Quaternion],
) -> tuple[float, Start]:
    """Return tracking with forward along ``axis``, after how much speaks for it.

    ``unaided`` is the attitude at the first and at the last reading, by the gyroscope alone.
    """
    began, ended = (multiply(about_down(-axis.heading_rad), attitude) for attitude in unaided)
    first = _follow(readings, began, known, GOING_TILT_SD_RAD)
    evidence = first.tracker.echo.evidence + CLEARNESS_POWER * math.log(axis.clearness)
    if known.stood is not None:
        return evidence, first
    found = multiply(first.tracker.filter.level_from_sensor, inverse(ended))
    tilt_sd_rad = FOUND_TILT_SHARE * first.tracker.filter.tilt_sd_rad
    return evidence, _follow(readings, multiply(found, began), known, tilt_sd_rad)


def _follow(
    readings: Sequence[Reading], level_from_sensor: Quaternion, known: Known, tilt_sd_rad: float
) -> Start:
    tracker = _tracker(readings, level_from_sensor, known, tilt_sd_rad)
    told: list[Second] = []
    fixes = deque(known.fixes)
    for reading in readings[1:]:
        tracker.step(*reading)
        while fixes and fixes[0].time_s <= reading.time_s:
            tracker.know_speed(*fixes.popleft().speed)
        if tracker.due():
            told.append(tracker.tick())
    return Start(tracker, told)


def _tracker(
    readings: Sequence[Reading], level_from_sensor: Quaternion, known: Known, tilt_sd_rad: float
) -> VehicleTracker:
    speed = _first_speed(known, readings[0].time_s)
    sd = Uncertainty(speed.sd_m_s, tilt_sd_rad, forward_rad=AXIS_SD_RAD)
    tilting_rad_s = _tilting_rad_s(readings)
    if tilting_rad_s > ROAD_TILTS_RAD_S:
        sd = sd._replace(bias_rad_s=tilting_rad_s)
    bias_rad_s: Vector3 = (0.0, 0.0, 0.0)
    if known.stood is not None:
        speed = KnownSpeed(0.0, STANDING_SD_M_S)
        sd = sd._replace(
            speed_m_s=STANDING_SD_M_S,
            tilt_rad=STANDING_TILT_SD_RAD,
            bias_rad_s=STANDING_BIAS_SD_RAD_S,
        )
        bias_rad_s = known.stood.rate_rad_s
    state = VehicleFilter(
        level_from_sensor, 0.0, speed.speed_m_s, known.wheelbase_m, LATE_S, sd, bias_rad_s
    )
    return VehicleTracker(state, readings[0].time_s)


def _tilting_rad_s(readings: Sequence[Reading]) -> float:
    """Return the mean rate about level axes, which is the road's or the gyroscope's zero."""
    up = first_force(readings)
    size_m_s2 = math.hypot(*up)
    x, y, z = np.mean([one.rate_rad_s for one in readings], axis=0).tolist()
    about_up_rad_s = (x * up[0] + y * up[1] + z * up[2]) / size_m_s2 if size_m_s2 else 0.0
    return math.sqrt(max(0.0, x * x + y * y + z * z - about_up_rad_s**2))


def _first_speed(known: Known, time_s: float) -> KnownSpeed:
    """Return the speed at the first reading, at ``time_s``, as far as anybody knows it."""
    if known.speed is not None:
        return known.speed
    if not known.fixes:
        return KnownSpeed(UNKNOWN_SPEED_M_S, UNKNOWN_SPEED_SD_M_S)
    fixed_s, (speed_m_s, sd_m_s) = known.fixes[0]
    return KnownSpeed(speed_m_s, math.hypot(sd_m_s, CHANGE_M_S2 * (fixed_s - time_s)))


def _forward(columns: Array, known: Known) -> list[ForwardAxis]:
    period_s = float(columns[-1, 0] - columns[0, 0]) / max(1, len(columns) - 1)
    axes = forward_axes(period_s, columns[:, 3], columns[:, 4], columns[:, 8])
    if known.stood is None:
        return list(axes)
    # Level since it stood: what speed it gained, it gained forward.
    north_m_s, east_m_s = (period_s * columns[:, 6:8].sum(axis=0)).tolist()
    if math.hypot(north_m_s, east_m_s) < CLEAR_START_M_S:
        return list(axes)
    return [ForwardAxis(math.atan2(east_m_s, north_m_s), 1.0)]


def first_force(readings: Sequence[Reading]) -> Vector3:
    """Return the mean specific force of the first ``LEVELLED_S`` of one reading or more."""
    first = [one for one in readings if one.time_s <= readings[0].time_s + LEVELLED_S]
    x, y, z = np.mean([one.force_m_s2 for one in first], axis=0).tolist()
    return (x, y, z)
