"""A unit on the belt as published: an increment a step.

"Gait information and pedestrian localisation with a 3-axis accelerometer", a gyro of one axis and
a compass. A step ends at a foot strike; its period is the time since the last, its length speed
times period. The speed of a step is read "from the compensated velocity": as that has no mean left
(see ``inertial/velocity_high_pass.py``), it is taken as the range through which velocity swings
within the step, which at least grows with speed. The unit is worn x ahead and z down, as
``mounts/upright.py`` sees to by quarters of a turn; which of the two ways x then leads is not
asked, nor does tilt turn anything but by the gravity taken away.
"""

from __future__ import annotations

import math

from edge_agent.inertial.foot_strikes import FootStrikes
from edge_agent.inertial.gyro_or_compass import GyroOrCompass
from edge_agent.inertial.heading import MAGNETIC_HEADING_SD_RAD, UNKNOWN_HEADING_SD_RAD
from edge_agent.inertial.momentary_stop import MomentaryStop
from edge_agent.inertial.step_detection import Step
from edge_agent.inertial.stride_error import heading_variance
from edge_agent.inertial.velocity_high_pass import HighPassedVelocity
from edge_agent.mounts.intake import Intake, Verdict
from edge_agent.mounts.interface import Faults, Increment
from edge_agent.mounts.step_increment import Direction, step_ahead
from edge_agent.sources.recording import Recording
from shared.maths.angles import wrap_rad
from shared.messages import ImuSample
from shared.units import NS_PER_S

LONGEST_GAP_S = 0.5
LONGEST_STEP_S = 1.5
"""A strike as late as this after the last is the first of a walk: it has no period."""

FIRST_STEP_NS = round(0.3 * NS_PER_S)


class PublishedWaistMount:
    """Follows one unit, worn x ahead and z down. See ``Mount``: nothing in a sample makes it raise.

    ``finish`` gives nothing: a strike is told 0.3 s after it was.
    """

    def __init__(self) -> None:
        self.faults = Faults()
        self._intake = Intake(self.faults, LONGEST_GAP_S)
        self._stop = MomentaryStop()
        self._velocity = HighPassedVelocity()
        self._strikes = FootStrikes()
        self._selection = GyroOrCompass()
        self._compass_read = False
        self._last_ns: int | None = None
        self._struck_ns: int | None = None
        self._slowest_m_s = self._fastest_m_s = 0.0
        self._told_heading_rad = 0.0
        self._told_ns: int | None = None

    @property
    def ready(self) -> bool:
        """Whether the unit has been at rest once, so that gravity is known."""
        return self._stop.gravity_m_s2 is not None

    @property
    def heading_rad(self) -> float:
        """How the unit faces."""
        return self._selection.heading_rad

    @property
    def heading_sd_rad(self) -> float:
        """That of a compass, if there is one."""
        return MAGNETIC_HEADING_SD_RAD if self._compass_read else UNKNOWN_HEADING_SD_RAD

    @property
    def worn(self) -> None:
        """Nothing: this method takes the unit to be worn as it asks for."""
        return

    def step(self, sample: ImuSample) -> Increment | None:
        """Take in the next sample; return the step that it completes, if it does."""
        verdict = self._intake.judge(sample)
        if verdict is Verdict.PASS:
            return None
        last_ns, self._last_ns = self._last_ns, sample.time_ns
        period_s = 0.0 if last_ns is None else (sample.time_ns - last_ns) / NS_PER_S
        if verdict is Verdict.RESTART or period_s > LONGEST_GAP_S:
            self._strikes, self._struck_ns, period_s = FootStrikes(), None, 0.0
            self._velocity.stop()
        self._turn(sample, period_s)
        self._stop.step(sample.force_m_s2, period_s)
        gravity_m_s2 = self._stop.gravity_m_s2
        if gravity_m_s2 is None:
            return None
        if self._stop.stopped:
            self._velocity.stop()
        else:
            self._velocity.step(sample.force_m_s2[0] - gravity_m_s2[0], period_s)
        self._slowest_m_s = min(self._slowest_m_s, self._velocity.velocity_m_s)
        self._fastest_m_s = max(self._fastest_m_s, self._velocity.velocity_m_s)
        # Up is −z.
        struck_ns = self._strikes.step(sample.time_ns, gravity_m_s2[2] - sample.force_m_s2[2])
        return None if struck_ns is None else self._strike(struck_ns)

    def steps(self, samples: Recording) -> list[Increment]:
        """Take in samples in order; return the steps that they complete."""
        return [told for sample in samples if (told := self.step(sample)) is not None]

    def finish(self) -> list[Increment]:
        """Return nothing more."""
        return []

    def _turn(self, sample: ImuSample, period_s: float) -> None:
        compass_rad = None
        if sample.field_ut is not None:
            ahead_ut, right_ut, _ = sample.field_ut
            compass_rad = math.atan2(-right_ut, ahead_ut)
            self._compass_read = True
        self._selection.step(sample.rate_rad_s[2], compass_rad, period_s)

    def _strike(self, struck_ns: int) -> Increment:
        """End a step at a strike; the first of a walk has no period, and no length."""
        last_ns, self._struck_ns = self._struck_ns, struck_ns
        speed_m_s = self._fastest_m_s - self._slowest_m_s
        self._slowest_m_s = self._fastest_m_s = self._velocity.velocity_m_s
        if last_ns is None or struck_ns - last_ns >= LONGEST_STEP_S * NS_PER_S:
            started_ns, length_m = struck_ns - FIRST_STEP_NS, 0.0
        else:
            started_ns, length_m = last_ns, speed_m_s * (struck_ns - last_ns) / NS_PER_S
        since_ns = started_ns if self._told_ns is None else self._told_ns
        elapsed_s = (struck_ns - since_ns) / NS_PER_S
        heading_rad = self.heading_rad
        d_heading_rad = wrap_rad(heading_rad - self._told_heading_rad)
        self._told_heading_rad, self._told_ns = heading_rad, struck_ns
        variance_rad2 = heading_variance(elapsed_s, 0.0, bias_known=False)
        direction = Direction(heading_rad, d_heading_rad, variance_rad2)
        return step_ahead(Step(started_ns, struck_ns, 0.0, 0.0), length_m, direction)
