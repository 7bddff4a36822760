"""A boot's strides from its samples, as they arrive: clock, start-up, gaps, and the filter.

This is the one door to the error-state method, online and in batch. It is pure: the same samples
give the same strides, and :meth:`BootTracker.save` gives bytes from which a tracker goes on as if
it had never been interrupted.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec
import numpy as np

from edge_agent.inertial.boot_start import START_UP_S, Start, mean_sample, plausible, start_on
from edge_agent.inertial.boot_state import (
    OUTCOME,
    STATE,
    Outcome,
    State,
    Stride,
    credible,
    lost_stride,
    stride_of,
)
from edge_agent.inertial.boot_strides import (
    MOST_HELD,
    compile_kernels,
    finish,
    mend_gap,
    mend_sample,
    step,
)
from edge_agent.inertial.eskf_parameters import (
    CAPACITY,
    EskfParameters,
    kernel_parameters,
    windows_at,
)
from edge_agent.inertial.foot_mechanisation import turn_about_down, turn_nav
from edge_agent.inertial.sample_clock import Arrival, ClockState, place
from edge_agent.inertial.sample_ring import BRIDGED
from shared.maths.rotations import Quaternion
from shared.messages import ImuSample
from shared.units import NS_PER_S

LONGEST_GAP_S = 0.6
"""Samples further apart cannot be bridged: the boot is lost between them."""

MOST_WAITING = 5000
"""Samples looked at to begin on; more in ``START_UP_S`` bear no time that could be true."""

MOST_MISFITS = 100
"""So many more samples out of their time than in it: the source's clock or rate has changed."""

LOST_AFTER_S = 5.0
"""After so long without a way to begin again, it is said that the boot is lost."""


class Counts(NamedTuple):
    """What was put right, or could not be, since the start.

    Of samples: ``repeated``, ``implausible``, ``late_mended``, ``late_dropped``, ``bridged``.
    ``gaps`` counts runs of missing samples, ``restarts`` gaps too long to bridge and clocks or
    filters gone astray, ``refused_starts`` spells of samples that nothing could begin on.
    """

    repeated: int = 0
    implausible: int = 0
    late_mended: int = 0
    late_dropped: int = 0
    bridged: int = 0
    gaps: int = 0
    restarts: int = 0
    refused_starts: int = 0


class _Gap(NamedTuple):
    first: int
    last: int


class _Saved(msgspec.Struct):
    """A tracker as bytes hold it."""

    parameters: EskfParameters
    state: bytes
    window_rate_hz: float
    clock: ClockState | None
    waiting: list[ImuSample]
    block: int
    raw: list[ImuSample]
    last: ImuSample | None
    gap: _Gap | None
    misfits: int
    told_ns: int | None
    trouble: str | None
    counts: Counts


