"""Follows a vehicle sample by sample, and corrects what it believes once a second."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from edge_agent.inertial.clipped_turn import ClippedTurn, clipped_signs
from edge_agent.inertial.standstill import Standstill
from edge_agent.inertial.vehicle_corrections import (
    EchoListener,
    compare_turn,
    face,
    know_speed,
    mean_since,
    stand,
    suppose_usual,
)
from edge_agent.inertial.vehicle_filter import GRAVITY_M_S2, Array, Motion, VehicleFilter
from edge_agent.inertial.vehicle_memory import Memory, Moment, mean_of
from edge_agent.inertial.vehicle_slip import QUIET_S, QUIET_SHARE, SlipDetector
from shared.maths.rotations import Vector3

TICK_S = 1.0
PREDICTED_S = 0.1

DOUBTED_STANDING_SDS, DOUBTED_STANDING_M_S = 3.0, 1.5
"""A smooth road is no standstill: not where speed is known to be greater than that."""

CLEARLY_GOING_M_S = 3.0

REVERSING_M_S = 4.0
"""Nobody reverses faster: who seems to do so was reversing when forward was found."""

UNTURNED_S = 1.5
"""So long after a slip turns are the vehicle's: a hand ends turning more slowly than is seen."""

HELD_S = 1.0
"""Over how long the acceleration and turn that are held over a slip, or a gap, are averaged."""

PUSHED_S = 0.3
"""Likewise, where specific force is to point after a blow as it did before."""

HELD_ACCELERATION_SD_M_S2 = 1.0
HELD_TURN_SD_RAD_S = 0.1
"""How wrong what is held may be."""

LONGEST_STEP_S = 0.1
"""Samples further apart are a gap: what turned in between is only guessed."""

SCALE_SD = 0.02
"""Of a gyroscope: what a slip leaves of its angle in level and heading."""

RELEVELLED_SD_RAD = math.radians(2.0)
REFACED_SD_RAD = math.radians(30.0)
"""After a turn beyond the gyroscope's range."""


class Second(NamedTuple):
    """A tick: how far the vehicle came along north and east of its own level frame.

    Speed and forward are known at its end as well as that; the heading is that of the end.
    """

    begin_s: float
    end_s: float
    north_m: float
    east_m: float
    heading_rad: float
    speed_sd_m_s: float
    forward_sd_rad: float
    stood: bool
    turned_round: bool
    """Whether what had been taken for forward is found to be backward, and the heading so told."""

    @property
    def lasted_s(self) -> float:
        """How long it was."""
        return self.end_s - self.begin_s


class Held(NamedTuple):
    """What the vehicle is taken to do while the sensor does not tell."""

    forward_m_s2: float = 0.0
    turn_rad_s: float = 0.0


