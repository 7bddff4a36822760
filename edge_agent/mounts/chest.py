"""A phone at the chest or in the hand: an increment a step, some 0.4 s after it has ended.

Steps are bounces of the body (``inertial/bounce_detection.py``), as long as they are hard; they
lead where the phone turns to (``inertial/held_heading.py``). How it is held to the walk is taken to
stay: when a hand turns it, the way turns too, and the covariance allows for a little of that. A
scale of the wearer's own is left to whoever fuses the way with places known.
"""

from __future__ import annotations

import math
from collections import deque

from edge_agent.inertial.bounce_detection import Bounce, BounceDetector, BounceSettings
from edge_agent.inertial.held_heading import HeldHeading
from edge_agent.inertial.step_length import bounce_length_m
from edge_agent.inertial.stride_error import heading_variance, lost_covariance
from edge_agent.inertial.walk_bridge import WalkBridge
from edge_agent.mounts.intake import STUCK_S, Intake, Verdict, has_gyro
from edge_agent.mounts.interface import Faults, Increment
from edge_agent.mounts.step_increment import Direction, step_ahead, step_anywhere
from edge_agent.sources.recording import Recording
from shared.maths.angles import wrap_rad
from shared.messages import ImuSample
from shared.units import NS_PER_S

LONGEST_GAP_S = 0.5
"""Over a longer one nobody knows how often the wearer stepped, nor how they turned."""

LONGEST_BRIDGE_S = 1.25
"""So long whoever walks evenly is taken to go on."""

RESTARTED_S = 1.0
"""So long the wearer is lost at the least where a clock was set back."""

HEADINGS_S = 8.0
"""Headings are kept for so long: the two longest steps and what a window delays them by."""


