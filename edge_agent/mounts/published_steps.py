"""What the published methods of chest and waist have in common: samples in, single steps out."""

from __future__ import annotations

from abc import ABC, abstractmethod

from edge_agent.inertial.step_detection import Step
from edge_agent.inertial.stride_error import heading_variance
from edge_agent.mounts.intake import Intake, Verdict
from edge_agent.mounts.interface import Faults, Increment
from edge_agent.mounts.step_increment import Direction, step_ahead
from edge_agent.sources.recording import Recording
from shared.maths.angles import wrap_rad
from shared.messages import ImuSample
from shared.units import NS_PER_S

LONGEST_GAP_S = 0.5
"""Over a longer one nobody knows how often the wearer stepped, nor how they turned."""


class PublishedSteps(ABC):
    """Follows one wearer. See ``Mount``: nothing that a sample holds makes it raise.

    A step is told as it ends, so that ``finish`` has none; how the sensor is worn is not found out.
    """

    def __init__(self, step_scale: float, *, needs_gyro: bool) -> None:
        self.faults = Faults()
        self._step_scale = step_scale
        self._intake = Intake(self.faults, LONGEST_GAP_S, needs_gyro=needs_gyro)
        self._last_ns: int | None = None
        self._told_heading_rad = 0.0
        self._told_ns: int | None = None

    @property
    @abstractmethod
    def heading_rad(self) -> float:
        """How the sensor faces."""

    @property
    def worn(self) -> None:
        """Nothing: the papers take it to be known."""
        return

    def step(self, sample: ImuSample) -> Increment | None:
        """Take in the next sample; return the step that it completes, if it does."""
        verdict = self._intake.judge(sample)
        if verdict is Verdict.PASS:
            return None
        last_ns, self._last_ns = self._last_ns, sample.time_ns
        since_s = 0.0 if last_ns is None else (sample.time_ns - last_ns) / NS_PER_S
        if verdict is Verdict.RESTART or since_s > LONGEST_GAP_S:
            self._restart()
            since_s = 0.0
        return self._take(sample, since_s)

    def steps(self, samples: Recording) -> list[Increment]:
        """Take in samples in order; return the steps that they complete."""
        return [told for sample in samples if (told := self.step(sample)) is not None]

    def finish(self) -> list[Increment]:
        """Return nothing more."""
        return []

    @abstractmethod
    def _restart(self) -> None:
        """Forget the step in hand: what led to it was not read."""

    @abstractmethod
    def _take(self, sample: ImuSample, since_s: float) -> Increment | None:
        """Take in a sample, ``since_s`` after the last, 0 if none is near."""

    def _ahead(self, step: Step, length_m: float) -> Increment:
        """Return a step that leads where the sensor has faced in the middle of it."""
        heading_rad = self.heading_rad
        d_heading_rad = wrap_rad(heading_rad - self._told_heading_rad)
        since_ns = step.start_time_ns if self._told_ns is None else self._told_ns
        elapsed_s = max(0.0, (step.end_time_ns - since_ns) / NS_PER_S)
        self._told_heading_rad, self._told_ns = heading_rad, step.end_time_ns
        variance_rad2 = heading_variance(elapsed_s, 0.0, bias_known=False)
        direction = Direction(heading_rad, d_heading_rad, variance_rad2)
        return step_ahead(step, self._step_scale * length_m, direction)