@dataclass
class VehicleTracker:
    """One vehicle, from a known level on. Plain state: a copy goes on alike.

    Without ``corrects`` it goes by the sensor alone.
    """

    filter: VehicleFilter
    time_s: float
    corrects: bool = True
    slips: bool = False
    echo: EchoListener = field(default_factory=EchoListener)
    memory: Memory = field(default_factory=Memory)
    _slip: SlipDetector = field(default_factory=SlipDetector)
    _standstill: Standstill = field(default_factory=Standstill)
    _held: Held = field(default_factory=Held)
    _pushed_m_s2: tuple[float, float] = (0.0, 0.0)
    _clipped: ClippedTurn | None = None
    _travelled_m: float = 0.0
    _ticked_s: float = field(init=False)
    _predicted_s: float = field(init=False)
    _second: list[tuple[Vector3, Vector3]] = field(default_factory=list)
    _north_m: float = 0.0
    _east_m: float = 0.0

    def __post_init__(self) -> None:
        self._ticked_s = self._predicted_s = self.time_s

    def step(self, time_s: float, force_m_s2: Vector3, rate_rad_s: Vector3) -> Motion:
        """Follow the vehicle to ``time_s``, which is later; return what the sample says of it."""
        lasted_s, self.time_s = time_s - self.time_s, time_s
        gap = lasted_s > LONGEST_STEP_S
        self._turn(rate_rad_s, lasted_s)
        motion = self.filter.read(force_m_s2, rate_rad_s)
        suspected_s = self._slip.suspected_s
        slipped, self.slips = self.slips, self._slip.step(motion, self.filter, lasted_s)
        if self.slips and not slipped:
            self._begin_slip(suspected_s)
        if slipped and not self.slips and self._clipped is not None:
            self._make_whole(self._clipped)
            motion = self.filter.read(force_m_s2, rate_rad_s)
        if gap and not self.slips:
            self._held = self._usual(time_s)
        if gap or self.slips:
            self._doubt(motion, lasted_s, gap=gap)
            self._go(*self._held, lasted_s)
        else:
            self._go(motion.acceleration_m_s2[0], motion.rate_rad_s[2], lasted_s)
        self._remember(motion, lasted_s)
        self._second.append((force_m_s2, rate_rad_s))
        if time_s - self._predicted_s >= PREDICTED_S:
            self._predict()
        return motion

    def know_speed(self, speed_m_s: float, sd_m_s: float) -> None:
        """Correct by a speed that somebody knows at this moment."""
        know_speed(self.filter, speed_m_s, sd_m_s)

    @property
    def begun(self) -> bool:
        """Whether a tick has begun."""
        return bool(self._second)

    def due(self) -> bool:
        """Whether a tick is over."""
        return self.time_s - self._ticked_s >= TICK_S

    def tick(self) -> Second:
        """Correct by what the last second has told; return how far the vehicle came in it."""
        self._predict()
        begin_s, self._ticked_s = self._ticked_s, self.time_s
        lasted_s = self.time_s - begin_s
        self.memory.forget(self.time_s)
        before_m_s, heading_rad = self.filter.speed_m_s, self.filter.heading_rad
        stood = self.corrects and self._correct(begin_s)
        # What was wrong at the end of the second was so all along it.
        further_m = lasted_s * (self.filter.speed_m_s - before_m_s)
        turned_round = self.corrects and self._is_backward()
        if turned_round:
            self._turn_round()
        told = Second(
            begin_s,
            self.time_s,
            self._north_m + further_m * math.cos(heading_rad),
            self._east_m + further_m * math.sin(heading_rad),
            self.filter.heading_rad,
            self.filter.speed_sd_m_s,
            self.filter.forward_sd_rad,
            stood,
            turned_round,
        )
        self._north_m = self._east_m = 0.0
        self._second = []
        return told

    def _is_backward(self) -> bool:
        return self.filter.speed_m_s < -REVERSING_M_S - self.filter.speed_sd_m_s

    def _turn_round(self) -> None:
        """Take what was ahead to be behind."""
        self.filter.turn_round()
        self.memory.turn_round()
        self._travelled_m = -self._travelled_m
        self._held = self._held._replace(forward_m_s2=-self._held.forward_m_s2)
        forward_m_s2, right_m_s2 = self._pushed_m_s2
        self._pushed_m_s2 = (-forward_m_s2, -right_m_s2)

    def _turn(self, rate_rad_s: Vector3, lasted_s: float) -> None:
        before = self.filter.level_from_sensor
        self.filter.turn(rate_rad_s, lasted_s)
        if any(clipped_signs(rate_rad_s)):
            if self._clipped is None:
                self._clipped = ClippedTurn(before, before, (0, 0, 0))
            self._clipped.add(self.filter.level_from_sensor, rate_rad_s)

    def _make_whole(self, clipped: ClippedTurn) -> None:
        """Level by gravity after a turn that the gyroscope could not follow."""
        state = self.filter
        self._clipped = None
        quiet = self.memory.after(self.time_s - QUIET_S)
        if not quiet:
            return
        forward_m_s2, right_m_s2, down_m_s2 = (
            sum(column) / len(quiet)
            for column in zip(*((one[6], one[7], one[8]) for one in quiet), strict=True)
        )
        state.level_from_sensor = clipped.made_whole(
            state.level_from_sensor,
            state.in_level_axes((forward_m_s2, right_m_s2, down_m_s2 - GRAVITY_M_S2)),
            state.in_level_axes((*self._pushed_m_s2, -GRAVITY_M_S2)),
        )
        state.doubt(tilt=RELEVELLED_SD_RAD**2, forward=REFACED_SD_RAD**2)

    def _go(self, forward_m_s2: float, turn_rad_s: float, lasted_s: float) -> None:
        way_m = self.filter.go(forward_m_s2, turn_rad_s, lasted_s)
        self._travelled_m += way_m
        self._north_m += way_m * math.cos(self.filter.heading_rad)
        self._east_m += way_m * math.sin(self.filter.heading_rad)

    def _remember(self, motion: Motion, lasted_s: float) -> None:
        rates_rad_s = (0.0, 0.0, 0.0) if self.slips else motion.rate_rad_s
        self.memory.moments.append(
            Moment(
                self.time_s,
                lasted_s,
                self._travelled_m,
                *rates_rad_s,
                *motion.acceleration_m_s2,
                self.slips,
            )
        )

    def _begin_slip(self, suspected_s: float) -> None:
        """Hold what the vehicle did before; what the sensor turned already was no turn of it.

        So is what it turned in the last ``suspected_s``.
        """
        low_rad_s = QUIET_SHARE * self._slip.threshold_rad_s
        begun_s = self.time_s - suspected_s
        for one in reversed(self.memory.moments):
            if one.slips or begun_s - one.time_s > QUIET_S:
                break
            if math.hypot(one.roll_rad_s, one.pitch_rad_s) > low_rad_s:
                begun_s = one.time_s
        self._held = self._usual(begun_s)
        before = mean_of(self.memory.after(begun_s - PUSHED_S, begun_s))
        if before is not None:
            self._pushed_m_s2 = (before.forward_m_s2, before.right_m_s2)
        self.filter.heading_rad -= sum(
            (one.yaw_rad_s - self._held.turn_rad_s) * one.lasted_s
            for one in self.memory.after(begun_s)
        )

    def _usual(self, end_s: float) -> Held:
        mean = mean_of(self.memory.after(end_s - HELD_S, end_s))
        return self._held if mean is None else Held(mean.forward_m_s2, mean.yaw_rad_s)

    def _doubt(self, motion: Motion, lasted_s: float, *, gap: bool) -> None:
        held_s2 = lasted_s * max(lasted_s, 1.0)
        turned_rad2 = (SCALE_SD * math.hypot(*motion.rate_rad_s) * lasted_s) ** 2
        unseen_rad2 = HELD_TURN_SD_RAD_S**2 * held_s2
        self.filter.doubt(
            speed=HELD_ACCELERATION_SD_M_S2**2 * held_s2,
            tilt=turned_rad2 + gap * unseen_rad2,
            forward=turned_rad2 + unseen_rad2,
        )

    def _predict(self) -> None:
        since_s, self._predicted_s = self._predicted_s, self.time_s
        mean = mean_of(self.memory.after(since_s))
        self.filter.predict(0.0 if mean is None else mean.right_m_s2)

    def _correct(self, begin_s: float) -> bool:
        """Correct by what the samples after ``begin_s`` tell; return whether the vehicle stood."""
        force_m_s2 = np.array([force for force, _ in self._second])
        rate_rad_s = np.array([rate for _, rate in self._second])
        mean = mean_since(self.memory, begin_s)
        if mean is None:
            return False
        if self._stands(force_m_s2, rate_rad_s):
            stand(self.filter, mean, rate_rad_s.mean(axis=0))
            return True
        going_m_s = DOUBTED_STANDING_SDS * self.filter.speed_sd_m_s + CLEARLY_GOING_M_S
        if self.filter.speed_m_s > going_m_s:
            self._standstill.goes(force_m_s2)
        if self.time_s - self.memory.slipped_s > UNTURNED_S and not self._slip.suspects:
            compare_turn(self.filter, mean)
        suppose_usual(self.filter, mean)
        face(self.filter, self.memory)
        self.echo.listen(self.filter, self.memory, begin_s)
        return False

    def _stands(self, force_m_s2: Array, rate_rad_s: Array) -> bool:
        doubted_m_s = DOUBTED_STANDING_SDS * self.filter.speed_sd_m_s + DOUBTED_STANDING_M_S
        return abs(self.filter.speed_m_s) < doubted_m_s and self._standstill.stands(
            force_m_s2, rate_rad_s
        )
