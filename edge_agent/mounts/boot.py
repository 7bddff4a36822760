"""The sensor on a boot: an increment a stride, by linear calibration at zero velocity.

A stride is told ``StanceSettings.delay_s`` (0.225 s) after it has ended. Standing still tells
nothing: there is no increment until the boot has moved, and what turned meanwhile is in the
next one's heading change.

The sensor is worn z down, as ``mounts/upright.py`` makes sure; that x is forward, stance detection
hardly asks. The heading told is the sensor's.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from edge_agent.inertial.gyro_bias import GyroBias
from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD, Heading, MagneticHeading
from edge_agent.inertial.linear_zupt import Stride, Swing
from edge_agent.inertial.stance import StanceDetector, StanceSettings
from edge_agent.inertial.strapdown import Strapdown
from edge_agent.inertial.stride_error import (
    heading_variance,
    lost_covariance,
    stride_covariance,
)
from edge_agent.mounts.intake import Intake, Verdict
from edge_agent.mounts.interface import Faults, Increment
from edge_agent.sources.recording import Recording
from shared.maths.angles import wrap_rad
from shared.maths.rotations import heading_of, rotate
from shared.messages import ImuSample
from shared.units import NS_PER_S


class BootSettings(NamedTuple):
    """What may be set about a boot. ``stance`` is the detector's."""

    stance: StanceSettings = StanceSettings()
    longest_swing_s: float = 10.0
    """After so long without a stance, double integration tells nothing more: the boot is lost."""

    longest_gap_s: float = 1.0
    """Samples further apart cannot be bridged: the boot is lost between them."""

    top_speed_m_s: float = 8.0
    """A stride at a higher mean speed is no stride: the boot is lost over it."""


