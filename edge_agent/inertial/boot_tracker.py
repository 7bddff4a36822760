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

from edge_agent.inertial.boot_start import START_UP_S, Start, mean_sample, start_on
from edge_agent.inertial.boot_state import (
    OUTCOME,
    STATE,
    Outcome,
    State,
    Stride,
    blank_state,
    credible,
    lost_stride,
    stride_of,
)
from edge_agent.inertial.boot_strides import MOST_HELD, finish, foresee_gap, mend_sample
from edge_agent.inertial.eskf_parameters import (
    CAPACITY,
    EskfParameters,
    kernel_parameters,
)
from edge_agent.inertial.foot_mechanisation import turn_about_down, turn_nav
from edge_agent.inertial.sample_clock import ClockState, place
from edge_agent.inertial.sample_intake import (
    IMPLAUSIBLE,
    MISPLACED,
    REPEATED,
    TAKEN,
    accept,
    compile_kernels,
    judge,
    take,
    take_next,
    take_rows,
)
from edge_agent.inertial.sample_ring import BRIDGED
from edge_agent.sources.recording import Recording
from shared.compiled import direct
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


class _Saved(msgspec.Struct):
    """A tracker as bytes hold it."""

    parameters: EskfParameters
    state: bytes
    window_rate_hz: float
    begun: bool
    waiting: list[ImuSample]
    block: int
    raw: list[ImuSample]
    told_ns: int | None
    trouble: str | None
    counts: Counts


