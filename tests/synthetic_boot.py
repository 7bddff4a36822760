"""A boot whose motion is a formula: what it reads and where it is are exact at any rate.

It stands, then swings from place to place, pitching as a foot does. Positions are north-east-down,
the body frame forward-right-down; the sensor sits where the foot touches the ground, so that in a
stance it is perfectly still.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from shared.maths.rotations import (
    Vector3,
    about_down,
    from_rotation_vector,
    inverse,
    multiply,
    rotate,
)
from shared.messages import ImuSample
from shared.units import NS_PER_S

GRAVITY_M_S2 = 9.81

BROKEN_READINGS: dict[str, tuple[Vector3, Vector3]] = {
    "not a number": ((math.nan, 0.0, -9.81), (0.0, 0.0, 0.0)),
    "infinite": ((0.0, 0.0, -9.81), (0.0, math.inf, 0.0)),
    "absurd": ((0.0, 3e5, -9.81), (0.0, 0.0, 0.0)),
}
"""Specific force and rate that no sensor can have read, by what is wrong with them."""


@dataclass(frozen=True)
class SyntheticWalk:
    """``strides`` swings of ``stride_m`` in ``swing_s`` each, ``stance_s`` of standing between.

    Each swing climbs by ``rise_m`` and turns by ``turn_rad``; the first begins after
    ``standing_s`` and heads ``heading_rad``; the last stance is as long again.
    """

    strides: int = 6
    stride_m: float = 1.2
    swing_s: float = 0.7
    stance_s: float = 0.4
    standing_s: float = 2.0
    rise_m: float = 0.0
    turn_rad: float = 0.0
    heading_rad: float = 0.0
    pitch_rad: float = 0.7
    lift_m: float = 0.12
    field_ut: Vector3 | None = None

    @property
    def duration_s(self) -> float:
        """From the first sample to the last."""
        walking_s = self.strides * (self.swing_s + self.stance_s)
        return 2.0 * self.standing_s + max(0.0, walking_s - self.stance_s)

    @property
    def stance_times_s(self) -> list[float]:
        """The middle of each stance; of the first and last, a moment next to the swing."""
        period_s = self.swing_s + self.stance_s
        after = [self.standing_s + k * period_s - 0.5 * self.stance_s for k in range(self.strides)]
        return [*after, self.standing_s + self.strides * period_s - 0.5 * self.stance_s]

    @property
    def stance_places_m(self) -> list[Vector3]:
        """Where the boot stands, stance by stance."""
        north_m = east_m = down_m = 0.0
        places = [(north_m, east_m, down_m)]
        for stride in range(self.strides):
            heading_rad = self.heading_rad + stride * self.turn_rad
            north_m += self.stride_m * math.cos(heading_rad)
            east_m += self.stride_m * math.sin(heading_rad)
            down_m -= self.rise_m
            places.append((north_m, east_m, down_m))
        return places

    def sample(self, time_s: float) -> ImuSample:
        """What a perfect sensor reads at ``time_s``."""
        stride, phase = self._phase(time_s)
        angle = 2.0 * math.pi * phase
        rate = 2.0 * math.pi / self.swing_s
        # Progress along the stride is phase − sin(2π·phase)/2π: still at both ends.
        along_m_s2 = self.stride_m / (2.0 * math.pi) * rate**2 * math.sin(angle)
        down_m_s2 = -self.rise_m / (2.0 * math.pi) * rate**2 * math.sin(angle)
        down_m_s2 -= self.lift_m * _bump_acceleration(phase, self.swing_s)
        pitch_rad = -self.pitch_rad * math.sin(angle) * _bump(phase)
        turned = phase - math.sin(angle) / (2.0 * math.pi)
        way_rad = self.heading_rad + stride * self.turn_rad
        facing_rad = way_rad + turned * self.turn_rad
        nav_from_body = multiply(
            about_down(facing_rad), from_rotation_vector((0.0, pitch_rad, 0.0))
        )
        acceleration_m_s2 = (
            along_m_s2 * math.cos(way_rad),
            along_m_s2 * math.sin(way_rad),
            down_m_s2 - GRAVITY_M_S2,
        )
        pitch_rate_rad_s = -self.pitch_rad * _pitch_slope(phase) / self.swing_s
        turn_rate_rad_s = self.turn_rad * (1.0 - math.cos(angle)) / self.swing_s
        moving = 0.0 < phase < 1.0
        return ImuSample(
            round(time_s * NS_PER_S),
            rotate(inverse(nav_from_body), acceleration_m_s2),
            (
                -turn_rate_rad_s * math.sin(pitch_rad) * moving,
                pitch_rate_rad_s * moving,
                turn_rate_rad_s * math.cos(pitch_rad) * moving,
            ),
            None if self.field_ut is None else rotate(inverse(nav_from_body), self.field_ut),
        )

    def samples(self, rate_hz: float, start_s: float = 0.0) -> Iterator[ImuSample]:
        """Every reading at ``rate_hz``, from time 0 (or ``start_s``) to the end."""
        first = math.ceil(start_s * rate_hz)
        for index in range(first, int(self.duration_s * rate_hz) + 1):
            yield self.sample(index / rate_hz)

    def samples_with_gap(self, rate_hz: float, gap_s: float) -> Iterator[ImuSample]:
        """Every reading but those of ``gap_s`` from 0.2 s into the third swing on."""
        start_s = self.standing_s + 2 * (self.swing_s + self.stance_s) + 0.2
        for sample in self.samples(rate_hz):
            if not start_s < sample.time_ns / NS_PER_S < start_s + gap_s:
                yield sample

    def _phase(self, time_s: float) -> tuple[int, float]:
        """The stride under way, and how much of its swing is done, 0 to 1."""
        if self.strides == 0:
            return 0, 0.0
        since_s = time_s - self.standing_s
        period_s = self.swing_s + self.stance_s
        stride = min(max(int(since_s // period_s), 0), self.strides - 1)
        return stride, min(max((since_s - stride * period_s) / self.swing_s, 0.0), 1.0)


def _bump(phase: float) -> float:
    """0 at both ends with no slope, 1 in the middle."""
    return 0.5 * (1.0 - math.cos(2.0 * math.pi * phase))


def _bump_acceleration(phase: float, swing_s: float) -> float:
    """Second derivative of the square of the bump, which has no acceleration at its ends."""
    angle, rate = 2.0 * math.pi * phase, 2.0 * math.pi / swing_s
    return 0.5 * rate**2 * (math.cos(angle) - math.cos(2.0 * angle))


def _pitch_slope(phase: float) -> float:
    """Derivative by phase of sin(2π·phase)·bump(phase)."""
    angle = 2.0 * math.pi * phase
    return math.pi * (math.cos(angle) - math.cos(2.0 * angle))
