"""When the wearer stands in a lift: pressure that goes on changing, and the push that began it.

Of the pressure alone a fan that starts looks like a lift. But what a lift gains in speed, the boot
at rest in it is pushed by, and reads as specific force: a fan pushes nobody.
"""

from __future__ import annotations

import math
from collections import deque
from operator import mul
from typing import NamedTuple

from edge_agent.inertial.barometer import Reading
from edge_agent.inertial.sample_intake import HARDEST_M_S2
from shared.messages import ImuSample
from shared.units import NS_PER_S


class LiftSettings(NamedTuple):
    """Limits of a ride.

    It begins when height changes by ``begin_m_s`` over ``speed_s``, evenly but for ``uneven_m``,
    and specific force has summed up to ``push_m_s`` or more in ``push_s``, of the same sign and
    within ``agreement`` times of it; meanwhile, and for ``stood_s`` at the least, the boot turned
    no faster than ``still_rad_s``. It ends when height has changed by less than ``end_m_s`` for
    ``ended_s`` after a push back, or for ``surely_ended_s``. Without readings for
    ``longest_gap_s`` nothing is known. Force at rest is averaged over ``rest_s``, and where it is
    more than ``at_rest_m_s2`` off that, over ``unrest_s``. A push that no change of height follows
    in ``longest_doubt_s`` was none of a lift.
    """

    begin_m_s: float = 0.3
    end_m_s: float = 0.2
    speed_s: float = 1.2
    fewest: int = 6
    uneven_m: float = 0.35
    push_m_s: float = 0.25
    push_s: float = 3.5
    stood_s: float = 1.0
    agreement: float = 3.0
    still_rad_s: float = 0.4
    rest_s: float = 2.0
    unrest_s: float = 10.0
    at_rest_m_s2: float = 0.15
    ended_s: float = 0.8
    surely_ended_s: float = 3.0
    longest_gap_s: float = 1.0
    longest_doubt_s: float = 5.0


class _Interval(NamedTuple):
    """What was felt between two readings: specific force beyond rest, and whether still."""

    time_ns: int
    pushed_m_s: float


