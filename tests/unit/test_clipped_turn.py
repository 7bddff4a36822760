"""A blow beyond the gyroscope's range is made whole by gravity, and by what is usual."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from edge_agent.inertial.clipped_turn import ClippedTurn
from shared.maths.rotations import (
    Quaternion,
    Vector3,
    angle_between_rad,
    from_rotation_vector,
    inverse,
    multiply,
    rotate,
    to_rotation_vector,
)

RANGE_RAD_S = math.radians(2000.0)
PERIOD_S = 0.01
GRAVITY: Vector3 = (0.0, 0.0, -9.81)


def blows(count: int) -> list[tuple[Quaternion, Vector3]]:
    """Return how a phone lies, and by how much a blow turns it: each axis beyond its range."""
    chance = np.random.default_rng(5)
    found: list[tuple[Quaternion, Vector3]] = []
    while len(found) < count:
        axis = chance.normal(size=3)
        x, y, z = chance.uniform(0.2, 1.0) * axis / np.linalg.norm(axis)
        if min(abs(x), abs(y), abs(z)) > RANGE_RAD_S * PERIOD_S:
            i, j, k, real = Rotation.random(rng=chance).as_quat()
            found.append(((real, i, j, k), (x, y, z)))
    return found


def left_over(before: Quaternion, turn: Vector3) -> tuple[float, float]:
    """Return by how much level, and heading, are off (rad) after a blow within one sample."""
    x, y, z = (math.copysign(RANGE_RAD_S, part) for part in turn)
    told = from_rotation_vector((PERIOD_S * x, PERIOD_S * y, PERIOD_S * z))
    now, true = multiply(before, told), multiply(before, from_rotation_vector(turn))
    clipped = ClippedTurn(before, before, (0, 0, 0))
    clipped.add(now, (x, y, z))
    in_sensor = rotate(inverse(true), GRAVITY)
    found = clipped.made_whole(now, rotate(now, in_sensor), GRAVITY)
    off = to_rotation_vector(multiply(found, inverse(true)))
    return angle_between_rad(rotate(found, in_sensor), GRAVITY), abs(off[2])


def test_level_is_right_after_a_blow_and_heading_nearly() -> None:
    off = np.degrees([left_over(*blow) for blow in blows(20)])
    assert off[:, 0].max() < 2.0
    # 9° in the mean, were the turn the least that explains where gravity points.
    assert off[:, 1].mean() < 7.5
