"""The sensor on a boot: an increment a stride, by an error-state filter smoothed over each stride.

Strides come from ``inertial/boot_tracker.py``, at most half a second after the stance that ends
them. The sensor may be worn on any side of the boot and at any angle. The frame is north-east-down
by the magnetometer, if there is one to be trusted; without, its north is where the first stride
leads, so that nothing told depends on how the sensor is worn. How the wearer faces is learnt from
their strides (see ``inertial/wearing.py``).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from edge_agent.inertial.boot_state import LOST, STANDING, STRIDE, Stride
from edge_agent.inertial.boot_tracker import BootTracker
from edge_agent.inertial.eskf_parameters import CAPACITY, EskfParameters
from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD, Heading, MagneticHeading
from edge_agent.inertial.heading_aid import HeadingAid
from edge_agent.inertial.height_filter import HeightFilter
from edge_agent.inertial.linear_zupt import PathPoint
from edge_agent.inertial.stride_error import (
    STILL_SD_M,
    Covariance4,
    heading_variance,
    lost_covariance,
)
from edge_agent.inertial.stride_path import StridePath
from edge_agent.inertial.wearing import Wearing
from edge_agent.mounts.interface import Faults, Increment
from edge_agent.sources.recording import Recording
from shared.maths.angles import wrap_rad
from shared.maths.rotations import Vector3, heading_of, rotate
from shared.messages import ImuSample
from shared.units import NS_PER_S

SHUFFLED_M = 0.05
"""Standing, less than this is kept for the next stride: a boot at rest only trembles."""

SHORTEST_LOST_S = 1.0
"""So long the boot is lost at the least: a clock set back does not say for how long it was."""


class EskfBootMount:
    """Follows one boot. See ``Mount``: nothing that a sample holds makes it raise.

    Samples repeated, late, missing or out of range are put right by the tracker, as far as they
    can be. *Standing* tells nothing: what the boot turned or trembled meanwhile is in the next
    increment. *Lost*, over a gap that cannot be bridged or where the filter went astray: the
    increment has no displacement but the covariance of a walk whose direction is not known. With a
    barometer, height is weighed against it, and *standing* in a lift is told about every second.
    """

    def __init__(
        self, parameters: EskfParameters | None = None, *, dominant_direction: bool = False
    ) -> None:
        """Make the mount; the first of a process compiles its kernels, or reads them from disk.

        ``dominant_direction``: correct the heading by the building's (see ``HeadingAid``).
        """
        self._tracker = BootTracker(parameters)
        self._counted = self._tracker.counts
        self.faults = Faults()
        self._compass = MagneticHeading()
        self._fields: deque[tuple[int, Vector3]] = deque(maxlen=CAPACITY)
        self._start: Heading | None = None
        self._wearing = Wearing()
        self._ahead_rad = 0.0
        self._frame_turn_rad = 0.0
        self._tracker_heading_rad = 0.0
        self._heading_rad = 0.0
        self._stood_m: Vector3 = (0.0, 0.0, 0.0)
        self._stood_rad2 = 0.0
        self._done: deque[Increment] = deque()
        self._height = HeightFilter()
        self._heading_aid = HeadingAid(dominant_direction=dominant_direction)

    @property
    def ready(self) -> bool:
        """Whether a stretch of samples has been seen to level on."""
        return self._tracker.filtered_ns is not None

    @property
    def heading_rad(self) -> float:
        """How the wearer faces at the end of the last increment; before the first, the sensor."""
        if self._start is None:
            return self._heading_to_start_with().heading_rad
        return self._heading_rad

    @property
    def heading_sd_rad(self) -> float:
        """How well the heading is known at setting out, or was."""
        return (self._start or self._heading_to_start_with()).sd_rad

    @property
    def worn(self) -> str | None:
        """How the sensor is worn, in words; ``None`` until gait has told."""
        return self._wearing.words()

    def step(self, sample: ImuSample) -> Increment | None:
        """Take in the next sample; return the movement that it completes, if it does."""
        self._face()
        self._height.take(sample)
        self._heading_aid.read(sample)
        self._follow(self._tracker.step(sample))
        if self._start is None:
            self._ask_compass(sample)
        return self._done.popleft() if self._done else None

    def steps(self, samples: Recording) -> list[Increment]:
        """Take in samples in order; return the movements that they complete."""
        told: list[Increment] = []
        samples = samples.in_rows()
        row = 0
        while row < len(samples):
            compass_asked = self._start is None and samples.field_ut is not None
            if compass_asked or samples.pressure_pa is not None:
                increment = self.step(samples.sample(row))
                told += [] if increment is None else [increment]
                row += 1
                continue
            self._face()
            after, strides = self._tracker.step_rows(samples, row)
            # Each sample gives one movement at the most: those before the last, what was held.
            told += [self._done.popleft() for _ in range(min(after - row - 1, len(self._done)))]
            self._heading_aid.read_rows(samples, row, after)
            self._follow(strides)
            told += [self._done.popleft()] if self._done else []
            row = after
        return told

    def finish(self) -> list[Increment]:
        """Return the movements that were still being waited for: no more samples will come."""
        self._follow(self._tracker.finish())
        done, self._done = list(self._done), deque()
        return done

    def _face(self) -> None:
        """Note how the sensor faces where the boot stands, until it sets out."""
        if self._start is None:
            self._ahead_rad = heading_of(self._tracker.stance_nav_from_body)

    def _follow(self, strides: Sequence[Stride]) -> None:
        """Tell strides, or keep them; and what was amiss with the samples."""
        for stride in strides:
            self._take_stride(self._height.correct(stride))
            self._keep_heading(stride)
        counts = self._tracker.counts
        if counts is self._counted:
            return
        self._counted = counts
        self.faults.unusable = counts.implausible
        self.faults.out_of_order = counts.repeated + counts.late_mended + counts.late_dropped
        self.faults.gaps = counts.gaps
        self.faults.restarts = counts.restarts

    def _ask_compass(self, sample: ImuSample) -> None:
        """Take in the fields of samples that the filter has come to, if the boot stands there."""
        if sample.field_ut is not None and all(map(math.isfinite, sample.field_ut)):
            self._fields.append((sample.time_ns, sample.field_ut))
        filtered_ns = self._tracker.filtered_ns
        while filtered_ns is not None and self._fields and self._fields[0][0] <= filtered_ns:
            _, field_ut = self._fields.popleft()
            if self._tracker.stands:
                self._compass.add(rotate(self._tracker.nav_from_body, field_ut))

    def _heading_to_start_with(self) -> Heading:
        offset = self._compass.offset()
        if offset.sd_rad == UNKNOWN_HEADING_SD_RAD:
            return offset
        return Heading(wrap_rad(self._ahead_rad + offset.heading_rad), offset.sd_rad)

    def _take_stride(self, stride: Stride) -> None:
        """Tell a stride, or keep what is too little to tell."""
        if self._start is None:
            if stride.kind == STANDING and not stride.carried_down_m:
                return
            self._set_off(stride)
        if stride.kind == LOST:
            self._done.append(self._lost(stride))
            return
        north_m, east_m, down_m = self._stood_m
        d_north_m, d_east_m, d_down_m = stride.displacement_m
        moved_m = (north_m + d_north_m, east_m + d_east_m, down_m + d_down_m)
        if stride.kind == STANDING and stride.carried_down_m:
            self._done.append(self._carried(stride))
            return
        if stride.kind == STANDING and math.hypot(*moved_m) < SHUFFLED_M:
            self._stood_m = moved_m
            self._stood_rad2 += stride.covariance[3][3]
            return
        if stride.kind == STRIDE:
            self._wearing.add(
                stride.displacement_m,
                stride.lean,
                stride.heading_rad,
                stride.heading_change_rad,
                stride.nav_from_body,
            )
        self._done.append(self._moved(stride))

    def _set_off(self, stride: Stride) -> None:
        """Fix the frame that increments are told in: the boot has moved for the first time."""
        self._start = self._heading_to_start_with()
        if self._start.sd_rad == UNKNOWN_HEADING_SD_RAD:
            north_m, east_m, _ = stride.displacement_m
            self._frame_turn_rad = -math.atan2(east_m, north_m)
        else:
            self._frame_turn_rad = self._start.heading_rad - self._ahead_rad
        self._tracker_heading_rad = stride.heading_rad - stride.heading_change_rad
        self._fields.clear()

    def _keep_heading(self, stride: Stride) -> None:
        """Turn what comes after ``stride`` by what its end tells of the heading's drift."""
        if self._start is None:
            return
        correction = self._heading_aid.take(stride, self._frame_turn_rad)
        self._frame_turn_rad += correction.turn_rad
        self._tracker_heading_rad -= correction.turn_rad
        self._stood_rad2 += correction.variance_rad2

    def _lost(self, stride: Stride) -> Increment:
        elapsed_s = max((stride.end_ns - stride.start_ns) / NS_PER_S, SHORTEST_LOST_S)
        variance_rad2 = heading_variance(elapsed_s, elapsed_s, bias_known=True)
        covariance = lost_covariance(elapsed_s, variance_rad2)
        if stride.covariance[2][2] > 0.0:  # The barometer did not lose it.
            covariance = (*covariance[:7], stride.covariance[2][2], *covariance[8:])
        return self._told(stride, stride.displacement_m, covariance, ())

    def _carried(self, stride: Stride) -> Increment:
        """Tell what a lift carried; where the boot stood and trembled is kept for later."""
        north_m, east_m, stood_down_m = self._stood_m
        down_m = stood_down_m + stride.displacement_m[2]
        path_m = np.zeros_like(stride.path.position_m)
        path_m[:, 2] = stood_down_m + stride.path.position_m[:, 2]
        still_m2, turned_rad2 = STILL_SD_M**2, self._stood_rad2 + stride.covariance[3][3]
        covariance = (
            still_m2, 0.0, 0.0, 0.0, still_m2, 0.0, 0.0, stride.covariance[2][2], 0.0, turned_rad2,
        )  # fmt: skip
        path = StridePath(stride.path.time_ns, path_m)
        told = self._told(stride, (0.0, 0.0, down_m), covariance, path)
        self._stood_m = (north_m, east_m, 0.0)
        return told

    def _moved(self, stride: Stride) -> Increment:
        c, s = math.cos(self._frame_turn_rad), math.sin(self._frame_turn_rad)
        position_m = stride.path.position_m + self._stood_m
        north, east = position_m[:, 0].copy(), position_m[:, 1].copy()
        position_m[:, 0], position_m[:, 1] = c * north - s * east, s * north + c * east
        north_m, east_m, down_m = position_m[-1].tolist()
        path = StridePath(stride.path.time_ns, position_m)
        covariance = agent_covariance(stride, self._stood_rad2, self._frame_turn_rad)
        return self._told(stride, (north_m, east_m, down_m), covariance, path)

    def _told(
        self,
        stride: Stride,
        displacement_m: Vector3,
        covariance: Covariance4,
        path: Sequence[PathPoint],
    ) -> Increment:
        turned_rad = stride.heading_rad - self._tracker_heading_rad
        self._tracker_heading_rad = stride.heading_rad
        facing = self._wearing.facing
        self._heading_rad = wrap_rad(stride.heading_rad + facing.offset_rad + self._frame_turn_rad)
        self._stood_m, self._stood_rad2 = (0.0, 0.0, 0.0), 0.0
        return Increment(
            stride.start_ns,
            stride.end_ns,
            displacement_m,
            wrap_rad(turned_rad),
            self._heading_rad,
            covariance,
            path,
            stride.carried_down_m,
            facing.sd_rad,
        )


def agent_covariance(stride: Stride, stood_rad2: float, frame_turn_rad: float) -> Covariance4:
    """Return the covariance of ``stride`` in the frame turned by ``frame_turn_rad``.

    A stride is told given the heading at its start; ``stood_rad2`` is the variance of what was
    turned since the last increment's end, and turns the whole stride.
    """
    north_m, east_m, _ = stride.displacement_m
    lever = (-east_m, north_m, 0.0, 1.0)
    (nn, ne, nd, nh), (_, ee, ed, eh), (_, _, dd, dh), (_, _, _, hh) = (
        [entry + stood_rad2 * a * b for entry, b in zip(row, lever, strict=True)]
        for row, a in zip(stride.covariance, lever, strict=True)
    )
    c, s = math.cos(frame_turn_rad), math.sin(frame_turn_rad)
    return (
        c * c * nn - 2.0 * c * s * ne + s * s * ee,
        c * s * (nn - ee) + (c * c - s * s) * ne,
        c * nd - s * ed,
        c * nh - s * eh,
        s * s * nn + 2.0 * c * s * ne + c * c * ee,
        s * nd + c * ed,
        s * nh + c * eh,
        dd,
        dh,
        hh,
    )
