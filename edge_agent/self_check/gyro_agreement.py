"""Whether a gyroscope turns as gravity and the compass do in the same sensor's axes (pure).

Over a second or two the mean of specific force is gravity, by some degrees, for whoever walks or
drives: from one second to the next it moves in the sensor's axes by what the gyroscope has turned.
It does not where the two have different axes (a browser's alpha, beta and gamma are z, x and y),
nor where rates are in °/s. On the recordings of people and the drive with its slips they part by
11° at most (root mean square of ten seconds), with axes exchanged by 25 to 53° at a belt and 40°
in a hand that turns about; with rates in degrees by 55° or more. A boot is no such place.

Axes that are a mirror image, or rates by the left hand, turn the other way about. A trunk tilts too
little to show that by gravity within seconds, so what is turned is weighed for as long as it lasts:
of the compass, in the hand, 0.7 to 1.0 of the gyroscope's turn, and less those; with 20 µT of iron
beside it −0.2 to 0.5.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.maths.rotations import (
    Vector3,
    angle_between_rad,
    from_rotation_vector,
    inverse,
    rotate,
)
from shared.messages import ImuSample
from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]

SECONDS = 10
MOST_RAD = math.radians(20.0)
LONGEST_STEP_S = 0.2
"""Nobody knows how a sensor turned between samples that are further apart."""

FEWEST = 8
FEWEST_OF_FIELD = 2
WEAKEST_M_S2 = 3.0


MIRRORED = -0.5
"""Of what the gyroscope turned, the rest has turned by less: the other way about."""

TELLING_RAD2 = 0.3
"""Summed over squares of seconds, so much has to have been turned."""

WEAKEST_FIELD_UT = 3.0
"""Level, of a compass that tells where north is."""


class _Second(NamedTuple):
    """Its mean force, and field if there is one, in sensor axes; the turn from its middle on."""

    force_m_s2: Array
    field_ut: Array | None
    turned_rad: Array


@dataclass
class _Turned:
    """By how much something has turned with the gyroscope, weighed by what that turned."""

    together_rad2: float = 0.0
    gyro_rad2: float = 0.0

    def add(self, gyro_rad: Array, other_rad: Array) -> None:
        """Take in the turns of a second."""
        self.together_rad2 += float(gyro_rad @ other_rad)
        self.gyro_rad2 += float(gyro_rad @ gyro_rad)

    @property
    def is_mirrored(self) -> bool:
        """Whether it turns the other way about."""
        return self.gyro_rad2 > TELLING_RAD2 and self.together_rad2 < MIRRORED * self.gyro_rad2


class GyroAgreement:
    """Takes samples a second at a time, in order; tells what contradicts the gyroscope."""

    def __init__(self) -> None:
        self._off_rad2: deque[float] = deque(maxlen=SECONDS)
        self._gravity = _Turned()
        self._compass = _Turned()
        self._before: _Second | None = None
        self._last_ns: int | None = None

    @property
    def forces_contradict(self) -> bool:
        """Whether forces part from rates by more than ``MOST_RAD``, or turn the other way about."""
        parted_rad = math.sqrt(math.fsum(self._off_rad2) / SECONDS)
        return parted_rad > MOST_RAD or self._gravity.is_mirrored

    @property
    def compass_contradicts(self) -> bool:
        """Whether the compass has turned the other way about."""
        return self._compass.is_mirrored

    def take(self, samples: Sequence[ImuSample]) -> None:
        """Take in the samples of a second; what is no reading, or late, breaks it off."""
        times_ns = [one.time_ns for one in samples]
        readings = np.array([(*one.force_m_s2, *one.rate_rad_s) for one in samples]).reshape(-1, 6)
        first_ns = times_ns[0] if self._last_ns is None else self._last_ns
        apart_s = np.diff([first_ns, *times_ns]) / NS_PER_S
        self._last_ns = times_ns[-1]
        before, self._before = self._before, None
        whole = np.isfinite(readings).all() and apart_s.min() >= 0.0 and len(samples) >= FEWEST
        if not whole or apart_s.max() > LONGEST_STEP_S:
            return
        turned_rad = readings[:, 3:] * apart_s[:, None]
        half = len(samples) // 2
        force_m_s2 = readings[:, :3].mean(axis=0)
        if np.linalg.norm(force_m_s2) < WEAKEST_M_S2:
            return
        now = _Second(force_m_s2, _mean_field(samples), turned_rad[half:].sum(axis=0))
        if before is not None:
            self._compare(before, now, before.turned_rad + turned_rad[:half].sum(axis=0))
        self._before = now

    def _compare(self, before: _Second, now: _Second, turned_rad: Array) -> None:
        """Weigh what moved from the middle of a second to that of the next, by the gyroscope."""
        was, is_now = (_unit(one.force_m_s2) for one in (before, now))
        turn = from_rotation_vector(_vector(turned_rad))
        expected = np.array(rotate(inverse(turn), _vector(was)))
        self._off_rad2.append(angle_between_rad(_vector(expected), _vector(is_now)) ** 2)
        self._gravity.add(expected - was, is_now - was)
        if before.field_ut is None or now.field_ut is None:
            return
        up = _unit(was + is_now)
        from_ut, to_ut = (one - up * (up @ one) for one in (before.field_ut, now.field_ut))
        if min(np.linalg.norm(from_ut), np.linalg.norm(to_ut)) > WEAKEST_FIELD_UT:
            # What turns to the left sees the field turn to the right.
            turned = math.atan2(float(up @ np.cross(to_ut, from_ut)), float(from_ut @ to_ut))
            self._compass.add(np.array([up @ turned_rad]), np.array([turned]))


def _mean_field(samples: Sequence[ImuSample]) -> Array | None:
    told = [one.field_ut for one in samples if one.field_ut is not None]
    field_ut = np.array(told).reshape(-1, 3)
    if len(field_ut) < FEWEST_OF_FIELD or not np.isfinite(field_ut).all():
        return None
    mean_ut: Array = field_ut.mean(axis=0)
    return mean_ut


def _unit(vector: Array) -> Array:
    unit: Array = vector / max(float(np.linalg.norm(vector)), 1e-9)
    return unit


def _vector(values: Array) -> Vector3:
    x, y, z = values.tolist()
    return (x, y, z)
