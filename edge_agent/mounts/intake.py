"""What a mount lets in: samples that are numbers, and later than the last."""

from __future__ import annotations

import math
from enum import Enum, auto

from edge_agent.mounts.interface import Faults
from shared.messages import ImuSample
from shared.units import NS_PER_S

LARGEST_READING = 1e5
"""In SI units: no sensor reads more (the bound of the wire as well)."""

RESTART_AFTER = 100
"""This many samples running that go back in time: the source's clock was set back."""


STUCK_S = 0.5
"""Nobody stands so still that a sensor on them reads the same to the last digit for so long."""


def readable(sample: ImuSample, *, needs_gyro: bool = True) -> bool:
    """Whether a sensor can have read this; a comparison with NaN is false.

    Unless it ``needs_gyro``, a sample ``WITHOUT_GYRO`` is one too.
    """
    fx, fy, fz = sample.force_m_s2
    wx, wy, wz = sample.rate_rad_s
    return (
        -LARGEST_READING <= fx <= LARGEST_READING
        and -LARGEST_READING <= fy <= LARGEST_READING
        and -LARGEST_READING <= fz <= LARGEST_READING
        and (
            (
                -LARGEST_READING <= wx <= LARGEST_READING
                and -LARGEST_READING <= wy <= LARGEST_READING
                and -LARGEST_READING <= wz <= LARGEST_READING
            )
            or not (needs_gyro or has_gyro(sample))
        )
    )


def has_gyro(sample: ImuSample) -> bool:
    """Whether the sensor has a gyroscope, be its reading what it may."""
    wx, wy, wz = sample.rate_rad_s
    return not (math.isnan(wx) and math.isnan(wy) and math.isnan(wz))


class Verdict(Enum):
    """What to do with a sample: take it, pass it over, or take it as the first of a new time."""

    TAKE = auto()
    PASS = auto()
    RESTART = auto()


class Intake:
    """Judges samples in turn, and counts what is wrong with them in ``faults``.

    A sensor that reads the same to the last digit for longer than ``stuck_s`` reads nothing.
    """

    def __init__(
        self,
        faults: Faults,
        gap_s: float,
        *,
        needs_gyro: bool = True,
        stuck_s: float = math.inf,
    ) -> None:
        self._faults = faults
        self._needs_gyro = needs_gyro
        self._gap_ns = round(gap_s * NS_PER_S)
        self._stuck_ns = stuck_s * NS_PER_S
        self._changed: ImuSample | None = None
        self._newest_ns: int | None = None
        self._backward = 0

    def judge(self, sample: ImuSample) -> Verdict:
        """Return what to do with ``sample``."""
        newest_ns = self._newest_ns
        is_next = newest_ns is None or sample.time_ns > newest_ns
        if not readable(sample, needs_gyro=self._needs_gyro) or (
            is_next and self._is_stuck(sample)
        ):
            self._faults.unusable += 1
            return Verdict.PASS
        if is_next:
            if newest_ns is not None and sample.time_ns - newest_ns > self._gap_ns:
                self._faults.gaps += 1
            verdict = Verdict.TAKE
        else:
            self._faults.out_of_order += 1
            self._backward += 1
            if self._backward < RESTART_AFTER:
                return Verdict.PASS
            self._faults.restarts += 1
            verdict = Verdict.RESTART
        self._backward = 0
        self._newest_ns = sample.time_ns
        return verdict

    def _is_stuck(self, sample: ImuSample) -> bool:
        last = self._changed
        if (
            last is None
            or sample.force_m_s2 != last.force_m_s2
            or sample.rate_rad_s != last.rate_rad_s
        ):
            self._changed = sample
            return False
        return sample.time_ns - last.time_ns > self._stuck_ns