class BootTracker:
    """Feed it sample after sample; it gives the strides that each completes."""

    def __init__(self, parameters: EskfParameters | None = None) -> None:
        compile_kernels()
        self._take_directly = direct(take)
        self._parameters = parameters or EskfParameters()
        self._state: State = blank_state()
        self._outcomes: Outcome = np.zeros(MOST_HELD, OUTCOME)
        self._set_windows(100.0)
        self._begun = False
        self._waiting: list[ImuSample] = []
        self._block = 1
        self._raw: list[ImuSample] = []
        self._astray = False
        self._told_ns: int | None = None
        self.trouble: str | None = None
        """Why tracking cannot begin, in words; ``None`` once it has."""
        self.counts = Counts()

    def _set_windows(self, rate_hz: float) -> None:
        """Fix the windows in samples; the rate may go on being refined, they stay."""
        self._window_rate_hz = rate_hz
        self._kernel = kernel_parameters(self._parameters, rate_hz)
        self._lag = int(self._kernel["half_window"][0] + self._kernel["look_ahead"][0])

    @property
    def rate_hz(self) -> float | None:
        """The true sampling rate as estimated so far; ``None`` before tracking has begun."""
        return self._block * NS_PER_S / self._clock.period_ns if self._begun else None

    @property
    def _clock(self) -> ClockState:
        return ClockState(*(float(self._state[name][0]) for name in ClockState._fields))

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
        direct = self._begun and self._block == 1
        if direct:
            came = self._take_directly(
                self._state, self._outcomes, self._kernel,
                sample.time_ns, *sample.force_m_s2, *sample.rate_rad_s,
            )  # fmt: skip
        else:
            came = judge(self._state, sample.time_ns, *sample.force_m_s2, *sample.rate_rad_s)
        if came == TAKEN:
            return [] if direct else self._prepare(sample)
        return self._settle(came, sample)

    def step_rows(self, samples: Recording, first: int) -> tuple[int, list[Stride]]:
        """Take in samples from row ``first`` on, up to the first that completes strides.

        Return the row after it, and the strides: all is as by :meth:`step` of each.
        """
        if not self._begun or self._block > 1:
            return first + 1, self.step(samples.sample(first))
        row, came = take_rows(
            self._state, self._outcomes, self._kernel,
            samples.time_ns, samples.force_m_s2, samples.rate_rad_s, first,
        )  # fmt: skip
        return row, [] if came == TAKEN else self._settle(came, samples.sample(row - 1))

    def finish(self) -> list[Stride]:
        """Return the strides still held back, judged with what there is; nothing may follow."""
        if not self._begun:
            return []
        self._state["gap"] = -1
        found = finish(self._state, self._outcomes, self._kernel)
        return [stride for i in range(found) for stride in self._told(i)]

    def _settle(self, came: int, sample: ImuSample) -> list[Stride]:
        """Do what ``came`` of a sample asks for beyond taking it."""
        if came == IMPLAUSIBLE:
            self.counts = self.counts._replace(implausible=self.counts.implausible + 1)
            return []
        if came == REPEATED:
            self.counts = self.counts._replace(repeated=self.counts.repeated + 1)
            return []
        strides = self._put_right(sample) if came == MISPLACED else self._told(0)
        if self._astray:
            self._restart([])
        return strides

    def _prepare(self, sample: ImuSample) -> list[Stride]:
        """Hold back a sample that cannot be taken as it is."""
        if not self._begun:
            return self._wait(sample)
        if self._raw and sample.time_ns - self._raw[0].time_ns > 1.5 * self._clock.period_ns:
            self._raw = []  # A block that a gap tears is no average.
        self._raw.append(sample)
        if len(self._raw) < self._block:
            return []
        block, self._raw = self._raw, []
        return self._take(mean_sample(block))

    def _take(self, sample: ImuSample) -> list[Stride]:
        """Take in a sample that has been judged."""
        if not self._begun:
            return self._wait(sample)
        came = take_next(
            self._state, self._outcomes, self._kernel,
            sample.time_ns, *sample.force_m_s2, *sample.rate_rad_s,
        )  # fmt: skip
        return [] if came == TAKEN else self._settle(came, sample)

    def _put_right(self, sample: ImuSample) -> list[Stride]:
        """Take in a sample with others missing before it, or that is late."""
        clock = self._clock
        arrival = place(clock, sample.time_ns)
        fits = arrival.late_by > 0 and self._mend_late(sample, arrival.late_by)
        self._state["misfits"] += not fits
        too_long = arrival.missing * clock.period_ns > LONGEST_GAP_S * NS_PER_S
        if too_long or self._state["misfits"][0] >= MOST_MISFITS:
            strides = self.finish()
            self._restart([sample])
            return strides
        if arrival.late_by:
            return []
        strides = self._hold_places(sample, arrival.missing, clock)
        taken_ns = round(arrival.state.taken_ns)
        return strides + self._push(taken_ns, sample, arrival.state, arrival.dt_s)

    def _push(
        self,
        time_ns: int,
        sample: ImuSample,
        clock: ClockState,
        dt_s: float,
        *,
        bridged: bool = False,
    ) -> list[Stride]:
        closed = accept(
            self._state, self._outcomes, self._kernel, time_ns, clock, dt_s,
            *sample.force_m_s2, *sample.rate_rad_s, bridged,
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
        self._begun, self._block = True, start.block
        first, *others = start.samples
        strides = [] if self._told_ns is None else [self._lost_until(first.time_ns)]
        self._carry_over(start.state)
        self._told_ns = first.time_ns
        strides += self._push(first.time_ns, first, start.clock, start.clock.period_ns / NS_PER_S)
        for sample in others:
            strides += self._take(sample)
        return strides

    def _carry_over(self, begun: State) -> None:
        """After a restart keep what a new levelling cannot know, the heading as the best guess."""
        before, self._state = self._state, begun
        for name in ("stamp_ns", "reading"):
            begun[name] = before[name]
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
        self._state["gap"], self._state["misfits"] = -1, 0
        self._begun, self._astray = False, False
        self._block, self._raw, self._waiting = 1, [], waiting

    def _hold_places(self, sample: ImuSample, missing: int, clock: ClockState) -> list[Stride]:
        """Hold ``missing`` places up to ``sample``, to be bridged when more is known."""
        head = int(self._state["head"][0])
        after = np.array([*sample.force_m_s2, *sample.rate_rad_s], dtype=np.float64)
        rows = foresee_gap(self._state, self._kernel, missing, after).tolist()
        strides: list[Stride] = []
        for i, (fx, fy, fz, wx, wy, wz) in enumerate(rows, 1):
            now = clock._replace(taken_ns=clock.taken_ns + i * clock.period_ns)
            time_ns = round(now.taken_ns)
            held = ImuSample(time_ns, (fx, fy, fz), (wx, wy, wz))
            strides += self._push(time_ns, held, now, clock.period_ns / NS_PER_S, bridged=True)
        self._state["gap"] = head, head + missing - 1
        self.counts = self.counts._replace(
            bridged=self.counts.bridged + missing, gaps=self.counts.gaps + 1
        )
        return strides

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
        self.counts = self.counts._replace(late_mended=self.counts.late_mended + 1)
        return True

    def save(self) -> bytes:
        """Return everything a tracker knows; :func:`resume` makes it again, to the bit."""
        return msgspec.msgpack.encode(
            _Saved(
                self._parameters, self._state.tobytes(), self._window_rate_hz, self._begun,
                self._waiting, self._block, self._raw, self._told_ns, self.trouble, self.counts,
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
    tracker._begun, tracker._waiting = was.begun, was.waiting
    tracker._block, tracker._raw, tracker._told_ns = was.block, was.raw, was.told_ns
    tracker.trouble, tracker.counts = was.trouble, was.counts
    return tracker
