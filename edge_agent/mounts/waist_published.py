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
from edge_agent.inertial.velocity_high_pass import HighPassedVelocity
from edge_agent.mounts.interface import Increment
from edge_agent.mounts.published_steps import PublishedSteps
from shared.messages import ImuSample
from shared.units import NS_PER_S

LONGEST_STEP_S = 1.5
"""A strike as late as this after the last is the first of a walk: it has no period."""

FIRST_STEP_NS = round(0.3 * NS_PER_S)


class PublishedWaistMount(PublishedSteps):
    """Follows one unit, worn x ahead and z down. A step is told 0.3 s after its strike."""

    def __init__(self, step_scale: float = 1.0) -> None:
        super().__init__(step_scale, needs_gyro=True)
        self._stop = MomentaryStop()
        self._velocity = HighPassedVelocity()
        self._strikes = FootStrikes()
        self._selection = GyroOrCompass()
        self._compass_read = False
        self._struck_ns: int | None = None
        self._slowest_m_s = self._fastest_m_s = 0.0

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

    def _restart(self) -> None:
        self._strikes, self._struck_ns = FootStrikes(), None
        self._velocity.stop()

    def _take(self, sample: ImuSample, since_s: float) -> Increment | None:
        self._turn(sample, since_s)
        self._stop.step(sample.force_m_s2, since_s)
        gravity_m_s2 = self._stop.gravity_m_s2
        if gravity_m_s2 is None:
            return None
        if self._stop.stopped:
            self._velocity.stop()
        else:
            self._velocity.step(sample.force_m_s2[0] - gravity_m_s2[0], since_s)
        self._slowest_m_s = min(self._slowest_m_s, self._velocity.velocity_m_s)
        self._fastest_m_s = max(self._fastest_m_s, self._velocity.velocity_m_s)
        # Up is −z.
        struck_ns = self._strikes.step(sample.time_ns, gravity_m_s2[2] - sample.force_m_s2[2])
        return None if struck_ns is None else self._strike(struck_ns)

    def _turn(self, sample: ImuSample, since_s: float) -> None:
        compass_rad = None
        if sample.field_ut is not None:
            ahead_ut, right_ut, _ = sample.field_ut
            compass_rad = math.atan2(-right_ut, ahead_ut)
            self._compass_read = True
        self._selection.step(sample.rate_rad_s[2], compass_rad, since_s)

    def _strike(self, struck_ns: int) -> Increment:
        """End a step at a strike; the first of a walk has no period, and no length."""
        last_ns, self._struck_ns = self._struck_ns, struck_ns
        speed_m_s = self._fastest_m_s - self._slowest_m_s
        self._slowest_m_s = self._fastest_m_s = self._velocity.velocity_m_s
        if last_ns is None or struck_ns - last_ns >= LONGEST_STEP_S * NS_PER_S:
            started_ns, length_m = struck_ns - FIRST_STEP_NS, 0.0
        else:
            started_ns, length_m = last_ns, speed_m_s * (struck_ns - last_ns) / NS_PER_S
        return self._ahead(Step(started_ns, struck_ns, 0.0, 0.0), length_m)
