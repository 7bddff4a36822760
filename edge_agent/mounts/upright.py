"""A sensor worn any way up, for a method that asks for its z axis to point down.

Gravity, read in the first moments, says which way is up, and that is all the linear method needs
to know: turned about the vertical it finds the same strides, for its conditions hardly ask which
way is forward. How the sensor faces stays unknown to it, as to the paper.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from edge_agent.inertial.boot_start import stillest
from edge_agent.mounts.intake import LARGEST_READING
from edge_agent.mounts.interface import Increment, Mount
from edge_agent.sources.recording import Recording
from shared.maths.rotations import (
    UP,
    Quaternion,
    Vector3,
    angle_between_rad,
    rotate,
    shortest,
    to_matrix,
)
from shared.messages import ImuSample

LOOKED_AT = 50
"""Samples to find gravity in: a quarter to half of a second."""

STILL = 20
"""As many of them, the stillest in a row, are averaged."""

UPRIGHT_RAD = math.radians(50.0)
"""A sensor no further from upright is left as it is: on an instep it always slopes."""

WEAKEST_GRAVITY_M_S2 = 4.0


class UprightMount:
    """Turns samples upright before ``mount`` takes them in. See ``Mount``.

    The first ``LOOKED_AT`` samples are held back until gravity is found in them.
    """

    def __init__(self, mount: Mount) -> None:
        self._mount = mount
        self.faults = mount.faults
        self._waiting: list[ImuSample] | None = []
        self._upright_from_sensor: Quaternion | None = None
        self._done: deque[Increment] = deque()

    @property
    def ready(self) -> bool:
        """Whether the sensor has been still once, so that the wearer may set out."""
        return self._mount.ready

    @property
    def heading_rad(self) -> float:
        """How the sensor faces, turned upright, in the agent's level frame."""
        return self._mount.heading_rad

    @property
    def heading_sd_rad(self) -> float:
        """How well the heading was known as the wearer set out."""
        return self._mount.heading_sd_rad

    @property
    def worn(self) -> str | None:
        """How far the sensor was turned, in words; ``None`` if it was not."""
        if self._upright_from_sensor is None:
            return self._mount.worn
        turned_rad = 2.0 * math.acos(min(1.0, abs(self._upright_from_sensor[0])))
        return f"Boot sensor is worn {math.degrees(turned_rad):.0f}° off upright: put right"

    def step(self, sample: ImuSample) -> Increment | None:
        """Take in the next sample; return the movement that it completes, if it does."""
        if self._waiting is None:
            return self._mount.step(self._turned(sample))
        self._waiting.append(sample)
        if len(self._waiting) >= LOOKED_AT:
            self._begin()
        return self._done.popleft() if self._done else None

    def steps(self, samples: Recording) -> list[Increment]:
        """Take in samples in order; return the movements that they complete."""
        head = min(LOOKED_AT, len(samples)) if self._waiting is not None else 0
        told = [self.step(sample) for sample in samples.rows(slice(0, head))]
        rest = samples.rows(slice(head, len(samples)))
        if self._upright_from_sensor is not None:
            matrix = np.array(to_matrix(self._upright_from_sensor)).T
            rest = replace(
                rest,
                force_m_s2=rest.force_m_s2 @ matrix,
                rate_rad_s=rest.rate_rad_s @ matrix,
                field_ut=None if rest.field_ut is None else rest.field_ut @ matrix,
            )
        return [one for one in told if one is not None] + self._mount.steps(rest)

    def finish(self) -> list[Increment]:
        """Return the movements that were still being waited for: no more samples will come."""
        if self._waiting:
            self._begin()
        done, self._done = list(self._done), deque()
        return done + self._mount.finish()

    def _begin(self) -> None:
        waiting, self._waiting = self._waiting or [], None
        self._upright_from_sensor = upright_from(waiting)
        for sample in waiting:
            increment = self._mount.step(self._turned(sample))
            if increment is not None:
                self._done.append(increment)

    def _turned(self, sample: ImuSample) -> ImuSample:
        turn = self._upright_from_sensor
        if turn is None:
            return sample
        return ImuSample(
            sample.time_ns,
            rotate(turn, sample.force_m_s2),
            rotate(turn, sample.rate_rad_s),
            None if sample.field_ut is None else rotate(turn, sample.field_ut),
            sample.pressure_pa,
        )


def upright_from(samples: Sequence[ImuSample]) -> Quaternion | None:
    """Return the turn that puts a sensor's z axis down, ``None`` if it need not or cannot be."""
    readings = np.array([(*one.force_m_s2, *one.rate_rad_s) for one in samples])
    readings = readings[(np.abs(readings) <= LARGEST_READING).all(axis=1)]
    if len(readings) < STILL:
        return None
    first, count = stillest(readings[:, :3], readings[:, 3:], STILL)
    x, y, z = readings[first : first + count, :3].mean(axis=0).tolist()
    gravity_m_s2: Vector3 = (x, y, z)
    if math.hypot(x, y, z) < WEAKEST_GRAVITY_M_S2:
        return None
    return shortest(gravity_m_s2, UP) if angle_between_rad(gravity_m_s2, UP) > UPRIGHT_RAD else None
