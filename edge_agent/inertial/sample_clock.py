"""When a sample was really taken: the true rate, gaps, repeats and late arrivals.

A sensor's nominal rate is not its true one (400 Hz named, 397.7 Hz measured), and stamps made on
arrival jitter by several periods. A second-order phase-locked loop follows the stamps: the period
comes from them all, one stamp moves time little, and no time is lost. A sample missing is told
from a stamp that jitters by how much this source is used to jitter.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from shared.compiled import compiled

PHASE_GAIN = 0.02
PERIOD_GAIN = 1e-4
JITTER_GAIN = 0.01
SHORTEST_FOR_PERIOD = 8
GRID_JITTER = 0.1


class ClockState(NamedTuple):
    """What the loop knows: the period, when the newest sample was taken, and the usual jitter."""

    period_ns: float
    taken_ns: float
    jitter_ns: float


class Arrival(NamedTuple):
    """One sample placed in time.

    ``missing`` samples are lacking before it (0: none); ``late_by`` says how many samples ago it
    should have come (0: it is the newest). ``dt_s`` is since the sample before, or since the last
    missing one.
    """

    state: ClockState
    dt_s: float
    missing: int
    late_by: int


def start_clock(stamps_ns: Sequence[int]) -> ClockState:
    """Return a clock that has seen ``stamps_ns``, in order, and stands at the first of them.

    Where the stamps lie on a grid but for lost ones, the grid's spacing is the period. Where they
    jitter too much for that, it is the median of slopes over half the stamps (Theil 1950).
    Raises ValueError on fewer than 8 stamps or on time standing still.
    """
    stamps = np.asarray(stamps_ns, dtype=np.float64)
    if stamps.size < SHORTEST_FOR_PERIOD:
        raise ValueError(f"{stamps.size} stamps tell no rate: give {SHORTEST_FOR_PERIOD} or more")
    since = stamps - stamps[0]
    period = float(np.median(np.diff(stamps)))
    if period > 0.0:
        places = np.round(since / period)
        period = float(places @ since / (places @ places))
        jitter = float(np.mean(np.abs(since - places * period)))
        if jitter < GRID_JITTER * period:
            return ClockState(period, float(stamps[0]), jitter)
    lag = stamps.size // 2
    period = float(np.median((stamps[lag:] - stamps[:-lag]) / lag))
    if not period > 0.0:
        raise ValueError("the stamps stand still: does the source stamp its samples?")
    drawn = since - np.arange(stamps.size) * period
    return ClockState(period, float(stamps[0]), float(np.mean(np.abs(drawn - np.median(drawn)))))


@compiled
def place(state: ClockState, stamp_ns: int) -> Arrival:
    """Place the next sample, stamped ``stamp_ns``, after what ``state`` has seen."""
    period, taken, jitter = state.period_ns, state.taken_ns, state.jitter_ns
    residual = stamp_ns - (taken + period)
    usual = 4.0 * jitter
    if residual < -(0.5 * period + usual):
        return Arrival(state, 0.0, 0, max(1, round(-residual / period)))
    missing = 0
    if residual > 0.5 * period + usual:
        missing = round(residual / period)
        residual -= missing * period
    step = period + PHASE_GAIN * residual
    state = ClockState(
        period + PERIOD_GAIN * residual,
        taken + missing * period + step,
        jitter + JITTER_GAIN * (min(abs(residual), 3.0 * period) - jitter),
    )
    return Arrival(state, step * 1e-9, missing, 0)
