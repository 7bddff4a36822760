"""A phone in a vehicle, lying any way round: speed by inertia and by the road, heading by gyro.

What the published method leaves to future work, and what it takes for granted: attitude is carried
by the gyroscope, so that slopes, turns and braking are not taken for a slip; which way is forward
is found; and the road itself tells speed (``inertial/wheelbase_echo.py``), so that it does not
drift. The first seconds of motion are kept until forward is known, and told then.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from edge_agent.inertial.forward_axis import AXIS_SD_RAD
from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD
from edge_agent.inertial.standstill import Standstill
from edge_agent.inertial.stride_error import (
    LARGEST_VARIANCE_M2,
    LOST_CLIMB_M_S,
    heading_variance,
)
from edge_agent.inertial.vehicle_filter import VehicleFilter
from edge_agent.inertial.vehicle_start import (
    UNKNOWN_SPEED_M_S,
    Fix,
    Known,
    KnownSpeed,
    Reading,
    Stood,
    first_force,
    start,
)
from edge_agent.inertial.vehicle_tracker import Second, VehicleTracker
from edge_agent.mounts.drive_increment import Drive, drive_increments
from edge_agent.mounts.intake import Intake, Verdict
from edge_agent.mounts.interface import Faults, Increment
from edge_agent.mounts.lone_spikes import LoneSpikes
from edge_agent.mounts.steady_samples import SteadySamples
from edge_agent.sources.recording import Recording
from shared.maths.angles import wrap_rad
from shared.maths.rotations import Vector3, angle_between_rad, rotate
from shared.messages import ImuSample
from shared.units import NS_PER_S

WHEELBASE_M = 2.7
"""Of most cars, give or take 5 %. An engine has 3.5 to 5 m, and has to be told."""

SETTLED_S = 5.2
"""So long has to be driven until forward is told."""

SHORTEST_S = 2.0
"""So long at the least, where a recording ends."""

STOOD_S = 1.0
GAP_S = 0.1
LONGEST_GAP_S = 1.0
GAP_ACCELERATION_M_S2 = 1.5
"""After a longer gap tracking begins anew, with a speed that has changed by so much a second."""

LONGEST_BRIDGE_S = 10.0
"""Over no longer gap the vehicle is taken to go on as before."""

STUCK_S = 0.25
"""A sensor in a vehicle trembles; one that reads the same for longer has stopped to read."""

FASTEST_M_S = 40.0
"""Over a longer one it goes no faster in the mean."""

DOWN: Vector3 = (0.0, 0.0, 1.0)

WEAKEST_GRAVITY_M_S2 = 4.0
"""A mean force weaker than that is no start: the phone falls, or its accelerometer is broken."""


class VehicleMount:
    """Follows one vehicle. See ``Mount``: nothing that a sample holds makes it raise.

    ``wheelbase_m`` is the vehicle's. Standing tells nothing. Where a speed is known, say so by
    :meth:`know_speed`; a start from rest is seen, and any other speed is found from the road.
    """

    def __init__(self, wheelbase_m: float = WHEELBASE_M) -> None:
        self.faults = Faults()
        self.acceleration_m_s2: Vector3 | None = None
        self._wheelbase_m = wheelbase_m
        self._spikes = LoneSpikes(self.faults)
        self._intake = Intake(self.faults, GAP_S, stuck_s=STUCK_S)
        self._steady = SteadySamples(())
        self._known: KnownSpeed | None = None
        self._stood: Stood | None = None
        self._waiting: list[ImuSample] = []
        self._fixes: list[tuple[int, KnownSpeed]] = []
        self._judged = 0
        self._tracker: VehicleTracker | None = None
        self._last_ns: int | None = None
        self._origin_ns = 0
        self._heading_rad = 0.0
        self._frame_rad = 0.0
        self._forward_sd_rad = AXIS_SD_RAD
        self._worn: str | None = None
        self._done: deque[Increment] = deque()

    @property
    def ready(self) -> bool:
        """Whether the vehicle has stood, or forward is known."""
        return self._stood is not None or self._tracker is not None

    @property
    def heading_rad(self) -> float:
        """How the vehicle heads, from 0 at first."""
        return self._heading_rad

    @property
    def heading_sd_rad(self) -> float:
        """Nothing tells where it heads at first."""
        return UNKNOWN_HEADING_SD_RAD

    @property
    def worn(self) -> str | None:
        """How the phone lay at the start, in words; ``None`` until forward is known."""
        return self._worn

    @property
    def speed_m_s(self) -> float:
        """The speed by now: what was told of it, or is usual, until forward is known."""
        if self._tracker is not None:
            return self._tracker.filter.speed_m_s
        if self._stood is not None:
            return 0.0
        return UNKNOWN_SPEED_M_S if self._known is None else self._known.speed_m_s

    def know_speed(self, speed_m_s: float, sd_m_s: float) -> None:
        """Take in a speed that somebody knows at this moment: a satellite fix's, for one."""
        if self._tracker is None:
            known = KnownSpeed(speed_m_s, sd_m_s)
            if self._waiting:
                self._fixes.append((self._waiting[-1].time_ns, known))
            else:
                self._known = known
            return
        self._tracker.know_speed(speed_m_s, sd_m_s)

    def step(self, sample: ImuSample) -> Increment | None:
        """Take in the next sample; return the movement that it completes, if it does."""
        for one in self._spikes.take(sample):
            self._judge(one)
        return self._done.popleft() if self._done else None

    def _judge(self, sample: ImuSample) -> None:
        verdict = self._intake.judge(sample)
        if verdict is not Verdict.PASS:
            last_ns, self._last_ns = self._last_ns, sample.time_ns
            gap_s = 0.0 if last_ns is None else (sample.time_ns - last_ns) / NS_PER_S
            if verdict is Verdict.RESTART or gap_s > LONGEST_GAP_S:
                self._tell_pending()
                if last_ns is not None and LONGEST_GAP_S < gap_s <= LONGEST_BRIDGE_S:
                    self._bridge(last_ns, sample.time_ns)
                elif last_ns is not None and gap_s > LONGEST_BRIDGE_S:
                    self._lose(last_ns, sample.time_ns)
                self._begin_anew(max(gap_s, LONGEST_GAP_S))
            self._take(sample)

    def steps(self, samples: Recording) -> list[Increment]:
        """Take in samples in order; return the movements that they complete."""
        return [told for sample in samples if (told := self.step(sample)) is not None]

    def finish(self) -> list[Increment]:
        """Return the movements not yet told: no more samples will come."""
        for one in self._spikes.finish():
            self._judge(one)
        self._tell_pending()
        done, self._done = list(self._done), deque()
        return done

    def _tell_pending(self) -> None:
        """Tell what can be told of the samples that have come."""
        if self._tracker is None and self._waited_s() >= SHORTEST_S:
            self._set_out()
        if self._tracker is not None and self._tracker.begun:
            self._tell(self._tracker.tick())

    def _take(self, sample: ImuSample) -> None:
        if self._tracker is None:
            self._waiting.append(sample)
            self._drop_standing()
            if self._waited_s() >= SETTLED_S:
                self._set_out()
            return
        motion = self._tracker.step(*self._reading(self._steady.take(sample)))
        self.acceleration_m_s2 = motion.acceleration_m_s2
        if self._tracker.due():
            self._tell(self._tracker.tick())

    def _waited_s(self) -> float:
        if not self._waiting:
            return 0.0
        return (self._waiting[-1].time_ns - self._waiting[0].time_ns) / NS_PER_S

    def _drop_standing(self) -> None:
        """Look at each second as it is over: of one in which it stood, keep but the end."""
        newest_ns = self._waiting[-1].time_ns
        second = self._waiting[self._judged :]
        if newest_ns - second[0].time_ns < STOOD_S * NS_PER_S:
            return
        self._judged = len(self._waiting)
        force_m_s2 = np.array([one.force_m_s2 for one in second])
        rate_rad_s = np.array([one.rate_rad_s for one in second])
        if not Standstill().stands(force_m_s2, rate_rad_s):
            return
        fx, fy, fz = force_m_s2.mean(axis=0).tolist()
        wx, wy, wz = rate_rad_s.mean(axis=0).tolist()
        if math.hypot(fx, fy, fz) < WEAKEST_GRAVITY_M_S2:
            return
        self._stood = Stood((fx, fy, fz), (wx, wy, wz))
        self._waiting = self._waiting[-1:]
        self._fixes = []
        self._judged = 1

    def _set_out(self) -> None:
        """Begin to track at the first of the samples kept, if there is gravity in them."""
        waiting, self._waiting, self._judged = self._waiting, [], 0
        fixes, self._fixes = self._fixes, []
        self._origin_ns = waiting[0].time_ns
        self._steady = SteadySamples([one.time_ns for one in waiting])
        readings = [self._reading(self._steady.take(one)) for one in waiting]
        if self._stood is None and math.hypot(*first_force(readings)) < WEAKEST_GRAVITY_M_S2:
            return
        told = tuple(Fix(self._since_s(time_ns), speed) for time_ns, speed in fixes)
        begun = start(readings, Known(self._wheelbase_m, self._known, self._stood, told))
        self._tracker = begun.tracker
        self._frame_rad = self._heading_rad
        self._forward_sd_rad = AXIS_SD_RAD
        self._worn = _words(begun.tracker.filter)
        for second in begun.told:
            self._tell(second)

    def _reading(self, sample: ImuSample) -> Reading:
        return Reading(self._since_s(sample.time_ns), sample.force_m_s2, sample.rate_rad_s)

    def _since_s(self, time_ns: int) -> float:
        return (time_ns - self._origin_ns) / NS_PER_S

    def _tell(self, second: Second) -> None:
        heading_rad = wrap_rad(self._frame_rad + second.heading_rad)
        turned_rad = wrap_rad(heading_rad - self._heading_rad - math.pi * second.turned_round)
        found_rad2 = second.forward_sd_rad**2 - self._forward_sd_rad**2
        c, s = math.cos(self._frame_rad), math.sin(self._frame_rad)
        drive = Drive(
            self._origin_ns + round(second.begin_s * NS_PER_S),
            self._origin_ns + round(second.end_s * NS_PER_S),
            c * second.north_m - s * second.east_m,
            s * second.north_m + c * second.east_m,
            turned_rad,
            heading_rad,
            second.speed_sd_m_s,
            max(found_rad2, heading_variance(second.lasted_s, 0.0, bias_known=True)),
            min(second.forward_sd_rad, UNKNOWN_HEADING_SD_RAD),
        )
        self._heading_rad, self._forward_sd_rad = heading_rad, second.forward_sd_rad
        if not second.stood:
            self._done.extend(drive_increments(drive))

    def _bridge(self, last_ns: int, until_ns: int) -> None:
        """Tell the way over a gap, straight on at the speed before it, if that was known."""
        speed = self._speed_before()
        if speed is None:
            return
        from_ns = self._waiting[0].time_ns if self._waiting else last_ns
        lasted_s = (until_ns - from_ns) / NS_PER_S
        way_m = speed.speed_m_s * lasted_s
        drive = Drive(
            from_ns,
            until_ns,
            way_m * math.cos(self._heading_rad),
            way_m * math.sin(self._heading_rad),
            0.0,
            self._heading_rad,
            math.hypot(speed.sd_m_s, 0.5 * GAP_ACCELERATION_M_S2 * lasted_s),
            heading_variance(lasted_s, lasted_s, bias_known=True),
            min(self._forward_sd_rad, UNKNOWN_HEADING_SD_RAD),
        )
        self._done.extend(drive_increments(drive))

    def _lose(self, last_ns: int, until_ns: int) -> None:
        """Tell of a gap that nobody knows the way over, if the vehicle was not known to stand."""
        speed = self._speed_before()
        if speed is None:
            return
        from_ns = self._waiting[0].time_ns if self._waiting else last_ns
        lasted_s = (until_ns - from_ns) / NS_PER_S
        fastest_m_s = max(speed.speed_m_s, FASTEST_M_S)
        mean_m_s = min(speed.speed_m_s + 0.5 * GAP_ACCELERATION_M_S2 * lasted_s, fastest_m_s)
        level_m2 = min((mean_m_s * lasted_s) ** 2, LARGEST_VARIANCE_M2)
        down_m2 = min((LOST_CLIMB_M_S * lasted_s) ** 2, LARGEST_VARIANCE_M2)
        turned_rad2 = heading_variance(lasted_s, lasted_s, bias_known=True)
        covariance = (level_m2, 0.0, 0.0, 0.0, level_m2, 0.0, 0.0, down_m2, 0.0, turned_rad2)
        self._done.append(
            Increment(
                from_ns, until_ns, (0.0, 0.0, 0.0), 0.0, self._heading_rad, covariance, (), steps=0
            )
        )

    def _speed_before(self) -> KnownSpeed | None:
        """Return the speed at the last sample, as far as it is known."""
        if self._tracker is not None:
            state = self._tracker.filter
            return KnownSpeed(state.speed_m_s, state.speed_sd_m_s)
        return self._known if self._stood is None else None

    def _begin_anew(self, gap_s: float) -> None:
        """Forget how the phone lay; the speed it had is still known, the less the longer ago."""
        known = self._speed_before()
        if known is not None:
            sd_m_s = math.hypot(known.sd_m_s, GAP_ACCELERATION_M_S2 * gap_s)
            self._known, self._stood = known._replace(sd_m_s=sd_m_s), None
        self._tracker = None
        self.acceleration_m_s2 = None
        self._waiting, self._fixes, self._judged = [], [], 0


def _words(state: VehicleFilter) -> str:
    """Return how the phone lies: how far off upright, and where its x axis points."""
    level_from_sensor = state.level_from_sensor
    tilt_rad = angle_between_rad(rotate(level_from_sensor, (0.0, 0.0, 1.0)), DOWN)
    north, east, _ = rotate(level_from_sensor, (1.0, 0.0, 0.0))
    aside_rad = wrap_rad(math.atan2(east, north) - state.heading_rad)
    return (
        f"Phone in the vehicle lies {math.degrees(tilt_rad):.0f}° off upright, "
        f"its x axis {abs(math.degrees(aside_rad)):.0f}° off forward: put right"
    )
