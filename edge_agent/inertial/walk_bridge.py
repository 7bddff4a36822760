"""Samples that a phone has dropped, while its wearer walks: laid in from the stride before.

Phones drop samples in bursts, of a tenth of a second to one. A straight line over a burst loses a
bounce, and with it a step; and between two moments of a trunk that sways it turns by what it
swayed there. But a walk repeats itself: what was read as long ago as the reading before the burst
agrees best with, goes on as the burst did. It is copied in the sensor's own axes, so that it does
not matter how that is worn. Who does not move, or not alike, is left to the straight line.
"""

from __future__ import annotations

from collections import deque
from itertools import chain
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.messages import ImuSample, Vector3
from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]

SHORTEST_S = 0.1
"""Less is no burst: a straight line is near enough, at 25 Hz as well."""

TICK_S = 0.02
ALIKE_S = 0.8
"""So much before a burst is compared with what was before: most of a stride."""

LONGEST_STRIDE_S = 1.6
FORCE_M_S2, RATE_RAD_S = 1.0, 0.5
"""What counts as much: differences of specific force and of rate."""

UNLIKE = 0.5
"""A mean square that differs by more, as a share of what it scatters itself, is no repetition."""


class WalkBridge:
    """Passes samples on, behind those that fill a burst of lost ones before them. Plain state."""

    def __init__(self, longest_s: float) -> None:
        """``longest_s``: nobody knows of a longer burst what the wearer did in it."""
        self._longest_ns = round(longest_s * NS_PER_S)
        self._kept_ns = round((longest_s + LONGEST_STRIDE_S + ALIKE_S) * NS_PER_S)
        self._kept: deque[ImuSample] = deque()

    def take(self, sample: ImuSample, *, restart: bool = False) -> list[ImuSample]:
        """Return ``sample``, which is later than the last, behind what was lost before it."""
        if restart:
            self._kept.clear()
        lost_ns = sample.time_ns - self._kept[-1].time_ns if self._kept else 0
        if lost_ns > self._longest_ns:
            self._kept.clear()
        filled = self._filled(sample) if lost_ns > SHORTEST_S * NS_PER_S and self._kept else []
        for one in (*filled, sample):
            self._kept.append(one)
        while sample.time_ns - self._kept[0].time_ns > self._kept_ns:
            self._kept.popleft()
        return [*filled, sample]

    def _filled(self, sample: ImuSample) -> list[ImuSample]:
        """Return what fills the time between the last sample and this one; nothing if unknown."""
        last = self._kept[-1]
        lag_ns = self._repeats_after_ns(sample)
        if lag_ns is None:
            return []
        copied = [one for one in self._kept if one.time_ns + lag_ns >= last.time_ns]
        copied = [one for one in copied if one.time_ns + lag_ns <= sample.time_ns]
        if not copied:
            return []
        # Who turns now may not have turned then: rates are bent to meet those at either end.
        begin = _less(last.rate_rad_s, copied[0].rate_rad_s)
        end = _less(sample.rate_rad_s, copied[-1].rate_rad_s)
        filled = []
        for one in copied:
            time_ns = one.time_ns + lag_ns
            share = (time_ns - last.time_ns) / (sample.time_ns - last.time_ns)
            bend = [a + share * (b - a) for a, b in zip(begin, end, strict=True)]
            x, y, z = (rate + off for rate, off in zip(one.rate_rad_s, bend, strict=True))
            if last.time_ns < time_ns < sample.time_ns:
                filled.append(ImuSample(time_ns, one.force_m_s2, (x, y, z)))
        return filled

    def _repeats_after_ns(self, sample: ImuSample) -> int | None:
        """Return how long ago what was read agrees best with what was read before the burst."""
        time_s, readings = _columns(self._kept)
        lost_s = sample.time_ns / NS_PER_S - time_s[-1]
        ticks = np.arange(time_s[-1], time_s[0], -TICK_S)[::-1]
        even = np.column_stack([np.interp(ticks, time_s, axis) for axis in readings.T])
        alike, least = round(ALIKE_S / TICK_S), int(lost_s / TICK_S) + 1
        before = even[-alike:]
        most = min(len(even) - alike, least + round(LONGEST_STRIDE_S / TICK_S))
        if most < least:
            return None
        scatter = float(before.var(axis=0).sum())
        _, (after,) = _columns([sample])
        lost = round(lost_s / TICK_S)
        off = []
        for lag in range(least, most + 1):
            there = even[len(even) - alike - lag : len(even) - lag]
            joins = even[len(even) - 1 - lag + lost]
            square = ((before - there) ** 2).sum() + ((after - joins) ** 2).sum()
            off.append(square / (alike + 1))
        best = int(np.argmin(off))
        if not off[best] <= UNLIKE * scatter:
            return None
        return round((least + best) * TICK_S * NS_PER_S)


def _columns(samples: deque[ImuSample] | list[ImuSample]) -> tuple[Array, Array]:
    """Return times (n,) in seconds, and readings (n, 6) in units that count alike."""
    values = chain.from_iterable((*one.force_m_s2, *one.rate_rad_s) for one in samples)
    readings = np.fromiter(values, np.float64, 6 * len(samples)).reshape(-1, 6)
    scaled = readings / np.repeat([FORCE_M_S2, RATE_RAD_S], 3)
    return np.array([one.time_ns for one in samples]) / NS_PER_S, np.nan_to_num(scaled)


def _less(a: Vector3, b: Vector3) -> Vector3:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])
