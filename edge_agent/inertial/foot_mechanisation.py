"""Strapdown mechanisation: attitude from angular rate, velocity and position from specific force.

Navigation frame north-east-down; ``quat_wxyz`` is ``nav_from_body``. Rate and force are the mean
of two neighbouring samples (trapezoid) and force is resolved at mid-interval, after Savage 1998,
"Strapdown inertial navigation integration algorithm design", without its coning and sculling
terms, which at 100 Hz and above are below a boot sensor's own errors.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from shared.compiled import compiled
from shared.maths.rotations import UP, shortest

Array = NDArray[np.float64]


@compiled
def turn_body(q: Array, rx: float, ry: float, rz: float) -> None:
    """``q ← q ⊗ exp(r)`` in place: turn by a rotation vector (rad) in body axes."""
    angle = math.sqrt(rx * rx + ry * ry + rz * rz)
    c = math.cos(0.5 * angle)
    s = math.sin(0.5 * angle) / angle if angle > 1e-8 else 0.5
    x, y, z = s * rx, s * ry, s * rz
    q0 = q[0] * c - q[1] * x - q[2] * y - q[3] * z
    q1 = q[0] * x + q[1] * c + q[2] * z - q[3] * y
    q2 = q[0] * y - q[1] * z + q[2] * c + q[3] * x
    q3 = q[0] * z + q[1] * y - q[2] * x + q[3] * c
    scale = 1.0 / math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    q[0], q[1], q[2], q[3] = q0 * scale, q1 * scale, q2 * scale, q3 * scale


@compiled
def turn_nav(q: Array, rx: float, ry: float, rz: float) -> None:
    """``q ← exp(r) ⊗ q`` in place: turn by a rotation vector (rad) in navigation axes."""
    q[1], q[2], q[3] = -q[1], -q[2], -q[3]
    turn_body(q, -rx, -ry, -rz)
    q[1], q[2], q[3] = -q[1], -q[2], -q[3]


@compiled
def rotation_matrix(q: Array, r: Array) -> None:
    """Write the 3×3 ``nav_from_body`` of ``q`` into ``r``."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    r[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    r[0, 1] = 2.0 * (x * y - w * z)
    r[0, 2] = 2.0 * (x * z + w * y)
    r[1, 0] = 2.0 * (x * y + w * z)
    r[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    r[1, 2] = 2.0 * (y * z - w * x)
    r[2, 0] = 2.0 * (x * z - w * y)
    r[2, 1] = 2.0 * (y * z + w * x)
    r[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@compiled
def turn_about_down(start: Array, end: Array) -> float:
    """Heading change (rad) between two attitudes: the twist about down of the turn between them.

    It asks for no forward axis of the sensor, so any mounting will do.
    """
    w = end[0] * start[0] + end[1] * start[1] + end[2] * start[2] + end[3] * start[3]
    z = end[3] * start[0] - end[0] * start[3] + end[2] * start[1] - end[1] * start[2]
    angle = 2.0 * math.atan2(z, w)
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def level_quaternion(force_m_s2: Array) -> Array:
    """Return the smallest ``nav_from_body`` turn that points a resting sensor's force upwards.

    Raises ValueError on a force too small to be gravity.
    """
    norm = float(np.linalg.norm(force_m_s2))
    if not norm > 1.0:
        raise ValueError(f"cannot level on {norm:.2f} m/s²: is the accelerometer connected?")
    x, y, z = force_m_s2.tolist()
    return np.array(shortest((x, y, z), UP))
