"""Steps by the bounce of the body: at any pace, and however a phone is held or worn.

The size of specific force alone is looked at, smoothed until one bounce a step is left of it. Peaks
and troughs are told by how far the signal comes back from them, so that slow soft steps count like
quick hard ones, and the shuffle of a hand does not.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]


GRAVITY_M_S2 = (4.0, 25.0)
"""Mean force of who walks or runs lies in between: nothing told in g, or in mg, does."""


class BounceSettings(NamedTuple):
    """What tells a step from all else.

    Force at even ticks of ``rate_hz`` is smoothed up to ``cutoff_hz`` by a symmetric window of
    ``taps`` of them. A bounce rises by ``least_m_s2`` over the trough before it and falls as far
    after it, or by ``share`` of what bounces usually do if that is more; and it is ``above_m_s2``
    over the mean. It is a step if another is at most ``longest_s`` away, before or after.
    """

    rate_hz: float = 50.0
    cutoff_hz: float = 3.0
    taps: int = 25
    least_m_s2: float = 0.7
    share: float = 0.25
    usual_weight: float = 0.2
    above_m_s2: float = 0.3
    shortest_s: float = 0.26
    longest_s: float = 2.0
    first_s: float = 0.6
    """The first step of a bout is taken to last no longer: nothing tells when it began."""


class Bounce(NamedTuple):
    """A step, from the peak before it to its own, and how hard it was.

    ``mean_m_s2`` is how far smoothed force is from its mean over the step, on average.
    """

    start_time_ns: int
    end_time_ns: int
    mean_m_s2: float


class _Peak(NamedTuple):
    time_ns: int
    height_m_s2: float


class BounceDetector:
    """Takes the size of specific force tick by tick; tells steps, some 0.4 s late. Plain state.

    One jolt by itself is no step: the first of a bout is told with the second.
    """

    def __init__(self, settings: BounceSettings | None = None) -> None:
        self._settings = settings or BounceSettings()
        settings = self._settings
        self._window = _low_pass(settings)
        self._raw: deque[tuple[int, float]] = deque(maxlen=settings.taps)
        kept_s = settings.longest_s + 1.0
        self._smooth: deque[tuple[int, float]] = deque(maxlen=int(kept_s * settings.rate_hz))
        self._rising = False
        self._highest = _Peak(0, -math.inf)
        self._lowest_m_s2 = math.inf
        self._usual_m_s2 = 0.0
        self._last: _Peak | None = None
        self._alone = True

    def step(self, time_ns: int, force_m_s2: float) -> list[Bounce]:
        """Take in a tick; return the steps that it makes certain."""
        self._raw.append((time_ns, force_m_s2))
        settings = self._settings
        if len(self._raw) < settings.taps:
            return []
        middle_ns, _ = self._raw[settings.taps // 2]
        smooth_m_s2 = float(self._window @ np.array([force for _, force in self._raw]))
        self._smooth.append((middle_ns, smooth_m_s2))
        return self._follow(middle_ns, smooth_m_s2)

    def finish(self) -> list[Bounce]:
        """Return the steps that were still being waited for: no more ticks will come."""
        told: list[Bounce] = []
        if not self._raw:
            return told
        time_ns, force_m_s2 = self._raw[-1]
        tick_ns = round(NS_PER_S / self._settings.rate_hz)
        for tick in range(self._settings.taps // 2):
            told += self.step(time_ns + (tick + 1) * tick_ns, force_m_s2)
        if self._rising and self._stands_out(self._highest):
            self._rising = False
            told += self._found(self._highest)
        return told

    def _follow(self, time_ns: int, smooth_m_s2: float) -> list[Bounce]:
        if self._last is not None and self._is_over(time_ns - self._last.time_ns):
            self._usual_m_s2 = 0.0
        least_m_s2 = max(self._settings.least_m_s2, self._settings.share * self._usual_m_s2)
        if not self._rising:
            self._lowest_m_s2 = min(self._lowest_m_s2, smooth_m_s2)
            if smooth_m_s2 - self._lowest_m_s2 >= least_m_s2:
                self._rising, self._highest = True, _Peak(time_ns, smooth_m_s2)
            return []
        if smooth_m_s2 > self._highest.height_m_s2:
            self._highest = _Peak(time_ns, smooth_m_s2)
        if self._highest.height_m_s2 - smooth_m_s2 < least_m_s2:
            return []
        peak, rose_m_s2 = self._highest, self._highest.height_m_s2 - self._lowest_m_s2
        self._rising, self._lowest_m_s2 = False, smooth_m_s2
        if not self._stands_out(peak):
            return []
        told = self._found(peak)
        if told:
            self._usual_m_s2 += self._settings.usual_weight * (rose_m_s2 - self._usual_m_s2)
        return told

    def _stands_out(self, peak: _Peak) -> bool:
        """Whether a peak is over the mean: coming to rest after a trough is none.

        A mean that is no gravity is that of no step.
        """
        mean_m_s2 = math.fsum(value for _, value in self._smooth) / len(self._smooth)
        least_m_s2, most_m_s2 = GRAVITY_M_S2
        if not least_m_s2 < mean_m_s2 < most_m_s2:
            return False
        return peak.height_m_s2 - mean_m_s2 >= self._settings.above_m_s2

    def _found(self, peak: _Peak) -> list[Bounce]:
        """Return the step that ``peak`` ends, after the one before if that had not been told."""
        last, settings = self._last, self._settings
        if last is not None and peak.time_ns - last.time_ns < settings.shortest_s * NS_PER_S:
            return []
        self._last = peak
        if last is None or self._is_over(peak.time_ns - last.time_ns):
            self._alone = True
            return []
        told = []
        if self._alone:
            self._alone = False
            first_ns = round(settings.first_s * NS_PER_S)
            lasted_ns = min(first_ns, peak.time_ns - last.time_ns)
            told.append(self._bounce(last.time_ns - lasted_ns, last.time_ns))
        told.append(self._bounce(last.time_ns, peak.time_ns))
        return told

    def _is_over(self, since_ns: int) -> bool:
        """Whether a bout of steps is over, so long after the last."""
        return since_ns > self._settings.longest_s * NS_PER_S

    def _bounce(self, start_ns: int, end_ns: int) -> Bounce:
        during = np.array(
            [value for time_ns, value in self._smooth if start_ns <= time_ns <= end_ns]
        )
        mean_m_s2 = float(np.abs(during - during.mean()).mean()) if during.size else 0.0
        return Bounce(start_ns, end_ns, mean_m_s2)


def _low_pass(settings: BounceSettings) -> Array:
    """Return the weights (taps,) of a low-pass: a sinc under a Hamming window, of sum one."""
    from_middle = np.arange(settings.taps) - 0.5 * (settings.taps - 1)
    sinc = np.sinc(2.0 * settings.cutoff_hz / settings.rate_hz * from_middle)
    weights = sinc * np.hamming(settings.taps)
    return np.asarray(weights / weights.sum())
