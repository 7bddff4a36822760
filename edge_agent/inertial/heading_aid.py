"""What helps the gyro to keep a heading, stride by stride: the magnetometer, and the building.

Both tell of a heading's error only; :class:`HeadingDrift` weighs them. The magnetometer is read at
stances, once in so many metres: at one place steel errs in one way however often it is asked. The
dominant direction of the building is used only where it is asked for.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from edge_agent.inertial.boot_state import LOST, STRIDE, Stride
from edge_agent.inertial.dominant_direction import PIECE_SD_RAD, DominantDirection
from edge_agent.inertial.eskf_parameters import CAPACITY
from edge_agent.inertial.field_gate import FieldGate
from edge_agent.inertial.heading_drift import NO_CORRECTION, Correction, HeadingDrift
from edge_agent.inertial.stride_error import heading_variance
from edge_agent.sources.recording import Recording
from shared.maths.rotations import Vector3, about_down, multiply, to_matrix
from shared.messages import ImuSample
from shared.units import NS_PER_S

PLACE_M = 2.5
"""Fields so far apart along the way are of different places."""

STANCE_NS = round(0.05 * NS_PER_S)
"""The field of a stance is the mean of what is read so near to its instant."""

LONGEST_S = 600.0
"""What seems to take longer is a clock set forward."""

STRIDE_SD_RAD = math.radians(0.6)
LASTING_SHARE = 0.1
"""Of the variance of a heading change up to that of a usual stride so much adds up: strides err to
and fro, what is left over a minute of walking is a steady drift, which is a state of its own."""


def lasting_variance(stride: Stride, elapsed_s: float) -> float:
    """Return the variance (rad²) that ``stride`` leaves in all headings after it."""
    if stride.kind == LOST:
        return heading_variance(elapsed_s, elapsed_s, bias_known=True)
    told_rad2 = stride.covariance[3][3]
    usual_rad2 = min(told_rad2, STRIDE_SD_RAD**2)
    return told_rad2 - (1.0 - LASTING_SHARE) * usual_rad2


class HeadingAid:
    """Takes readings and strides in order; tells by how much to turn what comes. Plain state."""

    def __init__(self, *, dominant_direction: bool = False) -> None:
        self._drift = HeadingDrift()
        self._gate = FieldGate()
        self._building = DominantDirection() if dominant_direction else None
        self._fields: deque[tuple[int, Vector3]] = deque(maxlen=CAPACITY)
        self._since_place_m = math.inf
        self._elapsed_s = self._turned_rad2 = self._walked_m = 0.0

    @property
    def sd_rad(self) -> float:
        """How well heading is known against that at setting out, as by the last that told it."""
        return self._drift.error_sd_rad

    def read(self, sample: ImuSample) -> None:
        """Take in the field of a sample, if it has one."""
        if sample.field_ut is not None and all(map(math.isfinite, sample.field_ut)):
            self._fields.append((sample.time_ns, sample.field_ut))

    def read_rows(self, samples: Recording, first: int, end: int) -> None:
        """Take in the fields of rows ``first`` to before ``end``, as :meth:`read` of each."""
        if samples.field_ut is None:
            return
        first = max(first, end - CAPACITY)
        times_ns = samples.time_ns[first:end].tolist()
        for time_ns, (x, y, z) in zip(times_ns, samples.field_ut[first:end].tolist(), strict=True):
            if math.isfinite(x) and math.isfinite(y) and math.isfinite(z):
                self._fields.append((time_ns, (x, y, z)))

    def take(self, stride: Stride, frame_turn_rad: float) -> Correction:
        """Return what the end of ``stride`` tells, told in a frame turned by ``frame_turn_rad``."""
        north_m, east_m, _ = stride.displacement_m
        walked_m = math.hypot(north_m, east_m)
        elapsed_s = min(max(0.0, (stride.end_ns - stride.start_ns) / NS_PER_S), LONGEST_S)
        self._elapsed_s += elapsed_s
        self._turned_rad2 += lasting_variance(stride, elapsed_s)
        self._walked_m += walked_m
        self._since_place_m += walked_m
        corrections = [self._drift.drift_back(elapsed_s)]
        if stride.kind == STRIDE:
            turned_rad = frame_turn_rad + corrections[0].turn_rad
            corrections.append(self._by_field(stride, turned_rad))
            corrections.append(self._by_building(north_m, east_m, turned_rad))
        turn_rad = sum(each.turn_rad for each in corrections)
        if self._building is not None:
            self._building.turn(turn_rad)
        return Correction(turn_rad, sum(each.variance_rad2 for each in corrections))

    def _by_field(self, stride: Stride, frame_turn_rad: float) -> Correction:
        if self._since_place_m < PLACE_M or not self._fields:
            return NO_CORRECTION
        near = [ut for time_ns, ut in self._fields if abs(time_ns - stride.end_ns) <= STANCE_NS]
        if not near:
            return NO_CORRECTION
        self._since_place_m = 0.0
        level_from_sensor = np.array(
            to_matrix(multiply(about_down(frame_turn_rad), stride.nav_from_body))
        )
        north_ut, east_ut, down_ut = (level_from_sensor @ np.mean(near, axis=0)).tolist()
        if not self._gate.admits((north_ut, east_ut, down_ut)):
            return NO_CORRECTION
        self._catch_up()
        return self._drift.observe_field(np.array([north_ut, east_ut]), level_from_sensor[:2])

    def _by_building(self, north_m: float, east_m: float, frame_turn_rad: float) -> Correction:
        if self._building is None:
            return NO_CORRECTION
        c, s = math.cos(frame_turn_rad), math.sin(frame_turn_rad)
        off = self._building.add(c * north_m - s * east_m, s * north_m + c * east_m)
        if off is None:
            return NO_CORRECTION
        self._catch_up()
        if off.found_sd_rad is not None:
            self._drift.reckon_direction(off.found_sd_rad)
        return self._drift.observe_direction(off.off_rad, PIECE_SD_RAD)

    def _catch_up(self) -> None:
        """Bring the filter up to the stride in hand."""
        if self._elapsed_s:
            self._drift.predict(self._elapsed_s, self._turned_rad2, self._walked_m)
        self._elapsed_s = self._turned_rad2 = self._walked_m = 0.0
