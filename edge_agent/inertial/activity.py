"""What the wearer is doing, stride by stride, and why it is thought so.

Rules in the order in which they bind: a boot on its toes crawls, whatever else it does; then what
climbs, what steps aside, what drags; the rest goes by speed. Each rule weighs one quantity against
one limit, and the confidence falls to a half at the limit. Nothing here depends on the method that
found the stride: an increment and the samples of its time are enough.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from edge_agent.confidence import confidence_of
from edge_agent.mounts.interface import Increment
from shared.maths.angles import wrap_rad
from shared.maths.rotations import Vector3, angle_between_rad
from shared.messages import Activity, ImuSample
from shared.units import NS_PER_S

SAMPLES_HELD = 8192
"""Enough for a stride and the delay with which it is told, at 1 kHz."""

EDGE_S = 0.1
"""Over how long before a stance's moment the boot's posture is averaged; half as long after it."""

PASSING_S = 0.6
"""A shorter stance between two strides belongs to the gait; a longer one is a stop."""

STANCE_S = 0.25
"""A stance of walking: what a stride after a stop is counted to take beside its swing."""


class ActivitySettings(NamedTuple):
    """The limits between activities, one set for all gaits. Angles in degrees, as they are read.

    Each ``*_width`` is how far from its limit a quantity must be for a confidence of 0.88.
    """

    lost_sd_m: float = 0.5
    longest_stride_s: float = 3.0
    carried_m: float = 0.1
    carried_width_m: float = 0.15
    toes_deg: float = 40.0
    toes_width_deg: float = 20.0
    in_place_m: float = 0.2
    in_place_width_m: float = 0.1
    rise_m: float = 0.18
    rise_width_m: float = 0.1
    stairs_slope: float = 0.25
    ladder_slope: float = 1.5
    aside_deg: float = 50.0
    aside_width_deg: float = 20.0
    longest_aside_m: float = 1.0
    drag_rate_deg_s: float = 190.0
    drag_width_deg_s: float = 60.0
    shortest_drag_m: float = 0.3
    longest_drag_m: float = 0.75
    fast_m_s: float = 1.3
    run_m_s: float = 1.9
    run_cycle_s: float = 0.9
    run_cycle_m_s2: float = 1.5
    """Each second that a stride is quicker than ``run_cycle_s`` lowers ``run_m_s`` by so much."""

    speed_width_m_s: float = 0.25
    plain_stride_m: float = 0.9
    plain_speed_m_s: float = 0.7
    """A stride as long and as fast as this is upright and forward: posture is learnt from it."""


class ActivityEstimate(NamedTuple):
    """An activity, how sure it is (0 to 1), and the reason in words."""

    activity: Activity
    confidence: float
    reason: str


class _Stride(NamedTuple):
    """What the rules look at, ``up_m`` without what a lift carried.

    ``start`` and ``end`` are unit vectors of gravity in sensor axes.
    """

    level_m: float
    up_m: float
    cycle_s: float
    direction_rad: float
    peak_rate_deg_s: float
    start: Vector3
    end: Vector3

    @property
    def speed_m_s(self) -> float:
        return self.level_m / self.cycle_s


class ActivityClassifier:
    """Takes samples and increments in order; names each increment's activity.

    It learns two things of how the sensor is worn from strides that can only be walking: the
    boot's posture on flat ground, and how its forward lies to the agent's heading. Before the
    first of them, the posture at the first stride's start stands in, and no step is one aside.
    """

    def __init__(self, settings: ActivitySettings | None = None) -> None:
        self._settings = settings or ActivitySettings()
        self._samples: deque[ImuSample] = deque(maxlen=SAMPLES_HELD)
        self._last_end_ns: int | None = None
        self._flat: Vector3 | None = None
        self._forward = (1.0, 0.0)
        self._plain_strides = 0

    @property
    def flat(self) -> Vector3 | None:
        """Gravity's direction in sensor axes on flat ground (length about 1), once walked on."""
        return self._flat if self._plain_strides else None

    def take_sample(self, sample: ImuSample) -> None:
        """Take in a sample, not older than the last."""
        self._samples.append(sample)

    def take_increment(self, increment: Increment) -> ActivityEstimate:
        """Return what the wearer did over ``increment``, whose samples have been taken in."""
        stride = self._measure(increment)
        self._last_end_ns = increment.end_time_ns
        settings = self._settings
        covariance = increment.covariance
        if covariance[0] + covariance[4] > settings.lost_sd_m**2:
            return ActivityEstimate("unknown", 0.0, "the boot's way is lost")
        if abs(increment.carried_down_m) >= settings.carried_m and stride is not None:
            lifted = self._lift(stride, -increment.carried_down_m)
            if lifted is not None:
                return lifted
        if stride is None or stride.cycle_s > settings.longest_stride_s:
            return ActivityEstimate("unknown", 0.0, "no single stride")
        self._learn(stride)
        return self._judge(stride)

    def _measure(self, increment: Increment) -> _Stride | None:
        """Return what the rules look at, or ``None`` without samples at either end."""
        start_ns, end_ns = increment.start_time_ns, increment.end_time_ns
        edge_ns = round(EDGE_S * NS_PER_S)
        samples = self._samples
        while samples and samples[0].time_ns < start_ns - edge_ns:
            samples.popleft()
        held = list(samples)
        time_ns = np.fromiter((sample.time_ns for sample in held), np.int64, len(held))
        before = time_ns <= start_ns + edge_ns // 2
        after = (end_ns - edge_ns <= time_ns) & (time_ns <= end_ns + edge_ns // 2)
        start_up, end_up = (
            _direction([held[row].force_m_s2 for row in np.flatnonzero(edge).tolist()])
            for edge in (before, after)
        )
        if start_up is None or end_up is None:
            return None
        during = np.flatnonzero((start_ns <= time_ns) & (time_ns <= end_ns)).tolist()
        rates_rad_s = [held[row].rate_rad_s for row in during]
        peak_rad2_s2 = max([0.0, *(x * x + y * y + z * z for x, y, z in rates_rad_s)])
        north_m, east_m, down_m = increment.displacement_m
        facing_rad = increment.heading_rad - 0.5 * increment.d_heading_rad
        return _Stride(
            math.hypot(north_m, east_m),
            increment.carried_down_m - down_m,
            self._cycle_s(start_ns, end_ns),
            wrap_rad(math.atan2(east_m, north_m) - facing_rad),
            math.degrees(math.sqrt(peak_rad2_s2)),
            start_up,
            end_up,
        )

    def _cycle_s(self, start_ns: int, end_ns: int) -> float:
        """Return the time from stance to stance, whether or not increments span the stances."""
        last_ns = self._last_end_ns
        if last_ns is not None and 0 <= start_ns - last_ns <= PASSING_S * NS_PER_S:
            return (end_ns - last_ns) / NS_PER_S
        return (end_ns - start_ns) / NS_PER_S + STANCE_S

    def _learn(self, stride: _Stride) -> None:
        """Take posture and forward direction from a stride that can only be walking."""
        if self._flat is None:
            self._flat = stride.start
        settings = self._settings
        if stride.level_m < settings.plain_stride_m or stride.speed_m_s < settings.plain_speed_m_s:
            return
        self._plain_strides += 1
        weight = max(0.1, 1.0 / self._plain_strides)
        flat, end = self._flat, stride.end
        blended = tuple((1.0 - weight) * a + weight * b for a, b in zip(flat, end, strict=True))
        self._flat = (blended[0], blended[1], blended[2])
        cosine, sine = math.cos(stride.direction_rad), math.sin(stride.direction_rad)
        c, s = self._forward
        self._forward = ((1.0 - weight) * c + weight * cosine, (1.0 - weight) * s + weight * sine)

    def _judge(self, stride: _Stride) -> ActivityEstimate:
        return (
            self._posture(stride)
            or self._climb(stride)
            or self._in_place(stride)
            or self._aside(stride)
            or self._drag(stride)
            or self._pace(stride)
        )

    def _lift(self, stride: _Stride, carried_m: float) -> ActivityEstimate | None:
        """Name a lift, unless the wearer goes about in it."""
        settings = self._settings
        if math.hypot(stride.level_m, stride.up_m) >= settings.in_place_m:
            return None
        sure = confidence_of(abs(carried_m) - settings.carried_m, settings.carried_width_m)
        way = "up" if carried_m > 0.0 else "down"
        return ActivityEstimate("lift", sure, f"carried {way} {abs(carried_m):.2f} m")

    def _posture(self, stride: _Stride) -> ActivityEstimate | None:
        settings, flat = self._settings, self._flat or stride.start
        # Kneeling down and rising tilt the boot at one end alone: they are no crawling.
        tilt_deg = min(_angle_deg(stride.start, flat), _angle_deg(stride.end, flat))
        if tilt_deg < settings.toes_deg:
            return None
        sure = confidence_of(tilt_deg - settings.toes_deg, settings.toes_width_deg)
        return ActivityEstimate("crawl", sure, f"boot rests {tilt_deg:.0f}° from flat")

    def _climb(self, stride: _Stride) -> ActivityEstimate | None:
        settings = self._settings
        rise_m, slope = abs(stride.up_m), abs(stride.up_m) / max(stride.level_m, 0.01)
        if rise_m < settings.rise_m or slope < settings.stairs_slope:
            return None
        sure = confidence_of(rise_m - settings.rise_m, settings.rise_width_m)
        way = "up" if stride.up_m > 0.0 else "down"
        reason = f"{way} {rise_m:.2f} m over {stride.level_m:.2f} m"
        if slope >= settings.ladder_slope:
            return ActivityEstimate("ladder", sure, reason)
        return ActivityEstimate("stairs_up" if way == "up" else "stairs_down", sure, reason)

    def _in_place(self, stride: _Stride) -> ActivityEstimate | None:
        settings = self._settings
        moved_m = math.hypot(stride.level_m, stride.up_m)
        if moved_m >= settings.in_place_m:
            return None
        sure = confidence_of(settings.in_place_m - moved_m, settings.in_place_width_m)
        return ActivityEstimate("stand", sure, f"moved {moved_m:.2f} m")

    def _aside(self, stride: _Stride) -> ActivityEstimate | None:
        settings = self._settings
        if not self._plain_strides:
            return None  # Aside of what? Forward is not known yet.
        off_rad = wrap_rad(stride.direction_rad - math.atan2(self._forward[1], self._forward[0]))
        aside_deg = 90.0 - abs(abs(math.degrees(off_rad)) - 90.0)
        if aside_deg < settings.aside_deg or stride.level_m > settings.longest_aside_m:
            return None
        sure = confidence_of(aside_deg - settings.aside_deg, settings.aside_width_deg)
        side = "right" if off_rad > 0.0 else "left"
        reason = f"{stride.level_m:.1f} m to the {side}, {aside_deg:.0f}° off forward"
        return ActivityEstimate("side_step", sure, reason)

    def _drag(self, stride: _Stride) -> ActivityEstimate | None:
        settings = self._settings
        if not settings.shortest_drag_m <= stride.level_m <= settings.longest_drag_m:
            return None
        rate_deg_s = stride.peak_rate_deg_s
        if rate_deg_s > settings.drag_rate_deg_s:
            return None
        # The posture speaks against it, unless it is not known yet.
        sure = confidence_of(settings.drag_rate_deg_s - rate_deg_s, settings.drag_width_deg_s)
        sure *= 0.5 if self._plain_strides else 0.8
        reason = f"boot hardly pitches ({rate_deg_s:.0f} °/s) over {stride.level_m:.1f} m"
        return ActivityEstimate("crawl", sure, reason)

    def _pace(self, stride: _Stride) -> ActivityEstimate:
        settings, speed_m_s = self._settings, stride.speed_m_s
        quicker_s = settings.run_cycle_s - stride.cycle_s
        run_m_s = max(settings.fast_m_s, settings.run_m_s - settings.run_cycle_m_s2 * quicker_s)
        reason = f"{speed_m_s:.1f} m/s, a stride in {stride.cycle_s:.2f} s"
        if speed_m_s >= run_m_s:
            return ActivityEstimate("run", self._sure_of_speed(speed_m_s - run_m_s), reason)
        if speed_m_s >= settings.fast_m_s:
            margin_m_s = min(speed_m_s - settings.fast_m_s, run_m_s - speed_m_s)
            return ActivityEstimate("fast", self._sure_of_speed(margin_m_s), reason)
        margin_m_s = settings.fast_m_s - speed_m_s
        return ActivityEstimate("walk", self._sure_of_speed(margin_m_s), reason)

    def _sure_of_speed(self, margin_m_s: float) -> float:
        return confidence_of(margin_m_s, self._settings.speed_width_m_s)


def _direction(vectors: list[Vector3]) -> Vector3 | None:
    """Return the unit vector along the mean, ``None`` of nothing or of what is not finite."""
    x, y, z = map(sum, zip(*vectors, strict=True)) if vectors else (0.0, 0.0, 0.0)
    length = math.hypot(x, y, z)
    if not 0.0 < length < math.inf:
        return None
    return (x / length, y / length, z / length)


def _angle_deg(a: Vector3, b: Vector3) -> float:
    return math.degrees(angle_between_rad(a, b))
