"""Steps, told from the size of specific force alone: how the sensor is worn does not matter."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from shared.units import NS_PER_S

GRAVITY_M_S2 = 9.81


class Step(NamedTuple):
    """One step: when it began and ended, and between which extremes specific force went (m/s²)."""

    start_time_ns: int
    end_time_ns: int
    highest_m_s2: float
    lowest_m_s2: float


class ThresholdSettings(NamedTuple):
    """In g, but for the time. ``first_g`` is Tmax until two steps have been found."""

    first_g: float = 1.1
    low_g: float = 0.94
    forget_s: float = 2.0
    """After so long without a step, Tmax is the first again: one hard step must not deafen it."""


class AdaptiveThreshold:
    """Steps by a threshold that adapts, as published.

    "A study on smartphone indoor navigation technology using extended Kalman filter": once force
    passes Tmax the highest peak Pmax is sought, until force falls to Tmin; from then the lowest,
    Pmin, until it is back at that level. Tmax is the mean of the last two Pmax, loosened. By how
    much "the spread of the mid-values (Pmax + Pmin)/2" loosens it is left open: here by half of
    what the peaks rise above the mid-values, and by the difference of the last two of these. The
    paper does not say either how Tmax comes down again after a hard step.
    """

    def __init__(self, settings: ThresholdSettings | None = None) -> None:
        self._settings = settings or ThresholdSettings()
        self._peaks_g: deque[float] = deque(maxlen=2)
        self._middles_g: deque[float] = deque(maxlen=2)
        self._rose_ns: int | None = None
        self._highest_g = 0.0
        self._lowest_g: float | None = None
        self._ended_ns: int | None = None

    def step(self, time_ns: int, force_m_s2: float) -> Step | None:
        """Take in the size of specific force; return the step that it ends, if it does."""
        force_g = force_m_s2 / GRAVITY_M_S2
        low_g = self._settings.low_g
        if self._rose_ns is None:
            if force_g > self._threshold_g(time_ns):
                self._rose_ns, self._highest_g = time_ns, force_g
        elif self._lowest_g is None:
            self._highest_g = max(self._highest_g, force_g)
            if force_g <= low_g:
                self._lowest_g = force_g
        else:
            self._lowest_g = min(self._lowest_g, force_g)
            if force_g > low_g:
                return self._end(self._rose_ns, time_ns, self._lowest_g)
        return None

    def _threshold_g(self, now_ns: int) -> float:
        settings = self._settings
        if self._ended_ns is not None and now_ns - self._ended_ns > settings.forget_s * NS_PER_S:
            self._peaks_g.clear()
            self._middles_g.clear()
        if len(self._peaks_g) < 2:
            return settings.first_g
        peak_g, middle_g = float(np.mean(self._peaks_g)), float(np.mean(self._middles_g))
        spread_g = abs(self._middles_g[1] - self._middles_g[0])
        return peak_g - 0.5 * (peak_g - middle_g) - spread_g

    def _end(self, rose_ns: int, now_ns: int, lowest_g: float) -> Step:
        self._peaks_g.append(self._highest_g)
        self._middles_g.append(0.5 * (self._highest_g + lowest_g))
        last_ns = self._ended_ns
        goes_on = last_ns is not None and now_ns - last_ns <= self._settings.forget_s * NS_PER_S
        start_ns = last_ns if goes_on and last_ns is not None else rose_ns
        step = Step(start_ns, now_ns, self._highest_g * GRAVITY_M_S2, lowest_g * GRAVITY_M_S2)
        self._rose_ns, self._lowest_g, self._ended_ns = None, None, now_ns
        return step
