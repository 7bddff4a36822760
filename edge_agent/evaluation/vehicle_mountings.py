"""A phone that lies any way round in a vehicle, and slips: made of a drive with one that was fixed.

The samples of a sensor fixed to the car are turned by known rotations from known times on. What the
gyroscope reads of the turning itself is added, as a real one would read it: the mean turn since the
sample before, by a scale a little off, and never more than its range.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from edge_agent.sources.recording import Recording
from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]
SlipKind: TypeAlias = Literal["step", "slide", "drop", "hand"]
Lie: TypeAlias = Literal["tilted", "any"]

SLIPS = 3
SETTLED_S = 10.0
"""The phone lies still for so long at the start, and for half of that after each slip."""

DURATIONS_S: dict[SlipKind, tuple[float, float]] = {
    "step": (0.0, 0.0),
    "slide": (0.1, 0.5),
    "drop": (0.2, 0.4),
    "hand": (1.5, 4.0),
}
"""Shortest and longest. A step is over from one sample to the next; a drop is a fall and a blow."""

ANGLES_RAD = (math.radians(10.0), math.radians(60.0))
TILT_RAD = math.radians(45.0)
"""A slip turns by so much; a phone that is only tilted lies within so much in roll and pitch."""

SCALE_ERROR = 0.01
GYRO_RANGE_RAD_S = math.radians(2000.0)
BLOW_M_S2 = 40.0
BLOW_S = 0.03
HAND_M_S2 = 0.7
HAND_S = 0.15
"""A hand shakes by that, and so fast."""


class Slip(NamedTuple):
    """From ``begin_s`` to ``end_s``, of the recording's time, the phone turned by ``angle_rad``."""

    kind: SlipKind
    begin_s: float
    end_s: float
    angle_rad: float


class Mounted(NamedTuple):
    """What the phone reads, and when it slipped."""

    recording: Recording
    slips: tuple[Slip, ...]


def mounted(fixed: Recording, lie: Lie, chance: np.random.Generator) -> Mounted:
    """Return what a phone reads in the same drive that lies otherwise, and slips ``SLIPS`` times.

    ``fixed`` is in the car's forward-right-down axes. ``tilted``: only rolled and pitched, as the
    published method takes a phone to lie; ``any``: any way round, upside down as well.
    """
    time_s = fixed.time_ns / NS_PER_S
    slips, car_from_sensor = _course(time_s, lie, chance)
    force_m_s2 = car_from_sensor.inv().apply(fixed.force_m_s2)
    turned = (car_from_sensor[:-1].inv() * car_from_sensor[1:]).as_rotvec()
    turned_rad_s = np.vstack((np.zeros(3), turned / np.diff(time_s)[:, None]))
    scale = 1.0 + chance.normal(0.0, SCALE_ERROR)
    rate_rad_s = car_from_sensor.inv().apply(fixed.rate_rad_s) + scale * turned_rad_s
    for slip in slips:
        _handle(force_m_s2, time_s, slip, chance)
    return Mounted(
        replace(
            fixed,
            force_m_s2=force_m_s2,
            rate_rad_s=np.clip(rate_rad_s, -GYRO_RANGE_RAD_S, GYRO_RANGE_RAD_S),
        ),
        slips,
    )


def _course(
    time_s: Array, lie: Lie, chance: np.random.Generator
) -> tuple[tuple[Slip, ...], Rotation]:
    """Return the slips, and how the sensor lies in the car at each of ``time_s`` (n,)."""
    lies = [_lying(lie, chance)]
    slips: list[Slip] = []
    share_s = (time_s[-1] - time_s[0] - SETTLED_S) / SLIPS
    for number in range(SLIPS):
        kind = _KINDS[int(chance.integers(len(_KINDS)))]
        duration_s = float(chance.uniform(*DURATIONS_S[kind]))
        earliest_s = float(time_s[0]) + SETTLED_S + number * share_s
        latest_s = earliest_s + max(0.0, share_s - duration_s - 0.5 * SETTLED_S)
        begin_s = float(chance.uniform(earliest_s, latest_s))
        lies.append(_slipped(lies[-1], lie, chance))
        angle_rad = float((lies[-2].inv() * lies[-1]).magnitude())
        slips.append(Slip(kind, begin_s, begin_s + duration_s, angle_rad))
    car_from_sensor = _lying_at(time_s, slips, lies)
    return tuple(slips), car_from_sensor


_KINDS: tuple[SlipKind, ...] = ("step", "slide", "drop", "hand")


def _lying(lie: Lie, chance: np.random.Generator) -> Rotation:
    if lie == "any":
        return Rotation.random(rng=chance)
    return Rotation.from_euler("YX", chance.uniform(-TILT_RAD, TILT_RAD, 2))


def _slipped(before: Rotation, lie: Lie, chance: np.random.Generator) -> Rotation:
    """Return how the phone lies afterwards: turned by an angle within ``ANGLES_RAD``."""
    if lie == "any":
        axis = chance.normal(size=3)
        angle_rad = chance.uniform(*ANGLES_RAD)
        return before * Rotation.from_rotvec(angle_rad * axis / np.linalg.norm(axis))
    while True:
        after = _lying(lie, chance)
        if ANGLES_RAD[0] <= (before.inv() * after).magnitude() <= ANGLES_RAD[1]:
            return after


def _lying_at(time_s: Array, slips: list[Slip], lies: list[Rotation]) -> Rotation:
    """Return how the sensor lies at each time: along each slip smoothly from lie to lie."""
    quats = np.empty((len(time_s), 4))
    quats[:] = lies[0].as_quat()
    for slip, before, after in zip(slips, lies, lies[1:], strict=False):
        share = np.clip((time_s - slip.begin_s) / max(slip.end_s - slip.begin_s, 1e-9), 0.0, 1.0)
        smooth = share * share * (3.0 - 2.0 * share)
        way = Slerp([0.0, 1.0], Rotation.concatenate([before, after]))
        later = time_s > slip.begin_s
        quats[later] = way(smooth[later]).as_quat()
    return Rotation.from_quat(quats)


def _handle(force_m_s2: Array, time_s: Array, slip: Slip, chance: np.random.Generator) -> None:
    """Add to specific force (n, 3) what a fall and a blow, or a hand, does to it."""
    rows = (time_s > slip.begin_s) & (time_s <= slip.end_s)
    if slip.kind == "drop":
        direction = chance.normal(size=3)
        blow = rows & (time_s > slip.end_s - BLOW_S)
        force_m_s2[rows] = 0.0
        force_m_s2[blow] = BLOW_M_S2 * direction / np.linalg.norm(direction)
    elif slip.kind == "hand":
        knots_s = np.arange(slip.begin_s, slip.end_s + HAND_S, HAND_S)
        shaking = chance.normal(0.0, HAND_M_S2, (len(knots_s), 3))
        for axis in range(3):
            force_m_s2[rows, axis] += np.interp(time_s[rows], knots_s, shaking[:, axis])
