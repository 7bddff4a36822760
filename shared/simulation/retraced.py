"""Somebody who walks where somebody else was seen to: a known way, with a boot's footfalls."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.simulation.route import Footfall
from shared.simulation.walker import BodyTrack, Walk

Array: TypeAlias = NDArray[np.float64]

STRIDE_S = 1.12
SWING_S = 0.45
LOOKED_AT_S = 0.01
LEAST_STRIDE_M = 0.15
"""Who has moved on less than this since their last footfall has not lifted the boot."""


def walk_along(time_s: Array, position_m: Array, chance: np.random.Generator) -> Walk:
    """Return a walk along ``position_m`` (n ≥ 2, 3) NED at the rising times ``time_s`` (n,).

    The boot comes down under the body once a stride, or when that has gone far enough for one, and
    faces the way that the body goes.
    """
    at_s = np.arange(time_s[0], time_s[-1], LOOKED_AT_S)
    place_m = np.column_stack([np.interp(at_s, time_s, axis) for axis in position_m.T])
    kept = [0]
    for k in range(len(at_s)):
        # Who stands for a while does not do so for a whole number of strides.
        is_due = k - kept[-1] >= round(STRIDE_S / LOOKED_AT_S)
        if is_due and np.linalg.norm(place_m[k] - place_m[kept[-1]]) >= LEAST_STRIDE_M:
            kept.append(k)
    at_s, place_m = at_s[kept], place_m[kept]
    moved_m = np.diff(place_m, axis=0, append=place_m[-1:])
    facing_rad = np.unwrap(np.arctan2(moved_m[:, 1], moved_m[:, 0]))
    if len(facing_rad) > 1:
        facing_rad[-1] = facing_rad[-2]
    stood_s = STRIDE_S - SWING_S
    return Walk(
        body=BodyTrack(at_s, place_m, facing_rad),
        footfalls=[
            Footfall("walk", STRIDE_S, place, place, float(facing), 0.0)
            for place, facing in zip(place_m, facing_rad.tolist(), strict=True)
        ],
        reached_s=at_s - 0.5 * stood_s,
        left_s=np.append(at_s[1:] - 0.5 * stood_s - SWING_S, at_s[-1] + 0.5 * stood_s),
        installed={},
        chance=chance,
    )
