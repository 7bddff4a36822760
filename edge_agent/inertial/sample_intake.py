"""Samples as they come: judged, placed in time and stepped, one at a time or many in one call.

:func:`take` is the online path whole, as far as nothing is amiss with a sample; :func:`take_rows`
is the same over arrays. What is amiss is left to the caller, for it is rare.
"""

from __future__ import annotations

from functools import cache
from typing import cast

import numpy as np
from numba.core.dispatcher import Dispatcher
from numpy.typing import NDArray

from edge_agent.inertial.boot_state import OUTCOME, Outcome, State, StateRecord, initial_state
from edge_agent.inertial.boot_strides import (
    MOST_HELD,
    bridge_pending,
    finish,
    foresee_gap,
    mend_sample,
    step,
)
from edge_agent.inertial.eskf_parameters import EskfParameters, Parameters, kernel_parameters
from edge_agent.inertial.sample_clock import ClockState, place
from shared.compiled import compiled
from shared.units import NS_PER_S

HARDEST_M_S2, FASTEST_RAD_S = 700.0, 80.0
"""No boot gives more, on any axis."""

TAKEN, CLOSED, MISPLACED, IMPLAUSIBLE, REPEATED = range(5)
"""What came of a sample. ``CLOSED``: taken, and the outcome holds a new stride. The last three are
not taken: samples are missing before it or it is late, no boot can give it, the last one again."""


@compiled
def plausible(fx: float, fy: float, fz: float, wx: float, wy: float, wz: float) -> bool:
    """Whether a boot can give such a specific force and rate; a comparison with NaN is false."""
    return (
        -HARDEST_M_S2 <= fx <= HARDEST_M_S2
        and -HARDEST_M_S2 <= fy <= HARDEST_M_S2
        and -HARDEST_M_S2 <= fz <= HARDEST_M_S2
        and -FASTEST_RAD_S <= wx <= FASTEST_RAD_S
        and -FASTEST_RAD_S <= wy <= FASTEST_RAD_S
        and -FASTEST_RAD_S <= wz <= FASTEST_RAD_S
    )


@compiled
def is_new(
    s: StateRecord,
    stamp_ns: int,
    fx: float,
    fy: float,
    fz: float,
    wx: float,
    wy: float,
    wz: float,
) -> bool:
    """Whether a sample is not the last one sent again; remember it as the last."""
    r = s.reading
    if (
        stamp_ns == s.stamp_ns
        and fx == r[0]
        and fy == r[1]
        and fz == r[2]
        and wx == r[3]
        and wy == r[4]
        and wz == r[5]
    ):
        return False
    s.stamp_ns = stamp_ns
    r[0], r[1], r[2], r[3], r[4], r[5] = fx, fy, fz, wx, wy, wz
    return True


@compiled
def judge(
    state: State,
    stamp_ns: int,
    fx: float,
    fy: float,
    fz: float,
    wx: float,
    wy: float,
    wz: float,
) -> int:
    """Return ``TAKEN`` for a sample fit to be taken, or else why it is not."""
    if not plausible(fx, fy, fz, wx, wy, wz):
        return IMPLAUSIBLE
    return TAKEN if is_new(state[0], stamp_ns, fx, fy, fz, wx, wy, wz) else REPEATED


@compiled
def bridge_when_known(state: State, parameters: Parameters) -> None:
    """Bridge the latest gap once enough has come after it, or the filter is near."""
    s, p = state[0], parameters[0]
    first, last = s.gap[0], s.gap[1]
    if first < 0:
        return
    reach = s.head - p.half_window - p.look_ahead
    if s.head - 1 - last >= p.bridge_margin or reach >= first - 1:
        bridge_pending(state, parameters)


@compiled
def accept(
    state: State,
    outcome: Outcome,
    parameters: Parameters,
    time_ns: int,
    clock: ClockState,
    dt_s: float,
    fx: float,
    fy: float,
    fz: float,
    wx: float,
    wy: float,
    wz: float,
    bridged: bool,
) -> bool:
    """Step a sample taken at ``time_ns``, by ``clock``; whether it has closed a stride."""
    s = state[0]
    s.period_ns, s.taken_ns, s.jitter_ns = clock.period_ns, clock.taken_ns, clock.jitter_ns
    closed = step(state, outcome, parameters, time_ns, fx, fy, fz, wx, wy, wz, dt_s, bridged)
    if not bridged:
        bridge_when_known(state, parameters)
    return closed


