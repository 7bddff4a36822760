"""Which way a sensor on the trunk is carried, found by how people walk.

Whatever way it is put on, gravity tells it up, and the gait ahead: the trunk is fastest while both
feet are down, where it is also lowest and pushed up most, so that forward acceleration runs with
the rate of change of the upward one. Aside the trunk swings half as often, which adds up to
nothing. Unlike the principal axis of horizontal acceleration this tells ahead from back.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from edge_agent.inertial.butterworth import LowPass
from shared.maths.rotations import Vector3

CUTOFF_HZ = 3.0
REMEMBERED_STEPS = 25.0
"""A sensor that slips round the belt is believed after as many."""


class WalkingDirection:
    """Ahead, as a direction in the sensor's axes: it need not be told how the sensor turns."""

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._filters: tuple[LowPass, LowPass, LowPass] | None = None
        self._up: float | None = None
        self._step = [0.0, 0.0, 0.0]
        self._mean = [0.0, 0.0, 0.0]
        self.steps = 0
        """How many steps tell of it."""

    @property
    def ahead(self) -> Vector3:
        """Ahead in the sensor's axes, of no particular length; zero if nothing is known."""
        x, y, z = self._mean
        return (x, y, z)

    def step(self, force_m_s2: Vector3, up_in_sensor: Vector3) -> None:
        """Take in the next force, and which way is up, both in the sensor's axes."""
        if self._filters is None:
            fx, fy, fz = (LowPass(CUTOFF_HZ, self._rate_hz, axis) for axis in force_m_s2)
            self._filters = fx, fy, fz
        smooth = [one.step(axis) for one, axis in zip(self._filters, force_m_s2, strict=True)]
        up = sum(axis * part for axis, part in zip(smooth, up_in_sensor, strict=True))
        change, self._up = 0.0 if self._up is None else up - self._up, up
        for axis, part in enumerate(up_in_sensor):
            self._step[axis] += (smooth[axis] - up * part) * change

    def land(self) -> None:
        """Take a step to be over: what it told counts from now on."""
        self.steps += 1
        share = 1.0 / min(float(self.steps), REMEMBERED_STEPS)
        self._mean = [
            old + share * (new - old) for old, new in zip(self._mean, self._step, strict=True)
        ]
        self.pause()

    def pause(self) -> None:
        """Drop what was read since the last landing: nobody walked."""
        self._step = [0.0, 0.0, 0.0]


def heading_of_mean(level: Sequence[Vector3]) -> float:
    """Return the mean heading of vectors in a level north-east-down frame; 0 of none."""
    return math.atan2(sum(east for _, east, _ in level), sum(north for north, _, _ in level))
