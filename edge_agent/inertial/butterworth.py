"""A causal low-pass filter of second order, sample by sample, on plain floats."""

from __future__ import annotations

import math


class LowPass:
    """Butterworth's filter of second order by the bilinear transform; it begins at rest.

    ``start`` is the constant that the signal is taken to have had for ever: without it a sensor's
    gravity would ring as it sets in.
    """

    def __init__(self, cutoff_hz: float, rate_hz: float, start: float = 0.0) -> None:
        warped = math.tan(math.pi * cutoff_hz / rate_hz)
        scale = 1.0 + math.sqrt(2.0) * warped + warped * warped
        self._b = warped * warped / scale
        self._a1 = 2.0 * (warped * warped - 1.0) / scale
        self._a2 = (1.0 - math.sqrt(2.0) * warped + warped * warped) / scale
        self._first = start * (1.0 - self._b)
        self._second = start * (self._b - self._a2)

    def step(self, value: float) -> float:
        """Take in the next sample; return what is left of the signal."""
        passed = self._b * value + self._first
        self._first = 2.0 * self._b * value - self._a1 * passed + self._second
        self._second = self._b * value - self._a2 * passed
        return passed
