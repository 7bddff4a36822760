"""What the boot's filter knows, as one record of fixed size, and what it says of a stride.

Saving a state is copying its bytes. Everything that has a length in time is a ring of
:data:`eskf_parameters.CAPACITY` slots; slot ``i`` lies at ``i & (CAPACITY - 1)``.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from edge_agent.inertial.eskf_parameters import CAPACITY, EskfParameters
from edge_agent.inertial.foot_mechanisation import level_quaternion
from edge_agent.inertial.sample_ring import SAMPLE_WIDTH
from edge_agent.inertial.stride_path import NO_PATH, StridePath
from edge_agent.inertial.stride_smoothing import HISTORY_WIDTH
from edge_agent.inertial.zupt_filter import ROLLING_HEIGHT, STATES
from shared.maths.rotations import IDENTITY, Quaternion, Vector3
from shared.units import NS_PER_S

StateRecord: TypeAlias = Any
"""One record of :data:`STATE`, whose fields numba reads as attributes."""

OutcomeRecord: TypeAlias = Any
"""One record of :data:`OUTCOME`."""

STRIDE, STANDING, UNFINISHED, LOST = 1, 2, 3, 4
"""Kinds of outcome (see :class:`Stride`)."""

STATE = np.dtype(
    [
        # the filter
        ("position_m", "f8", (3,)),
        ("velocity_m_s", "f8", (3,)),
        ("quat_wxyz", "f8", (4,)),
        ("force_bias_m_s2", "f8", (3,)),
        ("rate_bias_rad_s", "f8", (3,)),
        ("rolling_height_m", "f8"),
        ("covariance", "f8", (STATES, STATES)),
        ("peak_speed_m_s", "f8"),
        ("since_update_s", "f8"),
        ("swing_innovation", "f8"),
        ("corrected_down_m_s", "f8"),  # by updates since the last stride's end
        # slots: newest sample, newest statistic, end of the last smoothed stretch, its anchor
        ("head", "i8"),
        ("filtered", "i8"),
        ("boundary", "i8"),
        ("anchor", "i8"),
        ("candidate", "i8"),
        ("still_since", "i8"),
        ("last_moving", "i8"),
        ("zero_rate_first", "i8"),
        ("zero_rate_last", "i8"),
        ("zero_rate_told", "i8"),
        ("candidate_statistic", "f8"),
        ("candidate_peak_m_s", "f8"),
        ("anchor_position_m", "f8", (3,)),
        ("anchor_quat_wxyz", "f8", (4,)),
        ("heading_rad", "f8"),
        # intake: the clock samples are placed by (a period of 0: not begun), the newest raw
        # sample, how many more samples came out of their time than in it, a gap to be bridged
        ("period_ns", "f8"),
        ("taken_ns", "f8"),
        ("jitter_ns", "f8"),
        ("stamp_ns", "i8"),
        ("reading", "f8", (6,)),
        ("misfits", "i8"),
        ("gap", "i8", (2,)),
        # rings
        ("time_ns", "i8", (CAPACITY,)),
        ("samples", "f8", (CAPACITY, SAMPLE_WIDTH)),
        ("flat_tops", "i8", (3, 2)),
        ("fastest_rad_s", "f8", (3,)),
        ("statistic", "f8", (CAPACITY,)),
        ("history", "f8", (CAPACITY, HISTORY_WIDTH)),
        ("path", "f8", (CAPACITY, 4)),
    ]
)
"""The record that is the state; one of it, in an array of one, is what :func:`step` takes."""

OUTCOME = np.dtype(
    [
        ("kind", "i8"),
        ("first_slot", "i8"),
        ("last_slot", "i8"),
        ("start_slot", "i8"),
        ("end_slot", "i8"),
        ("start_ns", "i8"),
        ("end_ns", "i8"),
        ("displacement_m", "f8", (3,)),
        ("heading_change_rad", "f8"),
        ("heading_rad", "f8"),
        ("covariance", "f8", (4, 4)),
        ("peak_speed_m_s", "f8"),
        ("highest_m", "f8"),
        ("lowest_m", "f8"),
        ("statistic", "f8"),
        ("rolling_height_m", "f8"),
        ("end_quat_wxyz", "f8", (4,)),
        ("lean", "f8", (2,)),
    ]
)
"""What :func:`step` writes when it closes a stride (see :class:`Stride`)."""

State = NDArray[np.void]
Outcome = NDArray[np.void]

BEYOND_PRIOR = 4.5
"""So many standard deviations off at the start, a mean rate says the gyro's prior is not for it."""

