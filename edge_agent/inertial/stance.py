"""When the boot stands: the published four conditions, decided sample by sample.

"Step length estimation algorithm for rescue personnel using linear calibration", the section on
stance detection. A sample is of a stance when

1. *EPS variance*: the variances of energy ``E = fx² + fz²``, product ``P = fx·fz`` and sum
   ``S = fx + fz`` over a window of 0.15 s are each below their threshold;
2. *gyro level*: ``sqrt(ωx² + ωy²) ≤ 0.6 rad/s``;
3. *gyro variance*: the variance of that norm over the window is at most 0.2;
4. *minimum length*: a stance of 0.1 s or less is a false one inside a swing, and is dropped.

The paper counts samples at 100 Hz; here windows are in seconds, so that any rate from 50 to
1000 Hz gives the same stances. It leaves three things open. *Where the window lies*: it is centred,
for then a stance is cut alike at either end. *The EPS thresholds*: see ``StanceSettings``. *When in
a stance a swing starts and ends*: at the quietest moment, by gyro level, within 0.15 s of the
stance's edge. At the very edges the boot already rolls at up to 0.6 rad/s, so its speed is not the
zero that the swing is closed on; bounded there, walking came out 2.5 % short, so it is 1.1 %.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from shared.messages import ImuSample
from shared.units import NS_PER_S

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
    edge_s: float = 0.15
    """How far inside a stance its quietest moment is looked for; not below ``minimum_s``."""

    gap_s: float = 0.05
    """Samples further apart than this say nothing about what lies between: no stance there."""

    @property
    def delay_s(self) -> float:
        """How long after a sample it is decided upon: half the window, and an edge."""
        return self.window_s / 2.0 + self.edge_s


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


class _Stretch:
    """Samples running that meet the conditions 1 to 3, and the quietest at either end of them."""

    def __init__(self, start_ns: int) -> None:
        self.start_ns = start_ns
        self.begin_ns = start_ns
        self.begin_level_rad_s = math.inf
        self.end_ns: int | None = None
        """The quietest moment at the end; ``None`` while it lasts."""

        self.too_short = False

    def holds(self, time_ns: int) -> bool:
        """Whether the boot stands at ``time_ns``, which is known an edge later."""
        if self.too_short or time_ns < self.begin_ns:
            return False
        return self.end_ns is None or time_ns <= self.end_ns


class _Weighed(NamedTuple):
    """A sample, its gyro level, and the stretch it is of, if it meets the conditions."""

    sample: ImuSample
    level_rad_s: float
    stretch: _Stretch | None


class StanceDetector:
    """Decides on every sample in turn, ``settings.delay_s`` after it (and up to two samples more).

    A stance is told from the quietest moment of its beginning to that of its end.
    """

    def __init__(self, settings: StanceSettings | None = None) -> None:
        self._settings = settings or StanceSettings()
        self._window_ns = round(self._settings.window_s * NS_PER_S)
        self._minimum_ns = round(self._settings.minimum_s * NS_PER_S)
        self._edge_ns = round(self._settings.edge_s * NS_PER_S)
        self._gap_ns = round(self._settings.gap_s * NS_PER_S)
        self._times_ns: deque[int] = deque()
        self._energy = RunningVariance()
        self._product = RunningVariance()
        self._sum = RunningVariance()
        self._gyro = RunningVariance()
        self._whole_from_ns = 0
        self._waiting: deque[tuple[ImuSample, float]] = deque()
        self._stretch: _Stretch | None = None
        self._weighed: deque[_Weighed] = deque()

    def step(self, sample: ImuSample) -> list[Decision]:
        """Take in the next sample (later than the last); return those now decided, in order."""
        now_ns = sample.time_ns
        if not self._times_ns or now_ns - self._times_ns[-1] > self._gap_ns:
            self._whole_from_ns = now_ns + self._window_ns
        level_rad_s = self._push(sample)
        self._waiting.append((sample, level_rad_s))
        quiet = now_ns >= self._whole_from_ns and self._is_quiet()
        decisions: list[Decision] = []
        centre_ns = now_ns - self._window_ns // 2
        while self._waiting[0][0].time_ns <= centre_ns:
            weighed, its_level_rad_s = self._waiting.popleft()
            self._weigh(weighed, its_level_rad_s, quiet=quiet)
            # An edge later, all that a decision depends on is known.
            self._decide(weighed.time_ns - self._edge_ns, decisions)
        return decisions

    def finish(self) -> list[Decision]:
        """Decide on the rest of a recording, but for its last half window; no more may follow."""
        decisions: list[Decision] = []
        if self._weighed:
            if self._stretch is not None:
                self._close(self._stretch)
            self._decide(self._weighed[-1].sample.time_ns, decisions)
        return decisions

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

    def _weigh(self, sample: ImuSample, level_rad_s: float, *, quiet: bool) -> None:
        """Put a sample into its stretch, by the window around it and condition 2."""
        stretch = self._stretch
        if quiet and level_rad_s <= self._settings.gyro_level_rad_s:
            if stretch is None:
                stretch = self._stretch = _Stretch(sample.time_ns)
            near = sample.time_ns - stretch.start_ns <= self._edge_ns
            if near and level_rad_s < stretch.begin_level_rad_s:
                stretch.begin_ns, stretch.begin_level_rad_s = sample.time_ns, level_rad_s
        elif stretch is not None:
            self._close(stretch)
            stretch = self._stretch = None
        self._weighed.append(_Weighed(sample, level_rad_s, stretch))

    def _close(self, stretch: _Stretch) -> None:
        """Apply condition 4, and find the quietest moment of the end."""
        last_ns = self._weighed[-1].sample.time_ns
        stretch.too_short = last_ns - stretch.start_ns < self._minimum_ns
        quietest_rad_s = math.inf
        for sample, level_rad_s, of in reversed(self._weighed):
            if of is not stretch or sample.time_ns < last_ns - self._edge_ns:
                break
            if level_rad_s < quietest_rad_s:
                stretch.end_ns, quietest_rad_s = sample.time_ns, level_rad_s

    def _decide(self, until_ns: int, decisions: list[Decision]) -> None:
        while self._weighed and self._weighed[0].sample.time_ns <= until_ns:
            sample, _, stretch = self._weighed.popleft()
            stood = stretch is not None and stretch.holds(sample.time_ns)
            decisions.append(Decision(sample, stood))
