"""Samples as evenly as the sensor took them: the jitter of stamps is taken out.

What shakes a vehicle is told apart within a hundredth of a second, so stamps that are off by half
of one, as those of a program that stamps what it hears, spoil it. A clock that follows the stamps
(``inertial/sample_clock.py``) tells when each sample was really taken. Stamps that lie on a grid
are left as they are, and so are those of which so many are lost that nobody knows their number.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import msgspec
import numpy as np

from edge_agent.inertial.sample_clock import (
    GRID_JITTER,
    SHORTEST_FOR_PERIOD,
    ClockState,
    place,
    start_clock,
)
from shared.messages import ImuSample

REMEMBERED = 256
"""So many stamps tell the rate anew, where it has changed."""

FINEST_GRID = 0.4
"""Of the usual step: where most of every second sample are thrown away, the grid is finer."""

FEW = 0.02
"""So many steps may be shorter than the grid's."""

MOST_WANDER = 3.0
"""Stamps that only jitter are off the even ones by as much as steps are by √2 of it; those of
samples lost, unnoticed among the jitter, wander away."""

BEHIND_GAIN = 0.125
"""Of a clock that is half a period behind the last few stamps: a sample was lost."""


class SteadySamples:
    """Passes samples on, in order, each later than the last.

    ``stamps_ns`` are those of the first seconds, before any is taken: the rate is told by them.
    """

    def __init__(self, stamps_ns: Sequence[int]) -> None:
        self._stamps_ns: deque[int] = deque(maxlen=REMEMBERED)
        self._clock: ClockState | None = None
        self._behind_ns = 0.0
        self._last_ns = stamps_ns[0] - 1 if stamps_ns else -1
        self._start(stamps_ns)

    def take(self, sample: ImuSample) -> ImuSample:
        """Return ``sample`` as of when it was taken, later than the one before."""
        self._stamps_ns.append(sample.time_ns)
        if self._clock is not None:
            arrival = place(self._clock, sample.time_ns)
            if arrival.late_by:
                self._start_anew()
            else:
                self._clock = self._caught_up(arrival.state, sample.time_ns)
                sample = _stamped(sample, round(self._clock.taken_ns))
        if sample.time_ns <= self._last_ns:
            sample = _stamped(sample, self._last_ns + 1)
        self._last_ns = sample.time_ns
        return sample

    def _caught_up(self, clock: ClockState, stamp_ns: int) -> ClockState:
        """Return ``clock``, set on by a period if it has missed that a sample was lost."""
        self._behind_ns += BEHIND_GAIN * (stamp_ns - clock.taken_ns - self._behind_ns)
        if self._behind_ns < 0.5 * clock.period_ns:
            return clock
        self._behind_ns -= clock.period_ns
        return clock._replace(taken_ns=clock.taken_ns + clock.period_ns)

    def _start_anew(self) -> None:
        """Set the clock by the stamps remembered, to the last of them: the rate has changed."""
        stamps_ns = list(self._stamps_ns)
        self._start(stamps_ns)
        for stamp_ns in stamps_ns:
            if self._clock is not None and not (arrival := place(self._clock, stamp_ns)).late_by:
                self._clock = arrival.state

    def _start(self, stamps_ns: Sequence[int]) -> None:
        """Set a clock to just before the first of ``stamps_ns``, if these jitter."""
        self._clock, self._behind_ns = None, 0.0
        if len(stamps_ns) < SHORTEST_FOR_PERIOD:
            return
        clock = start_clock(stamps_ns)
        steps_ns = np.diff(np.asarray(stamps_ns, dtype=np.float64))
        step_jitter_ns = float(np.mean(np.abs(steps_ns - clock.period_ns)))
        off_ns = clock.jitter_ns
        if (
            GRID_JITTER * clock.period_ns < off_ns < MOST_WANDER * step_jitter_ns / np.sqrt(2.0)
        ) and not _on_grid(stamps_ns):
            self._clock = clock._replace(taken_ns=clock.taken_ns - clock.period_ns)


def _on_grid(stamps_ns: Sequence[int]) -> bool:
    """Whether stamps lie on a grid finer than their usual step."""
    since_ns = np.asarray(stamps_ns, dtype=np.float64) - stamps_ns[0]
    steps_ns = np.diff(since_ns)
    finest_ns = float(np.quantile(steps_ns, FEW))
    if finest_ns < FINEST_GRID * float(np.median(steps_ns)):
        return False
    places = np.round(since_ns / finest_ns)
    finest_ns = float(places @ since_ns / (places @ places))
    return float(np.mean(np.abs(since_ns - finest_ns * places))) < GRID_JITTER * finest_ns


def _stamped(sample: ImuSample, time_ns: int) -> ImuSample:
    return msgspec.structs.replace(sample, time_ns=time_ns)
