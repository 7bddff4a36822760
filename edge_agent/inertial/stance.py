"""When the boot stands: the published four conditions, decided sample by sample.

"Step length estimation algorithm for rescue personnel using linear calibration", the section on
stance detection. A sample is of a stance when

1. *EPS variance*: the variances of energy ``E = fx² + fz²``, product ``P = fx·fz`` and sum
   ``S = fx + fz`` over a window of 0.15 s are each below their threshold;
2. *gyro level*: ``sqrt(ωx² + ωy²) ≤ 0.6 rad/s``;
3. *gyro variance*: the variance of that norm over the window is at most 0.2;
4. *minimum length*: a stance of 0.1 s or less is a false one inside a swing, and is dropped.

The paper counts samples at 100 Hz; here windows are in seconds, so that any rate from 50 to
1000 Hz gives the same stances. It leaves open three things. *Where the window lies*: it is
centred, for then a stance is cut alike at either end. *The EPS thresholds*: see
``StanceSettings``. *Where a stance ends*: dropping stances of 0.1 s or less is done by keeping
the samples all of whose neighbours within 0.05 s meet the other conditions, which drops the same
stances and takes 0.05 s off either end of the others. That is a departure: at the edges the boot
already rolls at up to 0.6 rad/s, so its speed is not the zero that the swing is closed on, and
strides came out 1 % shorter with the edges left on.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from shared.clock import NS_PER_S
from shared.messages import ImuSample

_STEPS_PER_UNIT = 1 << 20
"""Resolution of the windows' integers: a millionth, far below any sensor's noise."""


class StanceSettings(NamedTuple):
    """The conditions' parameters. All but the EPS thresholds are the paper's.

    The paper does not print its three EPS thresholds. One number makes all three: specific force
    at rest that scatters by σ (m/s²) on x and z alike has variances of ``4g²σ²`` in E, ``g²σ²`` in
    P and ``2σ²`` in S. On 35 real recordings of walking and slow walking, the distance error of
    walking is flat for σ from 0.4 to 1.0 m/s²; less misses ever more stances, while more lets the
    shuffle between slow steps pass for one. 0.7 is taken, and rounded.
    """

    energy_variance_m4_s8: float = 190.0
    product_variance_m4_s8: float = 47.0
    sum_variance_m2_s4: float = 1.0
    gyro_level_rad_s: float = 0.6
    gyro_variance_rad2_s2: float = 0.2
    window_s: float = 0.15
    minimum_s: float = 0.1
    gap_s: float = 0.05
    """Samples further apart than this say nothing about what lies between: no stance there."""

    @property
    def delay_s(self) -> float:
        """How long after a sample it is decided upon: half the window and half the minimum."""
        return (self.window_s + self.minimum_s) / 2.0


class Decision(NamedTuple):
    """A sample, and whether the boot stood."""

    sample: ImuSample
    stance: bool


class RunningVariance:
    """Variance of the values in a window that others are pushed into and dropped from.

    Sums are kept in integers, so they are exact: they neither drift over hours nor remember a
    spike once it has left.
    """

    def __init__(self) -> None:
        self._values: deque[int] = deque()
        self._sum = 0
        self._sum_of_squares = 0

    def push(self, value: float) -> None:
        """Take in the newest value (finite)."""
        whole = round(value * _STEPS_PER_UNIT)
        self._values.append(whole)
        self._sum += whole
        self._sum_of_squares += whole * whole

    def drop(self) -> None:
        """Leave out the oldest value."""
        whole = self._values.popleft()
        self._sum -= whole
        self._sum_of_squares -= whole * whole

    def variance(self) -> float:
        """Return the mean square distance from the mean, of at least one value."""
        count = len(self._values)
        spread = count * self._sum_of_squares - self._sum * self._sum
        return spread / (count * _STEPS_PER_UNIT) ** 2


class StanceDetector:
    """Decides on every sample in turn, ``settings.delay_s`` after it (and up to a sample more)."""

    def __init__(self, settings: StanceSettings | None = None) -> None:
        self._settings = settings or StanceSettings()
        self._window_ns = round(self._settings.window_s * NS_PER_S)
        self._margin_ns = round(self._settings.minimum_s * NS_PER_S) // 2
        self._gap_ns = round(self._settings.gap_s * NS_PER_S)
        self._times_ns: deque[int] = deque()
        self._energy = RunningVariance()
        self._product = RunningVariance()
        self._sum = RunningVariance()
        self._gyro = RunningVariance()
        self._unweighed: deque[tuple[ImuSample, bool]] = deque()
        self._undecided: deque[ImuSample] = deque()
        self._whole_from_ns = 0
        self._moved_ns = 0

    def step(self, sample: ImuSample) -> list[Decision]:
        """Take in the next sample (later than the last); return those now decided, in order."""
        now_ns = sample.time_ns
        if not self._times_ns:
            self._moved_ns = now_ns
        if not self._times_ns or now_ns - self._times_ns[-1] > self._gap_ns:
            self._whole_from_ns = now_ns + self._window_ns
        level_rad_s = self._push(sample)
        self._unweighed.append((sample, level_rad_s <= self._settings.gyro_level_rad_s))
        quiet = now_ns >= self._whole_from_ns and self._is_quiet()
        decisions: list[Decision] = []
        centre_ns = now_ns - self._window_ns // 2
        while self._unweighed[0][0].time_ns <= centre_ns:
            weighed, level = self._unweighed.popleft()
            self._undecided.append(weighed)
            if not (level and quiet):
                self._moved_ns = weighed.time_ns
            self._decide(weighed.time_ns - self._margin_ns, decisions)
        return decisions

    def _decide(self, until_ns: int, decisions: list[Decision]) -> None:
        """Decide on the samples up to ``until_ns``: all that matters to them has been weighed."""
        while self._undecided and self._undecided[0].time_ns <= until_ns:
            sample = self._undecided.popleft()
            stood = self._moved_ns < sample.time_ns - self._margin_ns
            decisions.append(Decision(sample, stood))

    def _push(self, sample: ImuSample) -> float:
        """Slide the window on to ``sample``; return its gyro level, rad/s."""
        fx, _, fz = sample.force_m_s2
        wx, wy, _ = sample.rate_rad_s
        level_rad_s = math.sqrt(wx * wx + wy * wy)
        self._times_ns.append(sample.time_ns)
        self._energy.push(fx * fx + fz * fz)
        self._product.push(fx * fz)
        self._sum.push(fx + fz)
        self._gyro.push(level_rad_s)
        oldest_ns = sample.time_ns - self._window_ns
        while self._times_ns[0] <= oldest_ns:
            self._times_ns.popleft()
            self._energy.drop()
            self._product.drop()
            self._sum.drop()
            self._gyro.drop()
        return level_rad_s

    def _is_quiet(self) -> bool:
        """Whether the window meets the conditions 1 and 3."""
        settings = self._settings
        return (
            self._energy.variance() < settings.energy_variance_m4_s8
            and self._product.variance() < settings.product_variance_m4_s8
            and self._sum.variance() < settings.sum_variance_m2_s4
            and self._gyro.variance() <= settings.gyro_variance_rad2_s2
        )