TOP_SPEED_M_S = 10.0
LARGEST_SD_M, LARGEST_SD_RAD = 30.0, math.pi
"""A stride faster on average, or less sure, is no stride: the filter has gone astray."""


class Stride(NamedTuple):
    """Movement of the boot between two of its stances, in the tracker's north-east-down frame.

    ``kind`` is STRIDE from stance to stance, STANDING about every second of it, UNFINISHED when
    no stance has come for the longest stride, LOST where nothing but the time is known: then
    numbers are zero. ``covariance`` (4×4) is of (north, east, down, heading) given the heading at
    the start, m², m·rad, rad². ``highest_m`` and ``lowest_m`` are of the foot's path above where
    the stride began. ``statistic`` is the stance's; ``rolling_height_m`` the wearer's. ``path``
    has one point a sample, from zero to the displacement. ``carried_down_m``, of the displacement,
    was a lift's. ``nav_from_body`` is the sensor's attitude at the end. ``lean`` is which way,
    north and east, what pointed up at the start leant over the stride, as a mean of sines.
    """

    kind: int
    start_ns: int
    end_ns: int
    displacement_m: Vector3
    heading_change_rad: float
    heading_rad: float
    covariance: tuple[tuple[float, ...], ...]
    peak_speed_m_s: float
    highest_m: float
    lowest_m: float
    statistic: float
    rolling_height_m: float
    path: StridePath
    carried_down_m: float = 0.0
    nav_from_body: Quaternion = IDENTITY
    lean: tuple[float, float] = (0.0, 0.0)


def blank_state() -> State:
    """Return the state before any sample."""
    state = np.zeros(1, STATE)
    state["reading"] = np.nan
    state["gap"] = -1
    return state


def initial_state(
    parameters: EskfParameters,
    forces_m_s2: NDArray[np.float64],
    rates_rad_s: NDArray[np.float64],
) -> State:
    """Return the state of a boot levelled on its stillest moment (n×3 each), heading 0.

    The mean rate of so short a moment is no gyro bias, unless it is beyond what the prior and the
    moment's own trembling allow: then the gyro is worse than most, and the prior is not for it. A
    foot that was never still is levelled roughly.
    """
    force_m_s2, rate_rad_s = forces_m_s2.mean(axis=0), rates_rad_s.mean(axis=0)
    turning = float(np.sqrt(np.mean(np.sum(rates_rad_s**2, axis=1))))
    trembling = float(np.sqrt(np.mean(np.sum((rates_rad_s - rate_rad_s) ** 2, axis=1))))
    moving = turning > parameters.moving_rate_rad_s
    turned_rad_s = float(np.linalg.norm(rate_rad_s))
    prior_rad_s = parameters.initial_rate_bias_sd_rad_s
    doubt_rad_s = math.hypot(parameters.zero_rate_sd_rad_s, parameters.sway_share * trembling)
    biased = not moving and turned_rad_s > BEYOND_PRIOR * math.hypot(prior_rad_s, doubt_rad_s)
    state = blank_state()
    s = state[0]
    s["quat_wxyz"] = s["anchor_quat_wxyz"] = level_quaternion(force_m_s2)
    norm = float(np.linalg.norm(force_m_s2))
    if not moving and abs(norm - parameters.gravity_m_s2) < 0.5:
        s["force_bias_m_s2"] = force_m_s2 * (1.0 - parameters.gravity_m_s2 / norm)
    s["rolling_height_m"] = parameters.rolling_height_m
    sd = np.zeros(STATES)
    sd[3:6] = 1.0 if moving else parameters.initial_velocity_sd_m_s
    sd[6:8] = parameters.moving_tilt_sd_rad if moving else parameters.initial_tilt_sd_rad
    sd[9:12] = parameters.initial_force_bias_sd_m_s2
    sd[12:15] = max(doubt_rad_s, 0.25 * turned_rad_s) if biased else prior_rad_s
    if biased:
        s["rate_bias_rad_s"] = rate_rad_s
    sd[ROLLING_HEIGHT] = parameters.rolling_height_sd_m
    s["covariance"] = np.diag(sd**2)
    for name in (
        "candidate", "still_since", "zero_rate_first", "zero_rate_last", "zero_rate_told",
        "flat_tops",
    ):  # fmt: skip
        s[name] = -1
    s["statistic"] = np.inf
    return state


