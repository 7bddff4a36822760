"""A turn faster than the gyroscope's range, made whole by gravity.

Of a blow that turns a phone from one sample to the next, each clipped axis tells only its sign and
that it turned by more. How much more is what makes the specific force afterwards point as it did
before: the vehicle has not changed its acceleration in those milliseconds. Two angles follow from
gravity; where all three axes are clipped, the third is what is nearest to an excess that is usual.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.maths.rotations import (
    Quaternion,
    Vector3,
    from_rotation_vector,
    inverse,
    multiply,
    rotate,
    to_rotation_vector,
)

CLIPPED_RAD_S = 0.97 * math.radians(2000.0)
"""Phones measure up to 2000 °/s."""

Array: TypeAlias = NDArray[np.float64]

FURTHER_RAD = math.radians(10.0)
"""An axis beyond its range is supposed to have turned by so much more, where nothing tells."""

NUDGE_RAD = 1e-5
ITERATIONS = 12

SUPPOSED_WEIGHT = 0.02
"""Of an angle that is not as supposed (rad) against a direction missed (1)."""


@dataclass
class ClippedTurn:
    """From the sample before the first clipped one to the last. Plain state."""

    level_from_sensor: Quaternion
    turned: Quaternion
    signs: tuple[int, int, int]

    def add(self, level_from_sensor: Quaternion, rate_rad_s: Vector3) -> None:
        """Take in another clipped sample, and the attitude after it."""
        self.turned = multiply(inverse(self.level_from_sensor), level_from_sensor)
        x, y, z = (
            old or new for old, new in zip(self.signs, clipped_signs(rate_rad_s), strict=True)
        )
        self.signs = (x, y, z)

    def made_whole(
        self, level_from_sensor: Quaternion, force_m_s2: Vector3, expected_m_s2: Vector3
    ) -> Quaternion:
        """Return the attitude that turns ``force_m_s2`` to where ``expected_m_s2`` points.

        ``level_from_sensor`` is the attitude of now by what the gyroscope read, ``force_m_s2``
        the specific force in those level axes, ``expected_m_s2`` what it should be.
        """
        since = multiply(inverse(multiply(self.level_from_sensor, self.turned)), level_from_sensor)
        in_sensor = rotate(inverse(level_from_sensor), force_m_s2)
        told_rad = np.array(to_rotation_vector(self.turned))
        axes = [axis for axis in range(3) if self.signs[axis]]
        aim = np.array(expected_m_s2) / math.hypot(*expected_m_s2)

        def attitude(extra_rad: Array) -> Quaternion:
            x, y, z = (told_rad + _spread(extra_rad, axes, self.signs)).tolist()
            turned = from_rotation_vector((x, y, z))
            return multiply(multiply(self.level_from_sensor, turned), since)

        def missed(extra_rad: Array) -> Array:
            pointed = np.array(rotate(attitude(extra_rad), in_sensor))
            away = pointed / np.linalg.norm(pointed) - aim
            return np.concatenate((away, SUPPOSED_WEIGHT * (extra_rad - FURTHER_RAD)))

        return attitude(_least(missed, len(axes)))


def clipped_signs(rate_rad_s: Vector3) -> tuple[int, int, int]:
    """Return the sign of each axis that reads as much as it can, else 0."""
    x, y, z = (
        int(math.copysign(1.0, rate)) if abs(rate) >= CLIPPED_RAD_S else 0 for rate in rate_rad_s
    )
    return (x, y, z)


def _spread(extra_rad: Array, axes: list[int], signs: tuple[int, int, int]) -> Array:
    """Return ``extra_rad`` (k,) of the clipped axes as a rotation vector."""
    spread = np.zeros(3)
    for axis, angle_rad in zip(axes, extra_rad, strict=True):
        spread[axis] = signs[axis] * angle_rad
    return spread


def _least(missed: Callable[[Array], Array], count: int) -> Array:
    """Return the angles (count,), none negative, of which least is ``missed``: Gauss-Newton."""
    angles_rad = np.full(count, FURTHER_RAD)
    best = float(np.sum(missed(angles_rad) ** 2))
    for _ in range(ITERATIONS):
        here = missed(angles_rad)
        slopes = np.column_stack(
            [(missed(angles_rad + NUDGE_RAD * unit) - here) / NUDGE_RAD for unit in np.eye(count)]
        )
        step = np.linalg.lstsq(slopes, -here, rcond=None)[0]
        for share in (1.0, 0.5, 0.25, 0.1):
            tried_rad = np.clip(angles_rad + share * step, 0.0, math.pi)
            error = float(np.sum(missed(tried_rad) ** 2))
            if error < best:
                angles_rad, best = tried_rad, error
                break
        else:
            break
    return angles_rad