class BootTracker:
    """Feed it sample after sample; it gives the strides that each completes."""

    def __init__(self, parameters: EskfParameters | None = None) -> None:
        compile_kernels()
        self._parameters = parameters or EskfParameters()
        self._state: State = np.zeros(1, STATE)
        self._outcomes: Outcome = np.zeros(MOST_HELD, OUTCOME)
        self._set_windows(100.0)
        self._clock: ClockState | None = None
        self._waiting: list[ImuSample] = []
        self._block = 1
        self._raw: list[ImuSample] = []
        self._last: ImuSample | None = None
        self._gap: _Gap | None = None
        self._misfits = 0
        self._astray = False
        self._told_ns: int | None = None
        self.trouble: str | None = None
        """Why tracking cannot begin, in words; ``None`` once it has."""
        self.counts = Counts()

    def _set_windows(self, rate_hz: float) -> None:
        """Fix the windows in samples; the rate may go on being refined, they stay."""
        windows = windows_at(self._parameters, rate_hz)
        self._window_rate_hz = rate_hz
        self._kernel = kernel_parameters(self._parameters, rate_hz)
        self._lag = windows.half_window + windows.look_ahead
        self._margin = windows.bridge_margin

    @property
    def rate_hz(self) -> float | None:
        """The true sampling rate as estimated so far; ``None`` before tracking has begun."""
        return self._block * NS_PER_S / self._clock.period_ns if self._clock else None

    @property
    def filtered_ns(self) -> int | None:
        """Time of the newest sample filtered; ``None`` before the first."""
        newest = int(self._state["filtered"][0]) - int(self._kernel["look_ahead"][0])
        return int(self._state["time_ns"][0, newest & (CAPACITY - 1)]) if newest > 0 else None

    @property
    def stands(self) -> bool:
        """Whether the boot is believed still at ``filtered_ns``, and has been since a stride."""
        return (
            float(self._state["since_update_s"][0]) == 0.0
            and float(self._state["peak_speed_m_s"][0]) <= self._parameters.moving_speed_m_s
        )

    @property
    def nav_from_body(self) -> Quaternion:
        """Attitude of the sensor at ``filtered_ns``."""
        w, x, y, z = self._state["quat_wxyz"][0].tolist()
        return (w, x, y, z)

    @property
    def stance_nav_from_body(self) -> Quaternion:
        """Attitude of the sensor where the last stride told has ended."""
        w, x, y, z = self._state["anchor_quat_wxyz"][0].tolist()
        return (w, x, y, z)

    def step(self, sample: ImuSample) -> list[Stride]:
        """Take one sample in and return the strides it completes, oldest first.

        A sample that repeats the last, or that no boot can have given, is dropped and counted.
        """
        if not plausible(sample):
            self.counts = self.counts._replace(implausible=self.counts.implausible + 1)
            return []
        if self._last is not None and _repeats(sample, self._last):
            self.counts = self.counts._replace(repeated=self.counts.repeated + 1)
            return []
        self._last = sample
        if self._clock is None or self._block == 1:
            return self._take(sample)
        return self._average(sample, self._clock.period_ns)

    def finish(self) -> list[Stride]:
        """Return the strides still held back, judged with what there is; nothing may follow."""
        if self._clock is None:
            return []
        self._gap = None
        found = finish(self._state, self._outcomes, self._kernel)
        return [stride for i in range(found) for stride in self._told(i)]

    def _average(self, sample: ImuSample, period_ns: float) -> list[Stride]:
        """Average a block of a sensor faster than the filter; one that a gap tears is dropped."""
        if self._raw and sample.time_ns - self._raw[0].time_ns > 1.5 * period_ns:
            self._raw = []
        self._raw.append(sample)
        if len(self._raw) < self._block:
            return []
        block, self._raw = self._raw, []
        return self._take(mean_sample(block))

    def _take(self, sample: ImuSample) -> list[Stride]:
        """Place one sample in time, and take it in if its place is not past."""
        if self._clock is None:
            return self._wait(sample)
        arrival = place(self._clock, sample.time_ns)
        if arrival.late_by:
            mended = self._mend_late(sample, arrival.late_by)
            self._misfits += not mended
        else:
            self._misfits = max(0, self._misfits + (1 if arrival.missing else -1))
        too_long = arrival.missing * self._clock.period_ns > LONGEST_GAP_S * NS_PER_S
        if too_long or self._misfits >= MOST_MISFITS:
            strides = self.finish()
            self._restart([sample])
            return strides
        strides = [] if arrival.late_by else self._accept(sample, arrival)
        if self._astray:
            self._restart([])
        return strides

    def _accept(self, sample: ImuSample, arrival: Arrival) -> list[Stride]:
        strides: list[Stride] = []
        if arrival.missing and self._clock is not None:
            strides += self._hold_places(sample, arrival.missing, self._clock)
        self._clock = arrival.state
        strides += self._push(round(arrival.state.taken_ns), sample, arrival.dt_s, bridged=False)
        self._mend_when_known()
        return strides

    def _push(self, time_ns: int, sample: ImuSample, dt_s: float, *, bridged: bool) -> list[Stride]:
        closed = step(
            self._state, self._outcomes, self._kernel, time_ns,
            *sample.force_m_s2, *sample.rate_rad_s, dt_s, bridged,
        )  # fmt: skip
        return self._told(0) if closed else []

    def _told(self, index: int) -> list[Stride]:
        """Read one outcome; after one that cannot be true, nothing is told until a new start."""
        outcome = self._outcomes[index]
        self._astray = self._astray or not credible(outcome)
        if self._astray:
            return []
        self._told_ns = int(outcome["end_ns"])
        return [stride_of(outcome, self._state[0])]

    def _wait(self, sample: ImuSample) -> list[Stride]:
        """Hold samples back until there are enough to begin on."""
        waiting = self._waiting
        if waiting and abs(sample.time_ns - waiting[-1].time_ns) > LONGEST_GAP_S * NS_PER_S:
            waiting.clear()
        waiting.append(sample)
        spanned_ns = sample.time_ns - waiting[0].time_ns
        if spanned_ns < START_UP_S * NS_PER_S and len(waiting) < MOST_WAITING:
            return []
        self._waiting = []
        start = start_on(waiting, self._parameters)
        if isinstance(start, Start):
            self.trouble = None
            return self._begin(start)
        self.trouble = start
        self.counts = self.counts._replace(refused_starts=self.counts.refused_starts + 1)
        overdue_ns = None if self._told_ns is None else sample.time_ns - self._told_ns
        if overdue_ns is None or 0 <= overdue_ns < LOST_AFTER_S * NS_PER_S:
            return []
        return [self._lost_until(sample.time_ns)]

    def _begin(self, start: Start) -> list[Stride]:
        self._set_windows(start.rate_hz)
        self._clock, self._block = start.clock, start.block
        first, *others = start.samples
        strides = [] if self._told_ns is None else [self._lost_until(first.time_ns)]
        self._carry_over(start.state)
        self._told_ns = first.time_ns
        strides += self._push(first.time_ns, first, start.clock.period_ns / NS_PER_S, bridged=False)
        for sample in others:
            strides += self._take(sample)
        return strides

    def _carry_over(self, begun: State) -> None:
        """After a restart keep what a new levelling cannot know, the heading as the best guess."""
        before, self._state = self._state, begun
        if self._told_ns is None:
            return
        for name in ("rate_bias_rad_s", "heading_rad", "rolling_height_m"):
            if np.isfinite(before[name]).all():
                begun[name] = before[name]
        turn_rad = turn_about_down(begun["quat_wxyz"][0], before["anchor_quat_wxyz"][0])
        if math.isfinite(turn_rad):
            turn_nav(begun["quat_wxyz"][0], 0.0, 0.0, turn_rad)
            begun["anchor_quat_wxyz"] = begun["quat_wxyz"]

    def _lost_until(self, time_ns: int) -> Stride:
        start_ns = time_ns if self._told_ns is None else min(self._told_ns, time_ns)
        self._told_ns = time_ns
        heading_rad = float(self._state["heading_rad"][0])
        return lost_stride(start_ns, time_ns, heading_rad if math.isfinite(heading_rad) else 0.0)

    def _restart(self, waiting: list[ImuSample]) -> None:
        self.counts = self.counts._replace(restarts=self.counts.restarts + 1)
        self._clock, self._gap, self._misfits, self._astray = None, None, 0, False
        self._block, self._raw, self._waiting = 1, [], waiting

    def _hold_places(self, sample: ImuSample, missing: int, clock: ClockState) -> list[Stride]:
        """Hold ``missing`` places on a straight line up to ``sample``, to be bridged when known."""
        head = int(self._state["head"][0])
        before = self._state["samples"][0, (head - 1) & (CAPACITY - 1), :6]
        after = np.array([*sample.force_m_s2, *sample.rate_rad_s])
        lines = np.linspace(before, after, missing + 2)[1:-1].tolist()
        strides: list[Stride] = []
        for i, (fx, fy, fz, wx, wy, wz) in enumerate(lines, 1):
            time_ns = round(clock.taken_ns + i * clock.period_ns)
            held = ImuSample(time_ns, (fx, fy, fz), (wx, wy, wz))
            strides += self._push(time_ns, held, clock.period_ns / NS_PER_S, bridged=True)
        self._gap = _Gap(head, head + missing - 1)
        self.counts = self.counts._replace(
            bridged=self.counts.bridged + missing, gaps=self.counts.gaps + 1
        )
        return strides

    def _mend_when_known(self) -> None:
        """Bridge the latest gap once enough has come after it, or the filter is near."""
        if self._gap is None:
            return
        head = int(self._state["head"][0])
        known = head - 1 - self._gap.last >= self._margin
        reach = head - self._lag
        if known or reach >= self._gap.first - 1:
            if reach <= self._gap.first:
                mend_gap(self._state, self._kernel, self._gap.first, self._gap.last)
            self._gap = None

    def _mend_late(self, sample: ImuSample, late_by: int) -> bool:
        """Put a late sample where its place was held, if the filter has not passed it yet."""
        head = int(self._state["head"][0])
        slot = head - late_by
        reach = head - self._lag
        held = (
            late_by < CAPACITY and self._state["samples"][0, slot & (CAPACITY - 1), BRIDGED] > 0.0
        )
        if slot <= reach or not held:
            self.counts = self.counts._replace(late_dropped=self.counts.late_dropped + 1)
            return False
        mend_sample(
            self._state, self._kernel, slot,
            np.array(sample.force_m_s2, dtype=np.float64),
            np.array(sample.rate_rad_s, dtype=np.float64),
        )  # fmt: skip
        self._gap = None
        self.counts = self.counts._replace(late_mended=self.counts.late_mended + 1)
        return True

    def save(self) -> bytes:
        """Return everything a tracker knows; :func:`resume` makes it again, to the bit."""
        return msgspec.msgpack.encode(
            _Saved(
                self._parameters, self._state.tobytes(), self._window_rate_hz, self._clock,
                self._waiting, self._block, self._raw, self._last, self._gap, self._misfits,
                self._told_ns, self.trouble, self.counts,
            )
        )  # fmt: skip


def resume(saved: bytes) -> BootTracker:
    """Return the tracker that :meth:`BootTracker.save` saved.

    Raises ValueError when the bytes are of another version.
    """
    try:
        was = msgspec.msgpack.decode(saved, type=_Saved)
    except msgspec.DecodeError as error:
        raise ValueError(f"no saved tracker of this version, start a new one: {error}") from error
    if len(was.state) != STATE.itemsize:
        raise ValueError("the saved tracker is of another version: start a new one")
    tracker = BootTracker(was.parameters)
    tracker._state = np.frombuffer(was.state, STATE).copy()
    tracker._set_windows(was.window_rate_hz)
    tracker._clock, tracker._waiting, tracker._last = was.clock, was.waiting, was.last
    tracker._block, tracker._raw = was.block, was.raw
    tracker._gap, tracker._misfits, tracker._told_ns = was.gap, was.misfits, was.told_ns
    tracker.trouble, tracker.counts = was.trouble, was.counts
    return tracker


def _repeats(sample: ImuSample, last: ImuSample) -> bool:
    return (
        sample.time_ns == last.time_ns
        and sample.force_m_s2 == last.force_m_s2
        and sample.rate_rad_s == last.rate_rad_s
    )
