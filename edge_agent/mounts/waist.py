"""A unit on the belt, worn any way round: an increment a step.

Which way is up is found by gravity, whatever size the sensor reads of it, which way is ahead by
how the wearer walks. A step is a landing (see ``inertial/landings.py``), as long as a pendulum
that bounces so (see ``inertial/pendulum_step.py``), and leads where the gyro has turned since. It
is told as soon as the trunk falls again; the first ones of all are held back until they say which
way is ahead. The agent's frame is north-east-down by the magnetometer, if there is one to be
trusted while the wearer first stands; without, its north is where the first steps lead.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from edge_agent.inertial.butterworth import LowPass
from edge_agent.inertial.closing_step import ClosingStep
from edge_agent.inertial.even_samples import EVEN_RATE_HZ, EvenSample, EvenSamples
from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD, Heading, MagneticHeading
from edge_agent.inertial.landings import Landing, LandingDetector, LandingSettings
from edge_agent.inertial.pendulum_step import PendulumSteps
from edge_agent.inertial.step_detection import Step
from edge_agent.inertial.straight_walk import StraightWalk
from edge_agent.inertial.stride_error import heading_variance, lost_covariance
from edge_agent.inertial.trunk_attitude import WEAKEST_GRAVITY_M_S2, TrunkAttitude
from edge_agent.inertial.walk_bridge import WalkBridge
from edge_agent.inertial.walking_direction import WalkingDirection, heading_of_mean
from edge_agent.mounts.intake import STUCK_S, Intake, Verdict
from edge_agent.mounts.interface import Faults, Increment
from edge_agent.mounts.step_increment import Direction, step_ahead
from edge_agent.sources.recording import Recording
from shared.maths.angles import wrap_rad
from shared.maths.rotations import UP, Quaternion, Vector3, angle_between_rad, inverse, rotate
from shared.messages import ImuSample
from shared.units import NS_PER_S

BOUNCE_CUTOFF_HZ = 8.0
"""What is faster is the unit's shaking on its belt."""

GAP_S = 0.1
LONGEST_GAP_S = 1.25
"""Nobody knows how often the wearer stepped in a longer one, nor how they turned."""

STANDS_S = 0.5
"""Of samples, until it is known which way is up."""

KNOWN_AFTER_STEPS = 4
"""So many steps say which way is ahead, and those before them as well."""

AHEAD_SD_RAD = 0.17
"""How well ahead is known then. It is held: what steps tell of it later differs by a degree or two,
which would bend a straight way. A unit that seems to be turned by more than this has slipped."""

STANDARD_GRAVITY_M_S2 = 9.81


ATTITUDE_EVERY = 5
"""Of even samples: a step leads along the mean of how the trunk faces, which turns to and fro."""


class _Moment(NamedTuple):
    """The bounce at an even sample, and the attitude."""

    time_ns: int
    up_m_s2: float
    nav_from_sensor: Quaternion


class _Step(NamedTuple):
    """A step whose direction may not be known yet, and some attitudes of its, the last at its end.

    ``turn_rad2`` is the variance of the turn in the ``since_s`` since the step before ended.
    """

    step: Step
    length_m: float
    nav_from_sensor: list[Quaternion]
    since_s: float
    turn_rad2: float


