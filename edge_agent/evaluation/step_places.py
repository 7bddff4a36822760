"""Where steps of a walk out and back are miscounted: setting out, on the way, turning, arriving.

A count that is right as a whole may be made of errors that cancel, and one that is wrong says
nothing of what went wrong. Each landing that no step has found, and each step that no landing has,
is therefore put where it was.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from edge_agent.evaluation.course_truth import ARRIVED_S, arrived_at
from edge_agent.evaluation.truth import Array
from edge_agent.mounts.interface import Increment
from shared.units import NS_PER_S

LANDING_TOLERANCE_S = 0.35
"""A landing is found by a step that ends no further from it; the next foot lands later."""

AT_AN_END = 2
"""So many landings are those of setting out, and of arriving."""

BESIDE_TURN = 2
"""So many landings on either side of the one halfway round are in the turn."""


class StepsOff(NamedTuple):
    """Steps told less landings counted, by where they were. The sum is that of the whole walk."""

    setting_out: int
    way: int
    turn: int
    arriving: int
    arrived: int


class Paired(NamedTuple):
    """Which steps have a landing each (n,), and which landings a step (k,)."""

    steps: NDArray[np.bool_]
    landings: NDArray[np.bool_]


def paired(ended_s: Array, landed_s: Array) -> Paired:
    """Return which of the steps that end at ``ended_s`` (n,) are landings, the nearest first."""
    apart_s = np.abs(ended_s[:, None] - landed_s)
    pairs = zip(*np.unravel_index(np.argsort(apart_s, axis=None), apart_s.shape), strict=True)
    found = Paired(np.zeros(len(ended_s), bool), np.zeros(len(landed_s), bool))
    for step, landing in pairs:
        if apart_s[step, landing] > LANDING_TOLERANCE_S:
            break
        if not found.steps[step] and not found.landings[landing]:
            found.steps[step] = found.landings[landing] = True
    return found


def steps_off(increments: Sequence[Increment], landed_s: Array) -> StepsOff | None:
    """Return where steps told are more, or fewer, than the landings (k,) counted, rising.

    ``None`` of a walk too short to have a way between its ends, or that does not turn about.
    """
    last = arrived_at(landed_s, ARRIVED_S) if len(landed_s) else 0
    turned = _turned_at(increments, landed_s[: last + 1])
    if turned is None:
        return None
    first_back, first_end = turned + BESIDE_TURN, last - AT_AN_END
    ends = (AT_AN_END - 1, turned - BESIDE_TURN - 1, first_back, first_end, last)
    if list(ends) != sorted(set(ends)):
        return None
    # A place ends halfway to the first landing of the next; the last one with the recording.
    middles_s = np.append(0.5 * (landed_s[:-1] + landed_s[1:]), math.inf)
    ended_s = np.array([one.end_time_ns for one in increments if one.steps]) / NS_PER_S
    found = paired(ended_s, landed_s)
    edges_s = np.array([-math.inf, *middles_s[list(ends)], math.inf])
    told = np.searchsorted(edges_s, ended_s[~found.steps]) - 1
    missed = np.searchsorted(edges_s, landed_s[~found.landings]) - 1
    off = np.bincount(told, minlength=6) - np.bincount(missed, minlength=6)
    setting_out, out, turn, back, arriving, arrived = (int(one) for one in off)
    return StepsOff(setting_out, out + back, turn, arriving, arrived)


def _turned_at(increments: Sequence[Increment], landed_s: Array) -> int | None:
    """Return the landing nearest to where the trunk has turned halfway about, if it does."""
    ended_s = np.array([one.end_time_ns for one in increments]) / NS_PER_S
    walked = ended_s <= landed_s[-1] if len(landed_s) else np.zeros(0, bool)
    if np.count_nonzero(walked) < 2 * AT_AN_END:
        return None
    turned_rad = np.cumsum([one.d_heading_rad for one in increments])[walked]
    third = len(turned_rad) // 3
    out_rad, back_rad = np.median(turned_rad[:third]), np.median(turned_rad[-third:])
    if abs(back_rad - out_rad) < 0.5 * math.pi:
        return None
    beyond = (turned_rad - out_rad) / (back_rad - out_rad) >= 0.5
    half_s = ended_s[walked][int(np.argmax(beyond))]
    return int(np.argmin(np.abs(landed_s - half_s)))
