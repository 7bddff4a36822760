"""How a phone lies in a vehicle, from the gravity vector: re-aligned when it slips, else held.

As in "Dynamic coordinate correction algorithm based on gravity vector analysis for vehicle speed
estimation". The digest of the paper that is followed tells no constants: those below are ours,
chosen so that vibration does not realign the phone and a slip does within 0.2 s.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from shared.maths.rotations import (
    IDENTITY,
    Quaternion,
    Vector3,
    from_rotation_vector,
    multiply,
    rotate,
)

LOW_PASS_S = 0.1
WINDOW_S = 0.2
RANGE_RAD = math.radians(10.0)
"""An event: roll or pitch of the gravity vector range over more than that in a window."""

MEAN_S = 0.1
"""The rotation is renewed from the mean gravity of so long just before."""

WEAKEST_GRAVITY_M_S2 = 1.0
"""A phone that falls has no gravity to be aligned by."""


@dataclass
class GravityAlignment:
    """Takes specific force in order of time; tells the rotation that levels it. Plain state."""

    level_from_sensor: Quaternion = IDENTITY
    gravity_m_s2: float = 0.0
    """Magnitude of the gravity vector aligned by; 0 before the first alignment."""

    moving: bool = False
    _gravity: Vector3 | None = None
    _window: deque[tuple[float, float, float, Vector3]] = field(default_factory=deque)

    def step(self, time_s: float, force_m_s2: Vector3, lasted_s: float) -> None:
        """Take in a sample; renew the rotation in an event, and once at its end."""
        down = _negative(force_m_s2)
        weight = min(1.0, lasted_s / LOW_PASS_S)
        old = self._gravity or down
        x, y, z = (was + weight * (new - was) for was, new in zip(old, down, strict=True))
        self._gravity = (x, y, z)
        self._window.append((time_s, *roll_pitch(self._gravity), down))
        while time_s - self._window[0][0] > WINDOW_S:
            self._window.popleft()
        was_moving, self.moving = self.moving, self._ranges() > RANGE_RAD
        first = not self.gravity_m_s2 and time_s - self._window[0][0] > MEAN_S
        if first or self.moving or was_moving:
            self._renew(time_s)

    def _ranges(self) -> float:
        """Return the greater of the ranges of roll and of pitch over the window."""
        return max(
            _range([roll for _, roll, _, _ in self._window]),
            _range([pitch for _, _, pitch, _ in self._window]),
        )

    def _renew(self, time_s: float) -> None:
        recent = [down for at_s, _, _, down in self._window if time_s - at_s <= MEAN_S]
        x, y, z = (sum(axis) / len(recent) for axis in zip(*recent, strict=True))
        if math.hypot(x, y, z) < WEAKEST_GRAVITY_M_S2:
            return
        self.gravity_m_s2 = math.hypot(x, y, z)
        roll_rad, pitch_rad = roll_pitch((x, y, z))
        self.level_from_sensor = multiply(
            from_rotation_vector((0.0, pitch_rad, 0.0)), from_rotation_vector((roll_rad, 0.0, 0.0))
        )

    def level(self, vector: Vector3) -> Vector3:
        """Return a vector of the sensor's axes in level ones: R = Ry(θ)·Rx(φ)."""
        return rotate(self.level_from_sensor, vector)


def roll_pitch(gravity: Vector3) -> tuple[float, float]:
    """Return φ = atan(gy / gz) and θ = atan(−gx / √(gy² + gz²)) of a vector that points down.

    The quadrant of φ is kept, so that a phone that lies on its face is levelled too.
    """
    x, y, z = gravity
    return math.atan2(y, z), math.atan2(-x, math.hypot(y, z))


def _range(angles_rad: list[float]) -> float:
    """Return maximum less minimum; of angles on both sides of ±π, the way across it."""
    spread_rad = max(angles_rad) - min(angles_rad)
    if spread_rad <= math.pi:
        return spread_rad
    turned_rad = [angle % (2.0 * math.pi) for angle in angles_rad]
    return max(turned_rad) - min(turned_rad)


def _negative(vector: Vector3) -> Vector3:
    x, y, z = vector
    return (-x, -y, -z)