@compiled
def take_next(
    state: State,
    outcome: Outcome,
    parameters: Parameters,
    stamp_ns: int,
    fx: float,
    fy: float,
    fz: float,
    wx: float,
    wy: float,
    wz: float,
) -> int:
    """Take a sample that has been judged, if it is the next: TAKEN, CLOSED or MISPLACED."""
    s = state[0]
    arrival = place(ClockState(s.period_ns, s.taken_ns, s.jitter_ns), stamp_ns)
    if arrival.missing > 0 or arrival.late_by > 0:
        return MISPLACED
    s.misfits = max(0, s.misfits - 1)
    clock = arrival.state
    # It never is: a constant would have what follows compiled anew.
    bridged = arrival.missing > 0
    closed = accept(
        state, outcome, parameters, round(clock.taken_ns), clock, arrival.dt_s,
        fx, fy, fz, wx, wy, wz, bridged,
    )  # fmt: skip
    return CLOSED if closed else TAKEN


@compiled
def take(
    state: State,
    outcome: Outcome,
    parameters: Parameters,
    stamp_ns: int,
    fx: float,
    fy: float,
    fz: float,
    wx: float,
    wy: float,
    wz: float,
) -> int:
    """Take one sample as the sensor sent it, if nothing is amiss; say what came of it.

    Specific force in m/s², angular rate in rad/s, sensor axes.
    """
    verdict = judge(state, stamp_ns, fx, fy, fz, wx, wy, wz)
    if verdict != TAKEN:
        return verdict
    return take_next(state, outcome, parameters, stamp_ns, fx, fy, fz, wx, wy, wz)


@compiled
def take_rows(
    state: State,
    outcome: Outcome,
    parameters: Parameters,
    stamps_ns: NDArray[np.int64],
    force_m_s2: NDArray[np.float64],
    rate_rad_s: NDArray[np.float64],
    first: int,
) -> tuple[int, int]:
    """Take rows from ``first`` on, up to one of which more than ``TAKEN`` is to be said.

    Returns the row after it, and what came of it.
    """
    for i in range(first, stamps_ns.shape[0]):
        f, w = force_m_s2[i], rate_rad_s[i]
        verdict = take(state, outcome, parameters, stamps_ns[i], f[0], f[1], f[2], w[0], w[1], w[2])
        if verdict != TAKEN:
            return i + 1, verdict
    return stamps_ns.shape[0], TAKEN


@cache
def compile_kernels() -> None:
    """Have every kernel that a tracker calls ready, compiled or read from disk, once a process.

    What they compile to is then fixed: other types of numbers are cast, never compiled for.
    """
    parameters = EskfParameters()
    kernel = kernel_parameters(parameters, 100.0)
    resting, still = np.array([[0.0, 0.0, -parameters.gravity_m_s2]]), np.zeros((1, 3))
    state, outcomes = initial_state(parameters, resting, still), np.zeros(MOST_HELD, OUTCOME)
    reading = (0.0, 0.0, -parameters.gravity_m_s2, 0.0, 0.0, 0.0)
    clock = place(ClockState(0.01 * NS_PER_S, 0.0, 0.0), 0).state
    judge(state, 0, *reading)
    accept(state, outcomes, kernel, 0, clock, 0.01, *reading, False)
    take_next(state, outcomes, kernel, 0, *reading)
    take(state, outcomes, kernel, 0, *reading)
    take_rows(state, outcomes, kernel, np.zeros(1, np.int64), resting, still, 0)
    foresee_gap(state, kernel, 1, np.zeros(6))
    mend_sample(state, kernel, 0, resting[0], still[0])
    finish(state, outcomes, kernel)
    for called in (
        place,
        judge,
        accept,
        take_next,
        take,
        take_rows,
        foresee_gap,
        mend_sample,
        finish,
    ):
        cast(Dispatcher, called).disable_compile()
