"""A single reading that is wildly wrong between two that are not: a bit that fell over on a bus.

A reading far from the one before waits for the next. Force that is back again by then was no
motion. Nor was a rate that is back, if it would have turned the sensor by little: a phone is not
knocked aside by a few degrees within one sample. By more it may be; but gravity, as the sensor sees
it, turns with it then. About the vertical nothing tells the two apart, and such a rate is believed.
"""

from __future__ import annotations

import math

from edge_agent.mounts.interface import Faults
from shared.maths.rotations import from_rotation_vector, inverse, rotate
from shared.messages import ImuSample
from shared.units import NS_PER_S

FAR_M_S2, BACK_M_S2 = 30.0, 15.0
FAR_RAD_S, BACK_RAD_S = 3.0, 1.5
"""A reading that differs by more than the former is doubted; by less than the latter, the next one
is back again."""

LITTLE_RAD = math.radians(10.0)

TELLING_M_S2 = 1.0
"""A turn that would have changed the force by less than this cannot be seen in it."""

SOON_S = 0.1
"""Readings further apart than this say nothing of one another."""


class LoneSpikes:
    """Passes samples on, a doubted one together with the next. Plain state."""

    def __init__(self, faults: Faults) -> None:
        self._faults = faults
        self._last: ImuSample | None = None
        self._doubted: ImuSample | None = None

    def take(self, sample: ImuSample) -> list[ImuSample]:
        """Return the samples, in order, that are to be taken in now."""
        last, doubted = self._last, self._doubted
        if doubted is None:
            if last is not None and _soon(last, sample) and _is_doubtful(last, sample):
                self._doubted = sample
                return []
            self._last = sample
            return [sample]
        self._doubted, self._last = None, sample
        if last is not None and _soon(last, sample) and _was_spike(last, doubted, sample):
            self._faults.unusable += 1
            return [sample]
        return [doubted, sample]

    def finish(self) -> list[ImuSample]:
        """Return the sample that was still doubted: no more will come."""
        doubted, self._doubted = self._doubted, None
        return [] if doubted is None else [doubted]


def _soon(last: ImuSample, sample: ImuSample) -> bool:
    return 0 < sample.time_ns - last.time_ns <= SOON_S * NS_PER_S


def _is_doubtful(last: ImuSample, sample: ImuSample) -> bool:
    return (
        math.dist(last.force_m_s2, sample.force_m_s2) > FAR_M_S2
        or math.dist(last.rate_rad_s, sample.rate_rad_s) > FAR_RAD_S
    )


def _was_spike(last: ImuSample, doubted: ImuSample, sample: ImuSample) -> bool:
    changed_m_s2 = math.dist(last.force_m_s2, sample.force_m_s2)
    if math.dist(last.force_m_s2, doubted.force_m_s2) > FAR_M_S2:
        return changed_m_s2 < BACK_M_S2
    if math.dist(last.rate_rad_s, sample.rate_rad_s) > BACK_RAD_S:
        return False
    since_s = (doubted.time_ns - last.time_ns) / NS_PER_S
    wx, wy, wz = doubted.rate_rad_s
    if math.hypot(wx, wy, wz) * since_s < LITTLE_RAD:
        return True
    turn = from_rotation_vector((wx * since_s, wy * since_s, wz * since_s))
    turned_m_s2 = rotate(inverse(turn), last.force_m_s2)
    return (
        math.dist(last.force_m_s2, turned_m_s2) > TELLING_M_S2
        and math.dist(turned_m_s2, sample.force_m_s2) > changed_m_s2
    )