class BootMount:
    """Follows one boot. See ``Mount``: nothing that a sample holds makes it raise.

    *Repeated or backward time stamps*: the sample is passed over and counted; after
    ``RESTART_AFTER`` of them running the new time is believed, and the boot is lost in between.
    *Gaps* up to ``longest_gap_s`` are bridged by the mean of both ends and widen the covariance.
    *Lost*: the increment has no displacement but the covariance of a walk whose direction is not
    known, so that who fuses it knows that the responder may be anywhere around.
    """

    def __init__(self, settings: BootSettings | None = None) -> None:
        self.faults = Faults()
        self._settings = settings or BootSettings()
        self._intake = Intake(self.faults, self._settings.stance.gap_s)
        self._detector = StanceDetector(self._settings.stance)
        self._strapdown = Strapdown()
        self._bias = GyroBias()
        self._compass = MagneticHeading()
        self._start_heading: Heading | None = None
        self._last: ImuSample | None = None
        self._moved_from_ns: int | None = None
        self._swing: Swing | None = None
        self._gap_s = 0.0
        self._told_heading_rad = 0.0
        self._done: deque[Increment] = deque()

    @property
    def ready(self) -> bool:
        """Whether the boot has stood once, so that it is known which way is up."""
        return self._strapdown.gravity_m_s2 > 0.0

    @property
    def heading_rad(self) -> float:
        """Heading at the last sample decided upon; that of setting out, before."""
        if self._start_heading is None:
            return self._heading_to_start_with().heading_rad
        return heading_of(self._strapdown.nav_from_body)

    @property
    def heading_sd_rad(self) -> float:
        """How well the heading is known at setting out, or was."""
        return (self._start_heading or self._heading_to_start_with()).sd_rad

    @property
    def worn(self) -> None:
        """Nothing: this method takes the sensor to be worn as it asks for."""
        return

    def step(self, sample: ImuSample) -> Increment | None:
        """Take in the next sample; return the movement that it completes, if it does."""
        verdict = self._intake.judge(sample)
        if verdict is Verdict.RESTART:
            self._restart(sample.time_ns)
        if verdict is not Verdict.PASS:
            for decided, stance in self._detector.step(sample):
                self._follow(decided, stance=stance)
        return self._done.popleft() if self._done else None

    def steps(self, samples: Recording) -> list[Increment]:
        """Take in samples in order; return the movements that they complete."""
        return [told for sample in samples if (told := self.step(sample)) is not None]

    def finish(self) -> list[Increment]:
        """Return the movements that were still being waited for: no more samples will come."""
        for decided, stance in self._detector.finish():
            self._follow(decided, stance=stance)
        done, self._done = list(self._done), deque()
        return done

    def _restart(self, time_ns: int) -> None:
        """Begin a new time line; attitude is kept, but what happened in between is not known."""
        self._detector = StanceDetector(self._settings.stance)
        self._last = None
        self._swing = None
        self._gap_s = math.inf
        if self.ready:
            self._moved_from_ns = time_ns

    def _follow(self, sample: ImuSample, *, stance: bool) -> None:
        """Carry the state on to ``sample``, the next one decided upon."""
        last, self._last = self._last or sample, sample
        since_s = (sample.time_ns - last.time_ns) / NS_PER_S
        if self.ready:
            if not stance and self._moved_from_ns is None:
                self._set_off(last)
            self._turn(last, sample, since_s)
            if self._swing is not None:
                force_m_s2 = rotate(self._strapdown.nav_from_body, sample.force_m_s2)
                self._swing.add(sample.time_ns, force_m_s2)
            if self._moved_from_ns is not None:
                self._tell_if_due(self._moved_from_ns, sample.time_ns, stance=stance)
        if stance:
            self._stand(sample, since_s)

    def _set_off(self, last: ImuSample) -> None:
        """Begin a swing at ``last``, the last sample of the stance."""
        if self._start_heading is None:
            # The boot has not moved yet: what turned the frame until now is the gyro's bias.
            self._start_heading = self._heading_to_start_with()
            self._strapdown.face(self._start_heading.heading_rad)
            self._told_heading_rad = self._start_heading.heading_rad
        force_m_s2 = rotate(self._strapdown.nav_from_body, last.force_m_s2)
        self._swing = Swing(last.time_ns, force_m_s2, self._strapdown.gravity_m_s2)
        self._moved_from_ns = last.time_ns
        self._strapdown.begin_stance()
        self._bias.interrupt()

    def _heading_to_start_with(self) -> Heading:
        offset = self._compass.offset()
        if offset.sd_rad == UNKNOWN_HEADING_SD_RAD:
            return offset
        heading_rad = heading_of(self._strapdown.nav_from_body) + offset.heading_rad
        return Heading(wrap_rad(heading_rad), offset.sd_rad)

    def _turn(self, last: ImuSample, sample: ImuSample, since_s: float) -> None:
        """Carry attitude on; where too many samples are missing, give the swing up."""
        if since_s > self._settings.stance.gap_s:
            self._gap_s += since_s
        if since_s > self._settings.longest_gap_s:
            self._swing = None
            return
        ax, ay, az = last.rate_rad_s
        bx, by, bz = sample.rate_rad_s
        ox, oy, oz = self._bias.bias_rad_s
        mean_rad_s = (0.5 * (ax + bx) - ox, 0.5 * (ay + by) - oy, 0.5 * (az + bz) - oz)
        self._strapdown.turn(mean_rad_s, since_s)

    def _stand(self, sample: ImuSample, since_s: float) -> None:
        """Use a sample of a stance: level, and learn the gyro's bias and the first heading."""
        self._strapdown.level(sample.force_m_s2, since_s)
        self._bias.add(sample.rate_rad_s, since_s)
        if self._start_heading is None and sample.field_ut is not None:
            self._compass.add(rotate(self._strapdown.nav_from_body, sample.field_ut))

    def _tell_if_due(self, from_ns: int, now_ns: int, *, stance: bool) -> None:
        """Tell the movement that a stance has ended, or that has lasted too long to be a swing."""
        too_long = (now_ns - from_ns) / NS_PER_S >= self._settings.longest_swing_s
        if not stance and not too_long:
            return
        stride = self._swing.close() if self._swing is not None and stance else None
        self._done.append(self._increment(from_ns, now_ns, stride))
        self._swing = None
        self._moved_from_ns = None if stance else now_ns

    def _increment(self, from_ns: int, now_ns: int, stride: Stride | None) -> Increment:
        elapsed_s = (now_ns - from_ns) / NS_PER_S
        variance_rad2 = heading_variance(elapsed_s, self._gap_s, bias_known=self._bias.known)
        heading_rad = self.heading_rad
        d_heading_rad = wrap_rad(heading_rad - self._told_heading_rad)
        if stride is None or not self._is_plausible(stride):
            stride = None
            covariance = lost_covariance(elapsed_s, variance_rad2)
        else:
            covariance = stride_covariance(stride, self._gap_s, variance_rad2)
        self._told_heading_rad = heading_rad
        self._gap_s = 0.0
        return Increment(
            from_ns,
            now_ns,
            stride.displacement_m if stride else (0.0, 0.0, 0.0),
            d_heading_rad,
            heading_rad,
            covariance,
            stride.path if stride else (),
        )

    def _is_plausible(self, stride: Stride) -> bool:
        farthest_m = self._settings.top_speed_m_s * stride.duration_s
        return math.hypot(*stride.displacement_m) <= farthest_m