class WaistMount:
    """Follows one unit on a belt. See ``Mount``: nothing that a sample holds makes it raise."""

    def __init__(self, settings: LandingSettings | None = None, *, step_scale: float = 1.0) -> None:
        self.faults = Faults()
        self._step_scale = step_scale
        self._settings = settings or LandingSettings()
        self._intake = Intake(self.faults, GAP_S, stuck_s=STUCK_S)
        self._bridge = WalkBridge(LONGEST_GAP_S)
        self._even = EvenSamples()
        self._attitude = TrunkAttitude()
        self._ahead = WalkingDirection(EVEN_RATE_HZ)
        self._ahead_held: Vector3 = (0.0, 0.0, 0.0)
        self._compass = MagneticHeading()
        self._frame: Heading | None = None
        self._frame_turn_rad = 0.0
        self._straight: StraightWalk | None = None
        self._landings = LandingDetector(EVEN_RATE_HZ, self._settings)
        self._closing = ClosingStep(EVEN_RATE_HZ)
        self._bounce = LowPass(BOUNCE_CUTOFF_HZ, EVEN_RATE_HZ)
        self._lengths = PendulumSteps()
        self._moments: deque[_Moment] = deque()
        self._last_ns: int | None = None
        self._landed_ns: int | None = None
        self._heading_rad = 0.0
        self._told_ns: int | None = None
        self._stood_s = 0.0
        self._gap_s = 0.0
        self._waiting: list[_Step] = []
        self._done: deque[Increment] = deque()

    @property
    def ready(self) -> bool:
        """Whether it is known which way is up."""
        return self._stood_s >= STANDS_S

    @property
    def heading_rad(self) -> float:
        """Where the last step led, and the wearer faces."""
        return self._heading_rad

    @property
    def heading_sd_rad(self) -> float:
        """How well north was known at setting out."""
        return self._compass.offset().sd_rad if self._frame is None else self._frame.sd_rad

    @property
    def worn(self) -> str | None:
        """Which way the unit is turned to the wearer; ``None`` until they have walked."""
        if self._ahead.steps < KNOWN_AFTER_STEPS:
            return None
        axes = dict(zip("xyz", self._ahead.ahead, strict=True))
        axis = max(axes, key=lambda name: abs(axes[name]))
        return f"Unit on the belt: its {'+' if axes[axis] > 0.0 else '-'}{axis} side is ahead"

    def step(self, sample: ImuSample) -> Increment | None:
        """Take in the next sample; return the step that it completes, if it does."""
        verdict = self._intake.judge(sample)
        if verdict is not Verdict.PASS:
            restarted = verdict is Verdict.RESTART
            self._note_gap(sample, restarted=restarted)
            for one in self._bridge.take(sample, restart=restarted):
                for even in self._even.step(one):
                    self._follow(even)
            if self._frame is None and sample.field_ut is not None and not self._waiting:
                self._compass.add(rotate(self._attitude.nav_from_sensor, sample.field_ut))
        return self._done.popleft() if self._done else None

    def steps(self, samples: Recording) -> list[Increment]:
        """Take in samples in order; return the steps that they complete."""
        return [told for sample in samples if (told := self.step(sample)) is not None]

    def finish(self) -> list[Increment]:
        """Return the steps that were still being waited for: no more samples will come."""
        self._tell_waiting()
        done, self._done = list(self._done), deque()
        return done

    def _note_gap(self, sample: ImuSample, *, restarted: bool) -> None:
        """Bridge a short gap; over a long one, and where time was set back, the way is lost."""
        last_ns, self._last_ns = self._last_ns, sample.time_ns
        if last_ns is None:
            return
        since_s = (sample.time_ns - last_ns) / NS_PER_S
        if since_s > GAP_S:
            self._gap_s += since_s
        if not restarted and since_s <= LONGEST_GAP_S:
            return
        self._tell_waiting()
        if not restarted and self.ready:
            self._lose(last_ns, sample.time_ns)
        self._even.restart()
        self._landings = LandingDetector(EVEN_RATE_HZ, self._settings)
        self._closing = ClosingStep(EVEN_RATE_HZ)
        self._bounce = LowPass(BOUNCE_CUTOFF_HZ, EVEN_RATE_HZ)
        self._moments.clear()
        self._ahead.pause()
        self._landed_ns = None

    def _lose(self, from_ns: int, until_ns: int) -> None:
        elapsed_s = (until_ns - from_ns) / NS_PER_S
        variance_rad2 = heading_variance(elapsed_s, elapsed_s, bias_known=False)
        covariance = lost_covariance(elapsed_s, variance_rad2)
        lost = Increment(
            from_ns, until_ns, (0.0, 0.0, 0.0), 0.0, self._heading_rad, covariance, (), steps=0
        )
        self._done.append(lost)
        self._told_ns, self._gap_s = until_ns, 0.0

    def _follow(self, even: EvenSample) -> None:
        """Carry the state on to the next even sample."""
        period_s = 1.0 / EVEN_RATE_HZ
        level_m_s2 = self._attitude.step(even.force_m_s2, even.rate_rad_s, period_s)
        gravity_m_s2 = self._attitude.gravity_m_s2
        if gravity_m_s2 < WEAKEST_GRAVITY_M_S2:
            return
        self._stood_s += period_s
        if not self.ready:
            return
        # Up is −z. A sensor that reads too much of gravity reads too much of all.
        scale = STANDARD_GRAVITY_M_S2 / gravity_m_s2
        up_m_s2 = (-level_m_s2[2] - gravity_m_s2) * scale
        nav_from_sensor = self._attitude.nav_from_sensor
        self._ahead.step(even.force_m_s2, rotate(inverse(nav_from_sensor), UP))
        moment = _Moment(even.time_ns, self._bounce.step(up_m_s2), nav_from_sensor)
        self._moments.append(moment)
        landing = self._landings.step(even.time_ns, up_m_s2)
        if landing is not None:
            self._land(landing)
        north_m_s2, east_m_s2, _ = level_m_s2
        closed_ns = self._closing.step(
            even.time_ns, (scale * north_m_s2, scale * east_m_s2, up_m_s2)
        )
        if closed_ns is not None:
            self._end_step(closed_ns)
        longest_ns = self._settings.longest_step_s * NS_PER_S
        if even.time_ns - self._moments[0].time_ns > 2.0 * longest_ns:
            self._moments.popleft()

    def _land(self, landing: Landing) -> None:
        """End a step at a landing; at the first of a walk, there is none to end."""
        if self._landed_ns is not None and landing.time_ns <= self._landed_ns:
            return
        if landing.setting_out or self._landed_ns is None:
            self._ahead.pause()
            self._pass(landing.time_ns)
            return
        self._ahead.land()
        self._end_step(landing.time_ns)
        self._closing.land(landing.time_ns)

    def _pass(self, time_ns: int) -> list[_Moment]:
        """Take a foot to have landed; return the moments up to then, which count no more."""
        self._landed_ns = time_ns
        passed = [moment for moment in self._moments if moment.time_ns <= time_ns]
        for _ in passed:
            self._moments.popleft()
        return passed

    def _end_step(self, time_ns: int) -> None:
        """Tell, or keep waiting, the step from the landing before until ``time_ns``."""
        started_ns = time_ns if self._landed_ns is None else self._landed_ns
        passed = self._pass(time_ns)
        lasted_s = (time_ns - started_ns) / NS_PER_S
        step = Step(started_ns, time_ns, 0.0, 0.0)
        bounces_m_s2 = [moment.up_m_s2 for moment in passed]
        length_m = self._step_scale * self._lengths.length_m(lasted_s, bounces_m_s2)
        attitudes = [moment.nav_from_sensor for moment in passed[::-ATTITUDE_EVERY]][::-1]
        since_ns = started_ns if self._told_ns is None else self._told_ns
        since_s = (time_ns - since_ns) / NS_PER_S
        self._waiting.append(
            _Step(step, length_m, attitudes, since_s, self._turn_variance(since_s))
        )
        self._told_ns, self._gap_s = time_ns, 0.0
        if self._ahead.steps >= KNOWN_AFTER_STEPS:
            self._tell_waiting()

    def _tell_waiting(self) -> None:
        """Tell the steps that have waited, by what is known now of which way is ahead."""
        for waiting in self._waiting:
            self._done.append(self._increment(waiting))
        self._waiting = []

    def _increment(self, waiting: _Step) -> Increment:
        ahead_in_sensor = self._held_ahead()
        ahead = [rotate(attitude, ahead_in_sensor) for attitude in waiting.nav_from_sensor]
        course_rad = heading_of_mean(ahead)
        if self._frame is None:
            self._frame = self._frame_by(course_rad)
            self._frame_turn_rad = self._frame.heading_rad
            self._heading_rad = wrap_rad(heading_of_mean(ahead[-1:]) + self._frame_turn_rad)
        course_rad = self._corrected(waiting, wrap_rad(course_rad + self._frame_turn_rad))
        heading_rad = wrap_rad(heading_of_mean(ahead[-1:]) + self._frame_turn_rad)
        d_heading_rad = wrap_rad(heading_rad - self._heading_rad)
        self._heading_rad = heading_rad
        direction = Direction(
            heading_rad, d_heading_rad, waiting.turn_rad2, course_rad, AHEAD_SD_RAD
        )
        return step_ahead(waiting.step, waiting.length_m, direction)

    def _held_ahead(self) -> Vector3:
        """Return ahead in the sensor's axes, as it was first known unless the unit has slipped."""
        ahead, held = self._ahead.ahead, self._ahead_held
        if not any(held) or (any(ahead) and angle_between_rad(ahead, held) > AHEAD_SD_RAD):
            self._ahead_held = ahead
        return self._ahead_held

    def _corrected(self, waiting: _Step, course_rad: float) -> float:
        """Return the course of a step without what the gyro is found to have drifted."""
        if self._straight is None:
            self._straight = StraightWalk(self._attitude.bias.sd_rad_s)
        told = self._straight.take(course_rad, waiting.since_s, waiting.turn_rad2, waiting.length_m)
        self._frame_turn_rad = wrap_rad(self._frame_turn_rad + told.turn_rad)
        return wrap_rad(course_rad + told.turn_rad)

    def _turn_variance(self, elapsed_s: float) -> float:
        """Return the variance of what the gyro tells of a turn."""
        drifted_rad = self._attitude.bias.sd_rad_s * elapsed_s
        return drifted_rad**2 + heading_variance(elapsed_s, self._gap_s, bias_known=True)

    def _frame_by(self, first_rad: float) -> Heading:
        """Return what turns the level frame into the agent's."""
        offset = self._compass.offset()
        if offset.sd_rad == UNKNOWN_HEADING_SD_RAD:
            return Heading(-first_rad, UNKNOWN_HEADING_SD_RAD)
        return offset
