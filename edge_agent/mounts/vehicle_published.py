"""A phone in a vehicle, as published: levelled by gravity when it slips, its x axis integrated.

As in "Dynamic coordinate correction algorithm based on gravity vector analysis for vehicle speed
estimation". Gravity tells roll and pitch alone: the phone's x axis is taken to point forward. The
paper has no heading; the gyroscope's rate about the vertical is added up here, as fusion asks for.
"""

from __future__ import annotations

import math
from collections import deque

from edge_agent.inertial.gravity_alignment import GravityAlignment
from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD
from edge_agent.inertial.stride_error import heading_variance
from edge_agent.mounts.drive_increment import Drive, drive_increments
from edge_agent.mounts.intake import Intake, Verdict
from edge_agent.mounts.interface import Faults, Increment
from edge_agent.sources.recording import Recording
from shared.maths.angles import wrap_rad
from shared.maths.rotations import Vector3
from shared.messages import ImuSample
from shared.units import NS_PER_S

TOLD_EVERY_S = 1.0
GAP_S = 0.1
LONGEST_GAP_S = 1.0
"""Over a longer gap speed is held, and the level found anew."""

STANDS_M_S2 = 0.1
STANDS_S = 1.0
"""Zero-velocity update: the magnitude of specific force has deviated by less, for so long."""

ACCELERATION_SD_M_S2 = 0.3
"""What a level taken in one moment leaves: it adds up over time."""


class PublishedVehicleMount:
    """Follows one vehicle. See ``Mount``: nothing that a sample holds makes it raise.

    Without :meth:`know_speed` the vehicle is taken to stand at first.
    """

    def __init__(self) -> None:
        self.faults = Faults()
        self.speed_m_s = 0.0
        self.acceleration_m_s2: Vector3 | None = None
        self.heading_rad = 0.0
        self._intake = Intake(self.faults, GAP_S)
        self._alignment = GravityAlignment()
        self._magnitudes: deque[tuple[float, float]] = deque()
        self._last: ImuSample | None = None
        self._since_stood_s = 0.0
        self._north_m = self._east_m = 0.0
        self._told_ns: int | None = None
        self._told_heading_rad = 0.0
        self._done: deque[Increment] = deque()

    @property
    def ready(self) -> bool:
        """Whether gravity has been found."""
        return self._alignment.gravity_m_s2 > 0.0

    @property
    def heading_sd_rad(self) -> float:
        """Nothing tells it: the paper has no heading."""
        return UNKNOWN_HEADING_SD_RAD

    @property
    def worn(self) -> None:
        """Nothing: how the phone lies is found, but not told."""
        return

    def know_speed(self, speed_m_s: float, sd_m_s: float) -> None:  # noqa: ARG002
        """Take over a speed that somebody knows at this moment, as it is."""
        self.speed_m_s = speed_m_s
        self._since_stood_s = 0.0

    def step(self, sample: ImuSample) -> Increment | None:
        """Take in the next sample; return the movement that it completes, if it does."""
        verdict = self._intake.judge(sample)
        if verdict is not Verdict.PASS:
            last, self._last = self._last, sample
            lasted_s = 0.0 if last is None else (sample.time_ns - last.time_ns) / NS_PER_S
            if verdict is Verdict.RESTART or lasted_s > LONGEST_GAP_S:
                self._restart(sample.time_ns)
                lasted_s = 0.0
            self._follow(sample, lasted_s)
        return self._done.popleft() if self._done else None

    def steps(self, samples: Recording) -> list[Increment]:
        """Take in samples in order; return the movements that they complete."""
        return [told for sample in samples if (told := self.step(sample)) is not None]

    def finish(self) -> list[Increment]:
        """Return the movements not yet told: no more samples will come."""
        if self._last is not None and self._told_ns is not None:
            self._tell(self._last.time_ns)
        done, self._done = list(self._done), deque()
        return done

    def _restart(self, time_ns: int) -> None:
        self._alignment = GravityAlignment()
        self._magnitudes.clear()
        self._told_ns = time_ns
        self._north_m = self._east_m = 0.0

    def _follow(self, sample: ImuSample, lasted_s: float) -> None:
        time_s = sample.time_ns / NS_PER_S
        if self._told_ns is None:
            self._told_ns = sample.time_ns
        self._alignment.step(time_s, sample.force_m_s2, lasted_s)
        if not self.ready:
            return
        forward, right, down = self._alignment.level(sample.force_m_s2)
        self.acceleration_m_s2 = (forward, right, down + self._alignment.gravity_m_s2)
        self.heading_rad = wrap_rad(
            self.heading_rad + self._alignment.level(sample.rate_rad_s)[2] * lasted_s
        )
        self.speed_m_s += forward * lasted_s
        self._since_stood_s += lasted_s
        if self._stands(time_s, sample.force_m_s2):
            self.speed_m_s = 0.0
            self._since_stood_s = 0.0
        self._north_m += self.speed_m_s * math.cos(self.heading_rad) * lasted_s
        self._east_m += self.speed_m_s * math.sin(self.heading_rad) * lasted_s
        if sample.time_ns - self._told_ns >= TOLD_EVERY_S * NS_PER_S:
            self._tell(sample.time_ns)

    def _stands(self, time_s: float, force_m_s2: Vector3) -> bool:
        """Whether the magnitude of specific force has hardly deviated for a second."""
        window = self._magnitudes
        window.append((time_s, math.hypot(*force_m_s2)))
        if time_s - window[0][0] < STANDS_S:
            return False
        while time_s - window[0][0] > STANDS_S:
            window.popleft()
        mean_m_s2 = sum(one for _, one in window) / len(window)
        variance = sum((one - mean_m_s2) ** 2 for _, one in window) / len(window)
        return variance < STANDS_M_S2**2

    def _tell(self, now_ns: int) -> None:
        start_ns, self._told_ns = self._told_ns or now_ns, now_ns
        lasted_s = (now_ns - start_ns) / NS_PER_S
        turned_rad = wrap_rad(self.heading_rad - self._told_heading_rad)
        drive = Drive(
            start_ns,
            now_ns,
            self._north_m,
            self._east_m,
            turned_rad,
            self.heading_rad,
            ACCELERATION_SD_M_S2 * self._since_stood_s,
            heading_variance(lasted_s, 0.0, bias_known=False),
            UNKNOWN_HEADING_SD_RAD,
        )
        self._told_heading_rad = self.heading_rad
        self._north_m = self._east_m = 0.0
        self._done.extend(drive_increments(drive))