def credible(outcome: OutcomeRecord) -> bool:
    """Whether a boot can have moved so; comparisons with NaN are false."""
    duration_s = (int(outcome["end_ns"]) - int(outcome["start_ns"])) / NS_PER_S
    covariance = outcome["covariance"].ravel().tolist()
    nn, ee, dd, hh = covariance[::5]
    return (
        math.hypot(*outcome["displacement_m"].tolist()) <= TOP_SPEED_M_S * duration_s
        and nn <= LARGEST_SD_M**2
        and ee <= LARGEST_SD_M**2
        and dd <= LARGEST_SD_M**2
        and hh <= LARGEST_SD_RAD**2
        and math.isfinite(float(outcome["heading_rad"]) + sum(covariance))
    )


def stride_of(outcome: OutcomeRecord, state: StateRecord) -> Stride:
    """Read one record of :data:`OUTCOME`, and its path from the ring of ``state``."""
    start, end = int(outcome["start_slot"]), int(outcome["end_slot"])
    displacement_m = outcome["displacement_m"]
    path_m = _unrolled(state["path"], start, end)[:, :3]
    path_m += displacement_m - path_m[-1]
    path_m[0], path_m[-1] = 0.0, displacement_m
    north, east, down = displacement_m.tolist()
    w, x, y, z = outcome["end_quat_wxyz"].tolist()
    lean_north, lean_east = outcome["lean"].tolist()
    return Stride(
        kind=int(outcome["kind"]),
        start_ns=int(outcome["start_ns"]),
        end_ns=int(outcome["end_ns"]),
        displacement_m=(north, east, down),
        heading_change_rad=float(outcome["heading_change_rad"]),
        heading_rad=float(outcome["heading_rad"]),
        covariance=tuple(map(tuple, outcome["covariance"].tolist())),
        peak_speed_m_s=float(outcome["peak_speed_m_s"]),
        highest_m=float(outcome["highest_m"]),
        lowest_m=float(outcome["lowest_m"]),
        statistic=float(outcome["statistic"]),
        rolling_height_m=float(outcome["rolling_height_m"]),
        nav_from_body=(w, x, y, z),
        lean=(lean_north, lean_east),
        path=StridePath(_unrolled(state["time_ns"], start, end), path_m),
    )


def _unrolled(ring: NDArray[Any], first: int, last: int) -> NDArray[Any]:
    """Return a copy of slots ``first … last`` of ``ring``, in order."""
    begin, end = first & (CAPACITY - 1), last & (CAPACITY - 1)
    if begin <= end:
        return ring[begin : end + 1].copy()
    return np.concatenate((ring[begin:], ring[: end + 1]))


def lost_stride(start_ns: int, end_ns: int, heading_rad: float) -> Stride:
    """Return what is known of a boot that was lost between two moments: the time."""
    return Stride(
        kind=LOST,
        start_ns=start_ns,
        end_ns=end_ns,
        displacement_m=(0.0, 0.0, 0.0),
        heading_change_rad=0.0,
        heading_rad=heading_rad,
        covariance=((0.0,) * 4,) * 4,
        peak_speed_m_s=0.0,
        highest_m=0.0,
        lowest_m=0.0,
        statistic=0.0,
        rolling_height_m=0.0,
        path=NO_PATH,
    )