class ChestMount:
    """Follows one phone. See ``Mount``: nothing that a sample holds makes it raise.

    Without a gyroscope steps are counted, and told as leading anywhere. *Lost*, over a gap in the
    samples: the increment has no displacement but the covariance of a walk whose direction is not
    known.
    """

    def __init__(self, settings: BounceSettings | None = None, *, step_scale: float = 1.0) -> None:
        self.faults = Faults()
        self._step_scale = step_scale
        self._settings = settings or BounceSettings()
        self._tick_ns = round(NS_PER_S / self._settings.rate_hz)
        self._intake = Intake(self.faults, LONGEST_GAP_S, needs_gyro=False, stuck_s=STUCK_S)
        self._bridge = WalkBridge(LONGEST_BRIDGE_S)
        self._gap_s = 0.0
        self._detector = BounceDetector(self._settings)
        self._heading = HeldHeading()
        self._headings: deque[tuple[int, float]] = deque(
            maxlen=int(HEADINGS_S * self._settings.rate_hz)
        )
        self._last: ImuSample | None = None
        self._next_tick_ns = 0
        self._told_ns: int | None = None
        self._told_heading_rad = 0.0
        self._done: deque[Increment] = deque()

    @property
    def ready(self) -> bool:
        """Whether it is known which way is up; without a gyroscope nobody asks."""
        return self._heading.settled or (self._last is not None and not has_gyro(self._last))

    @property
    def heading_rad(self) -> float:
        """How the wearer faces, as the phone is held."""
        return self._heading.heading_rad

    @property
    def heading_sd_rad(self) -> float:
        """How well the heading was known as the wearer set out."""
        return self._heading.start_sd_rad

    @property
    def worn(self) -> None:
        """Nothing: how the phone is held is not found out."""
        return

    def step(self, sample: ImuSample) -> Increment | None:
        """Take in the next sample; return the movement that it completes, if it does."""
        verdict = self._intake.judge(sample)
        if verdict is not Verdict.PASS:
            restart = verdict is Verdict.RESTART
            filled = self._bridge.take(sample, restart=restart)
            if len(filled) > 1 and self._last is not None:
                self._gap_s += (sample.time_ns - self._last.time_ns) / NS_PER_S
            for one in filled:
                self._take(one, restart=restart)
        return self._done.popleft() if self._done else None

    def steps(self, samples: Recording) -> list[Increment]:
        """Take in samples in order; return the movements that they complete."""
        return [told for sample in samples if (told := self.step(sample)) is not None]

    def finish(self) -> list[Increment]:
        """Return the movements that were still being waited for: no more samples will come."""
        for bounce in self._detector.finish():
            self._tell(bounce)
        done, self._done = list(self._done), deque()
        return done

    def _take(self, sample: ImuSample, *, restart: bool) -> None:
        last, self._last = self._last, sample
        since_s = 0.0 if last is None else (sample.time_ns - last.time_ns) / NS_PER_S
        if last is None or restart or since_s > LONGEST_GAP_S:
            self._break_off(sample, RESTARTED_S if restart else since_s)
            last, since_s = None, 0.0
        if has_gyro(sample):
            self._heading.take(sample, since_s)
        else:
            # Nobody knows how the wearer turned meanwhile.
            self._gap_s += since_s
        force_m_s2 = math.hypot(*sample.force_m_s2)
        before_m_s2 = force_m_s2 if last is None else math.hypot(*last.force_m_s2)
        before_ns = sample.time_ns if last is None else last.time_ns
        while self._next_tick_ns <= sample.time_ns:
            share = (self._next_tick_ns - before_ns) / max(1, sample.time_ns - before_ns)
            self._headings.append((self._next_tick_ns, self._heading.heading_rad))
            at_m_s2 = before_m_s2 + share * (force_m_s2 - before_m_s2)
            for bounce in self._detector.step(self._next_tick_ns, at_m_s2):
                self._tell(bounce)
            self._next_tick_ns += self._tick_ns

    def _break_off(self, sample: ImuSample, lost_s: float) -> None:
        """Begin anew at ``sample``; whoever was followed before is lost for ``lost_s``."""
        for bounce in self._detector.finish():
            self._tell(bounce)
        self._detector = BounceDetector(self._settings)
        self._headings.clear()
        self._next_tick_ns = sample.time_ns
        if self._told_ns is not None:
            covariance = lost_covariance(lost_s, self._turn_variance(lost_s, lost_s))
            start_ns = sample.time_ns - round(lost_s * NS_PER_S)
            self._done.append(
                Increment(
                    start_ns, sample.time_ns, (0.0, 0.0, 0.0), 0.0, self._told_heading_rad,
                    covariance, (), steps=0,
                )
            )  # fmt: skip
            self._told_ns = sample.time_ns

    def _tell(self, bounce: Bounce) -> None:
        """Tell a step; nothing before what was told last."""
        if self._told_ns is not None:
            bounce = bounce._replace(start_time_ns=max(bounce.start_time_ns, self._told_ns))
        length_m = self._step_scale * bounce_length_m(bounce.mean_m_s2)
        if not self._heading.settled:
            self._done.append(step_anywhere(bounce, length_m))
            self._told_ns = bounce.end_time_ns
            return
        self._heading.set_out()
        heading_rad = self._mean_heading_rad(bounce)
        if self._told_ns is None:
            self._told_heading_rad = heading_rad
        since_ns = bounce.start_time_ns if self._told_ns is None else self._told_ns
        elapsed_s = max(0.0, (bounce.end_time_ns - since_ns) / NS_PER_S)
        d_heading_rad = wrap_rad(heading_rad - self._told_heading_rad)
        variance_rad2 = self._turn_variance(elapsed_s, self._gap_s)
        self._gap_s = 0.0
        direction = Direction(heading_rad, d_heading_rad, variance_rad2, heading_rad)
        self._done.append(step_ahead(bounce, length_m, direction))
        self._told_ns, self._told_heading_rad = bounce.end_time_ns, heading_rad

    def _turn_variance(self, elapsed_s: float, gap_s: float = 0.0) -> float:
        drifted_rad2 = (self._heading.bias_sd_rad_s * elapsed_s) ** 2
        return drifted_rad2 + heading_variance(elapsed_s, gap_s, bias_known=True)

    def _mean_heading_rad(self, bounce: Bounce) -> float:
        """Return the mean heading over a step, in which the trunk turns to and fro."""
        during = [
            heading_rad
            for time_ns, heading_rad in self._headings
            if bounce.start_time_ns <= time_ns <= bounce.end_time_ns
        ]
        if not during:
            return self._heading.heading_rad
        return math.atan2(sum(map(math.sin, during)), sum(map(math.cos, during)))
