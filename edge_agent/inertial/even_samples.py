"""Samples brought to an even rate, so that filters mean the same with every sensor."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from shared.maths.rotations import Vector3
from shared.messages import ImuSample
from shared.units import NS_PER_S

EVEN_RATE_HZ = 100.0
EVEN_PERIOD_NS = round(NS_PER_S / EVEN_RATE_HZ)


class EvenSample(NamedTuple):
    """Specific force (m/s²) and angular rate (rad/s) in the sensor's own axes."""

    time_ns: int
    force_m_s2: Vector3
    rate_rad_s: Vector3


class EvenSamples:
    """Draws a straight line from sample to sample; gaps are bridged by it as well."""

    def __init__(self) -> None:
        self._last: ImuSample | None = None
        self._next_ns = 0

    def restart(self) -> None:
        """Forget the sample before: no line leads from it to the next."""
        self._last = None

    def step(self, sample: ImuSample) -> Iterator[EvenSample]:
        """Yield the even samples up to ``sample``, which must be later than the one before."""
        last, self._last = self._last, sample
        if last is None:
            self._next_ns = sample.time_ns + EVEN_PERIOD_NS
            yield EvenSample(sample.time_ns, sample.force_m_s2, sample.rate_rad_s)
            return
        whole_ns = sample.time_ns - last.time_ns
        while self._next_ns <= sample.time_ns:
            share = (self._next_ns - last.time_ns) / whole_ns
            yield EvenSample(
                self._next_ns,
                _between(last.force_m_s2, sample.force_m_s2, share),
                _between(last.rate_rad_s, sample.rate_rad_s, share),
            )
            self._next_ns += EVEN_PERIOD_NS


def _between(a: Vector3, b: Vector3, share: float) -> Vector3:
    ax, ay, az = a
    bx, by, bz = b
    return (ax + share * (bx - ax), ay + share * (by - ay), az + share * (bz - az))
