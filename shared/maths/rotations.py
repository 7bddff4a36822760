"""Rotations sample by sample, on plain floats.

A three-vector in numpy costs ten times its arithmetic in calls; what runs at every inertial sample
therefore works on tuples. A quaternion is ``(w, x, y, z)``, of unit norm unless said otherwise, and
is named for what it does: ``nav_from_body`` takes body coordinates to navigation coordinates, so
that products read left to right. The navigation frame is north-east-down, the body frame
forward-right-down; a sensor at rest therefore reads its specific force along −z.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from shared.maths.angles import wrap_rad

Vector3: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]
Matrix3: TypeAlias = tuple[Vector3, Vector3, Vector3]

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)
UP: Vector3 = (0.0, 0.0, -1.0)


def multiply(c_from_b: Quaternion, b_from_a: Quaternion) -> Quaternion:
    """Return ``c_from_a``: first ``b_from_a``, then ``c_from_b``. Norms multiply."""
    aw, ax, ay, az = c_from_b
    bw, bx, by, bz = b_from_a
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def inverse(b_from_a: Quaternion) -> Quaternion:
    """Return ``a_from_b`` (the conjugate: the norm is one)."""
    w, x, y, z = b_from_a
    return (w, -x, -y, -z)


def normalise(quat_wxyz: Quaternion) -> Quaternion:
    """Return the quaternion of norm one in the same direction; raise ``ValueError`` on zero."""
    w, x, y, z = quat_wxyz
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if norm == 0.0:
        raise ValueError("a quaternion of norm zero is no rotation")
    return (w / norm, x / norm, y / norm, z / norm)


def rotate(b_from_a: Quaternion, vector_a: Vector3) -> Vector3:
    """Return ``vector_a`` in frame b."""
    w, x, y, z = b_from_a
    vx, vy, vz = vector_a
    # v + 2 w (q × v) + 2 q × (q × v): half the products of q v q*.
    tx = 2.0 * (y * vz - z * vy)
    ty = 2.0 * (z * vx - x * vz)
    tz = 2.0 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


def from_rotation_vector(rotation_rad: Vector3) -> Quaternion:
    """Return the rotation by ``|rotation_rad|`` about its direction.

    Its inverse, ``to_rotation_vector``, gives the same vector back up to an angle of π.
    """
    x, y, z = rotation_rad
    angle_rad = math.sqrt(x * x + y * y + z * z)
    half_rad = 0.5 * angle_rad
    # sin(a/2)/a is 1/2 − a²/48 …: below 1e-4 the second term is under the last bit.
    scale = 0.5 if angle_rad < 1e-4 else math.sin(half_rad) / angle_rad
    return (math.cos(half_rad), scale * x, scale * y, scale * z)


def to_rotation_vector(b_from_a: Quaternion) -> Vector3:
    """Return the rotation vector of at most π radians."""
    w, x, y, z = b_from_a
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 if sine < 1e-9 else 2.0 * math.atan2(sine, abs(w)) / sine
    # q and −q are one rotation: that of positive w is the one by at most π.
    scale = math.copysign(factor, w)
    return (scale * x, scale * y, scale * z)


def about_down(angle_rad: float) -> Quaternion:
    """Return the turn by ``angle_rad`` clockwise seen from above (about z, which is down)."""
    return (math.cos(0.5 * angle_rad), 0.0, 0.0, math.sin(0.5 * angle_rad))


def shortest(from_vector: Vector3, to_vector: Vector3) -> Quaternion:
    """Return the smallest rotation that turns ``from_vector`` into the direction ``to_vector``.

    Lengths do not matter. Of opposite vectors any half turn will do, and one is given. Raises
    ``ValueError`` when either has no direction.
    """
    ax, ay, az = from_vector
    bx, by, bz = to_vector
    lengths = math.hypot(ax, ay, az) * math.hypot(bx, by, bz)
    if lengths == 0.0:
        raise ValueError("a vector of length zero has no direction")
    dot = ax * bx + ay * by + az * bz
    cross = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
    if dot >= 0.0:
        return normalise((lengths + dot, *cross))
    sine = math.hypot(*cross)
    if sine < 1e-8 * lengths:
        return normalise((0.0, 0.0, -az, ay) if abs(ax) < abs(az) else (0.0, -ay, ax, 0.0))
    # Towards a half turn, lengths + dot would lose its digits.
    half_rad = 0.5 * math.atan2(sine, dot)
    x, y, z = cross
    scale = math.sin(half_rad) / sine
    return (math.cos(half_rad), scale * x, scale * y, scale * z)


def angle_between_rad(a: Vector3, b: Vector3) -> float:
    """Return the angle, 0 to π, between two vectors of any length but zero."""
    product = sum(x * y for x, y in zip(a, b, strict=True))
    return math.acos(max(-1.0, min(1.0, product / (math.hypot(*a) * math.hypot(*b)))))


def from_gravity(force_m_s2: Vector3, heading_rad: float = 0.0) -> Quaternion:
    """Return ``nav_from_body`` of a body at rest that reads ``force_m_s2``, turned to a heading.

    Specific force at rest points up, and two angles of attitude follow from it; the third,
    ``heading_rad``, has to be told (see ``heading_of``). Raises ``ValueError`` on zero force.
    """
    level_from_body = shortest(force_m_s2, UP)
    turn_rad = heading_rad - heading_of(level_from_body)
    return multiply(about_down(turn_rad), level_from_body)


def heading_of(nav_from_body: Quaternion) -> float:
    """Return the heading in [−π, π): clockwise from north, of the way the body faces.

    Taken from the right-hand axis, which stays level while a foot pitches, so that a boot on its
    toe still has a heading; a body on its side, right-hand axis vertical, has none.
    """
    w, x, y, z = nav_from_body
    right_north = 2.0 * (x * y - w * z)
    right_east = 1.0 - 2.0 * (x * x + z * z)
    return wrap_rad(math.atan2(-right_north, right_east))


def to_matrix(b_from_a: Quaternion) -> Matrix3:
    """Return the rotation matrix, rows first: ``vector_b = matrix @ vector_a``."""
    w, x, y, z = b_from_a
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
