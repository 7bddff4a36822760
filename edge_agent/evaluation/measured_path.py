"""Stances read off a path that was measured evenly, as motion capture does: where it stood still.

Apart from the truth itself, for who walks a simulated way needs no filter and does not wait for
its library.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from edge_agent.evaluation.truth import Array, Height, Speed, Truth

STILL_M_S = 0.15
"""A boot in motion capture stands below this speed; the sensor above a rolling foot never stops."""

FEWEST_SAMPLES = 5
SHORTEST_STANCE_S = 0.06
SMOOTHING_S = 0.075
SAME_PLACE_M = 0.10
"""Stances nearer than this to the one before are the same: a shuffle on the spot."""


def truth_of_path(time_s: Array, position_m: Array) -> Truth:
    """Return the truth of a path measured evenly: ``position_m`` (n, 3) NED at ``time_s`` (n,).

    A stance is where the speed is below ``STILL_M_S`` for at least ``SHORTEST_STANCE_S``; its
    instant is the middle. Where the capture lost the boot (:func:`bridge_holds`) it is taken to
    have moved evenly. Raises ``ValueError`` on numbers that are no path.
    """
    if not (np.isfinite(position_m).all() and np.isfinite(time_s).all()):
        raise ValueError("not all finite")
    if len(time_s) < FEWEST_SAMPLES or not np.all(np.diff(time_s) > 0.0):
        raise ValueError(f"not {FEWEST_SAMPLES} samples or more at rising times")
    period_s = float(time_s[-1] - time_s[0]) / (len(time_s) - 1)
    window = max(5, round(SMOOTHING_S / period_s) | 1)
    if window > len(time_s):
        raise ValueError("shorter than it takes to tell a speed")
    position_m, lost = bridge_holds(time_s, position_m)
    velocity_m_s = savgol_filter(position_m, window, 2, deriv=1, delta=period_s, axis=0)
    speed_m_s = np.linalg.norm(velocity_m_s, axis=1)
    begins, ends = _runs(speed_m_s < STILL_M_S)
    long_enough = ends - begins >= int(SHORTEST_STANCE_S / period_s)
    middles = ((begins + ends) // 2)[long_enough]
    stances = middles[_apart(position_m[middles, :2])]
    return Truth(
        time_s[stances],
        position_m[stances, :2],
        Height(time_s, position_m[:, 2]),
        Speed(time_s, np.where(lost, np.nan, speed_m_s)),
    )


def bridge_holds(time_s: Array, position_m: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return ``position_m`` (n, 3) with false holds bridged evenly, and which rows (n,) those are.

    Motion capture that loses its markers repeats the last position, to the bit, until it has them
    again, or leaps to where it will have them and waits there: taken as it is, a boot in full
    swing would stand. A repeated position is false where from the row before it to the row after
    it the boot has moved on faster than ``STILL_M_S``.
    """
    bridged_m, lost = position_m.copy(), np.zeros(len(time_s), dtype=np.bool_)
    firsts, lasts = _runs(np.all(np.diff(position_m, axis=0) == 0.0, axis=1))
    for first, last in zip(firsts, lasts, strict=True):
        before, after = max(first - 1, 0), min(last + 1, len(time_s) - 1)
        moved_m = position_m[after] - position_m[before]
        if np.linalg.norm(moved_m) > STILL_M_S * (time_s[after] - time_s[before]):
            rows = slice(before + 1, after)
            share = (time_s[rows] - time_s[before]) / (time_s[after] - time_s[before])
            bridged_m[rows] = position_m[before] + share[:, None] * moved_m
            lost[rows] = True
    return bridged_m, lost


def _runs(is_so: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return where each run of true rows begins, and the row after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], is_so.astype(np.int8), [0]))))
    return edges[0::2], edges[1::2]


def _apart(position_m: Array) -> list[int]:
    """Return the rows of ``position_m`` that are not at the place of the row kept before."""
    kept: list[int] = []
    for row, position in enumerate(position_m):
        if not kept or np.linalg.norm(position - position_m[kept[-1]]) > SAME_PLACE_M:
            kept.append(row)
    return kept
