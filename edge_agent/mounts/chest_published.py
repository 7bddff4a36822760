"""A phone at the chest or in the hand, as published: an increment a step.

"A study on smartphone indoor navigation technology using extended Kalman filter": steps by an
adaptive threshold, Weinberg's length, heading by an extended Kalman filter. The heading is that of
the phone; which way it is held to the walk is taken not to change, and the gyro to have no bias.
"""

from __future__ import annotations

import math

from edge_agent.inertial.attitude_ekf import AttitudeEkf
from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD
from edge_agent.inertial.step_detection import AdaptiveThreshold, Step
from edge_agent.inertial.step_length import weinberg_m
from edge_agent.inertial.stride_error import heading_variance
from edge_agent.mounts.intake import Intake, Verdict, has_gyro
from edge_agent.mounts.interface import Faults, Increment
from edge_agent.mounts.step_increment import Direction, step_ahead, step_anywhere
from edge_agent.sources.recording import Recording
from shared.maths.angles import wrap_rad
from shared.messages import ImuSample
from shared.units import NS_PER_S

LONGEST_GAP_S = 0.5
"""Over a longer one nobody knows how often the wearer stepped, nor how they turned."""


class PublishedChestMount:
    """Follows one phone. See ``Mount``: nothing that a sample holds makes it raise."""

    def __init__(self) -> None:
        self.faults = Faults()
        self._intake = Intake(self.faults, LONGEST_GAP_S, needs_gyro=False)
        self._threshold = AdaptiveThreshold()
        self._filter: AttitudeEkf | None = None
        self._last: ImuSample | None = None
        self._told_heading_rad = 0.0
        self._told_ns: int | None = None

    @property
    def ready(self) -> bool:
        """Whether a sample has come: the paper asks for no more."""
        return self._last is not None

    @property
    def heading_rad(self) -> float:
        """How the phone faces, from 0 at first."""
        return 0.0 if self._filter is None else self._filter.yaw_rad

    @property
    def heading_sd_rad(self) -> float:
        """Nothing tells it: the paper begins at 0."""
        return UNKNOWN_HEADING_SD_RAD

    @property
    def worn(self) -> None:
        """Nothing: how the phone is held is taken not to matter."""
        return

    def step(self, sample: ImuSample) -> Increment | None:
        """Take in the next sample; return the step that it completes, if it does."""
        verdict = self._intake.judge(sample)
        if verdict is Verdict.PASS:
            return None
        last, self._last = self._last, sample
        since_s = 0.0 if last is None else (sample.time_ns - last.time_ns) / NS_PER_S
        if verdict is Verdict.RESTART or since_s > LONGEST_GAP_S:
            self._threshold = AdaptiveThreshold()
            since_s = 0.0
        self._turn(sample, since_s)
        step = self._threshold.step(sample.time_ns, math.hypot(*sample.force_m_s2))
        return None if step is None else self._increment(step)

    def steps(self, samples: Recording) -> list[Increment]:
        """Take in samples in order; return the steps that they complete."""
        return [told for sample in samples if (told := self.step(sample)) is not None]

    def finish(self) -> list[Increment]:
        """Return nothing: a step is told as it ends."""
        return []

    def _turn(self, sample: ImuSample, since_s: float) -> None:
        if not has_gyro(sample):
            return
        if self._filter is None:
            self._filter = AttitudeEkf(sample.force_m_s2)
        self._filter.predict(sample.rate_rad_s, since_s)
        self._filter.correct(sample.force_m_s2)

    def _increment(self, step: Step) -> Increment:
        heading_rad = self.heading_rad
        d_heading_rad = wrap_rad(heading_rad - self._told_heading_rad)
        since_ns = step.start_time_ns if self._told_ns is None else self._told_ns
        elapsed_s = max(0.0, (step.end_time_ns - since_ns) / NS_PER_S)
        self._told_heading_rad, self._told_ns = heading_rad, step.end_time_ns
        length_m = weinberg_m(step.highest_m_s2, step.lowest_m_s2)
        if self._filter is None:
            return step_anywhere(step, length_m)
        variance_rad2 = heading_variance(elapsed_s, 0.0, bias_known=False)
        direction = Direction(heading_rad, d_heading_rad, variance_rad2)
        return step_ahead(step, length_m, direction)
