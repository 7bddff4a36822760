"""Samples brought to an even rate, so that filters mean the same with every sensor."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from shared.maths.rotations import Vector3
from shared.messages import ImuSample
from shared.units import NS_PER_S

EVEN_RATE_HZ = 100.0
EVEN_PERIOD_NS = round(NS_PER_S / EVEN_RATE_HZ)

LONGEST_CURVE_NS = NS_PER_S // 10
"""A longer gap is bridged by a straight line: nobody knows how the signal bent in it."""


class EvenSample(NamedTuple):
    """Specific force (m/s²) and angular rate (rad/s) in the sensor's own axes."""

    time_ns: int
    force_m_s2: Vector3
    rate_rad_s: Vector3


class EvenSamples:
    """Draws a curve through the samples, one of them late; gaps are bridged by straight lines.

    A slow sensor's bounces would be flattened by straight lines, and steps told 3 % short at 25 Hz.
    The curve leads through each sample in parallel to its two neighbours (Catmull and Rom, "A class
    of local interpolating splines", 1974, for uneven times).
    """

    def __init__(self) -> None:
        self._near: deque[ImuSample] = deque(maxlen=4)
        self._next_ns = 0

    def restart(self) -> None:
        """Forget the samples before: no line leads from them to the next."""
        self._near.clear()

    def step(self, sample: ImuSample) -> Iterator[EvenSample]:
        """Yield the even samples up to the one before ``sample``, which must be later than it."""
        near = self._near
        near.append(sample)
        if len(near) == 1:
            self._next_ns = sample.time_ns + EVEN_PERIOD_NS
            yield EvenSample(sample.time_ns, sample.force_m_s2, sample.rate_rad_s)
        if len(near) < 3:
            return
        a, b = near[-3], near[-2]
        before = near[0] if len(near) == 4 else a
        whole_ns = b.time_ns - a.time_ns
        while self._next_ns <= b.time_ns:
            share = (self._next_ns - a.time_ns) / whole_ns
            weights = _weights((before, a, b, sample), share)
            yield EvenSample(
                self._next_ns,
                _weighed(weights, [one.force_m_s2 for one in (before, a, b, sample)]),
                _weighed(weights, [one.rate_rad_s for one in (before, a, b, sample)]),
            )
            self._next_ns += EVEN_PERIOD_NS


def _weights(near: tuple[ImuSample, ...], share: float) -> tuple[float, ...]:
    """Return what each of four samples counts at a ``share`` of the way between the middle two."""
    t0, t1, t2, t3 = (one.time_ns for one in near)
    if t2 - t1 > LONGEST_CURVE_NS:
        return (0.0, 1.0 - share, share, 0.0)
    # Hermite's cubic, its slopes those of the lines from neighbour to neighbour.
    left, right = (t2 - t1) / (t2 - t0), (t2 - t1) / (t3 - t1)
    rest = 1.0 - share
    leaving, coming = left * share * rest * rest, -right * share * share * rest
    at_second = share * share * (3.0 - 2.0 * share)
    return (-leaving, 1.0 - at_second - coming, at_second + leaving, coming)


def _weighed(weights: tuple[float, ...], vectors: list[Vector3]) -> Vector3:
    x, y, z = (
        sum(weight * part for weight, part in zip(weights, axis, strict=True))
        for axis in zip(*vectors, strict=True)
    )
    return (x, y, z)