class LiftWatch:
    """Takes samples and heights in order; says whether a stretch of time was a ride."""

    def __init__(self, settings: LiftSettings | None = None) -> None:
        self._settings = settings or LiftSettings()
        self._force_sum_m_s2, self._count, self._fastest_rad2_s2 = 0.0, 0, 0.0
        self._rest_m_s2: float | None = None
        self._felt: deque[_Interval] = deque()
        self._heights: deque[Reading] = deque()
        self._push_m_s = 0.0
        self._push_back_m_s = 0.0
        self._slow_since_ns: int | None = None
        self._doubt_since_ns: int | None = None
        self._ride_from_ns = self._ride_to_ns = -1
        self._ride_sign = 0.0

    @property
    def riding(self) -> bool:
        """Whether a ride is on."""
        return self._ride_sign != 0.0

    @property
    def doubtful(self) -> bool:
        """Whether a ride may have begun: what pressure does now is not to be explained yet."""
        return self._doubt_since_ns is not None

    def rode(self, from_ns: int, to_ns: int) -> bool:
        """Whether any of the time between the two was a ride."""
        if self.riding:
            return to_ns > self._ride_from_ns
        return to_ns > self._ride_from_ns and from_ns < self._ride_to_ns

    def feel(self, sample: ImuSample) -> None:
        """Take in a sample's force and rate."""
        wx, wy, wz = sample.rate_rad_s
        force_m_s2 = math.hypot(*sample.force_m_s2)
        if force_m_s2 <= HARDEST_M_S2:
            self._force_sum_m_s2 += force_m_s2
            self._count += 1
        self._fastest_rad2_s2 = max(self._fastest_rad2_s2, wx * wx + wy * wy + wz * wz)

    def take(self, reading: Reading) -> None:
        """Take in a height, after the samples up to its own."""
        heights, settings = self._heights, self._settings
        since_s = 0.0
        if heights:
            since_s = (reading.time_ns - heights[-1].time_ns) / NS_PER_S
            if not 0.0 < since_s <= settings.longest_gap_s:
                self._forget(heights[-1].time_ns)
                since_s = 0.0
        heights.append(reading)
        while heights[0].time_ns < reading.time_ns - settings.speed_s * NS_PER_S:
            heights.popleft()
        self._sum_up(reading.time_ns, since_s)
        if len(heights) < settings.fewest:
            return
        if self.riding:
            self._look_for_end(reading.time_ns, self._slope()[0])
        else:
            self._look_for_begin(reading.time_ns)

    def _forget(self, last_ns: int) -> None:
        """Go on after a gap: a ride, if one was on, is not known to go on."""
        if self.riding:
            self._ride_to_ns, self._ride_sign = last_ns, 0.0
        self._heights.clear()
        self._felt.clear()
        self._doubt_since_ns = None

    def _sum_up(self, now_ns: int, since_s: float) -> None:
        """Note the push felt since the last reading, and how large force is at rest."""
        settings = self._settings
        still = self._fastest_rad2_s2 <= settings.still_rad_s**2
        if self._count and still:
            force_m_s2 = self._force_sum_m_s2 / self._count
            rest_m_s2 = force_m_s2 if self._rest_m_s2 is None else self._rest_m_s2
            at_rest = abs(force_m_s2 - rest_m_s2) < settings.at_rest_m_s2
            time_s = settings.rest_s if at_rest else settings.unrest_s
            if not self.riding:
                rest_m_s2 += min(1.0, since_s / time_s) * (force_m_s2 - rest_m_s2)
            self._rest_m_s2 = rest_m_s2
            self._felt.append(_Interval(now_ns, since_s * (force_m_s2 - rest_m_s2)))
        elif not still:
            self._felt.clear()
        while self._felt and self._felt[0].time_ns < now_ns - settings.push_s * NS_PER_S:
            self._felt.popleft()
        self._push_m_s = sum(interval.pushed_m_s for interval in self._felt)
        self._force_sum_m_s2, self._count, self._fastest_rad2_s2 = 0.0, 0, 0.0

    def _slope(self) -> tuple[float, float]:
        """Return the slope of the latest heights by least squares, and the RMS off that line."""
        count, first = len(self._heights), self._heights[0]
        later_s = [(each.time_ns - first.time_ns) / NS_PER_S for each in self._heights]
        higher_m = [each.height_m - first.height_m for each in self._heights]
        mean_s, mean_m = sum(later_s) / count, sum(higher_m) / count
        times_s = [time_s - mean_s for time_s in later_s]
        heights_m = [height_m - mean_m for height_m in higher_m]
        shared_m_s = sum(map(mul, times_s, heights_m))
        slope_m_s = shared_m_s / sum(map(mul, times_s, times_s))
        off_m = [
            height_m - slope_m_s * time_s
            for time_s, height_m in zip(times_s, heights_m, strict=True)
        ]
        return slope_m_s, math.sqrt(sum(map(mul, off_m, off_m)) / count)

    def _look_for_begin(self, now_ns: int) -> None:
        settings, push_m_s = self._settings, self._push_m_s
        stood = bool(self._felt) and now_ns - self._felt[0].time_ns >= settings.stood_s * NS_PER_S
        pushed = stood and abs(push_m_s) >= settings.push_m_s
        self._doubt(now_ns, doubtful=pushed)
        # Most readings come without a push, and a push that lasted too long has been forgotten.
        if not (pushed and self._felt):
            return
        speed_m_s, uneven_m = self._slope()
        agree = (
            uneven_m < settings.uneven_m
            and push_m_s * speed_m_s > 0.0
            and abs(speed_m_s) <= settings.agreement * abs(push_m_s)
            and abs(push_m_s) <= settings.agreement * abs(speed_m_s)
        )
        if agree and abs(speed_m_s) >= settings.begin_m_s:
            self._ride_sign = math.copysign(1.0, speed_m_s)
            self._ride_from_ns = self._felt[0].time_ns
            self._slow_since_ns, self._push_back_m_s = None, 0.0
            self._doubt_since_ns = None

    def _doubt(self, now_ns: int, *, doubtful: bool) -> None:
        """Begin or end a doubt; one that lasts for long was for nothing."""
        since_ns = self._doubt_since_ns
        if not doubtful:
            self._doubt_since_ns = None
        elif since_ns is None:
            self._doubt_since_ns = now_ns
        elif now_ns - since_ns > self._settings.longest_doubt_s * NS_PER_S:
            self._felt.clear()
            self._doubt_since_ns = None

    def _look_for_end(self, now_ns: int, speed_m_s: float) -> None:
        settings = self._settings
        self._push_back_m_s = max(self._push_back_m_s, -self._ride_sign * self._push_m_s)
        if abs(speed_m_s) >= settings.end_m_s:
            self._slow_since_ns = None
            return
        if self._slow_since_ns is None:
            self._slow_since_ns = now_ns
        slow_s = (now_ns - self._slow_since_ns) / NS_PER_S
        pushed_back = self._push_back_m_s >= settings.push_m_s
        if slow_s >= (settings.ended_s if pushed_back else settings.surely_ended_s):
            self._ride_to_ns, self._ride_sign = now_ns, 0.0
            self._felt.clear()
