"""A box that is carried, set down and left: what its radio hears and its accelerometer feels."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shared.messages import Vector3
from shared.units import NS_PER_S

Array = NDArray[np.float64]

START_NS = 1_700_000_000 * NS_PER_S
SCAN_HZ = 5.0
SAMPLE_HZ = 25.0
G_M_S2 = 9.81


class Walk(NamedTuple):
    """How far somebody is from the box, in metres, at times in seconds; straight in between."""

    time_s: list[float]
    range_m: list[float]


class Felt(NamedTuple):
    """A stretch of time, and how the box is moved in it."""

    until_s: float
    how: str


SPREAD_M_S2 = {"walked with": 2.0, "held": 0.2, "lying": 0.02, "knocked": 3.0}


def at(time_s: float) -> int:
    return START_NS + round(time_s * NS_PER_S)


def readings(walk: Walk, end_s: float, seed: int) -> Iterator[tuple[int, float]]:
    """Yield times and signal strengths: 40 dB lost at a metre, squared with range, and fading."""
    chance = np.random.default_rng(seed)
    time_s = np.arange(0.0, end_s, 1.0 / SCAN_HZ)
    range_m = np.maximum(np.interp(time_s, walk.time_s, walk.range_m), 0.3)
    body_db = np.interp(time_s, time_s[::25], chance.normal(0.0, 3.0, len(time_s[::25])))
    lost = chance.random(len(time_s)) < 0.1
    dbm = -40.0 - 20.0 * np.log10(range_m) - 6.0 + body_db + chance.normal(0.0, 2.0, len(time_s))
    for each_s, each_dbm, is_lost in zip(time_s.tolist(), dbm.tolist(), lost.tolist(), strict=True):
        if not is_lost:
            yield at(each_s), round(each_dbm)


def samples(
    felt: list[Felt], seed: int, turned_after_s: float = np.inf
) -> list[tuple[int, Vector3]]:
    """Return what the accelerometer reads; after that time the box lies on its side."""
    chance = np.random.default_rng(seed)
    time_s = np.arange(0.0, felt[-1].until_s, 1.0 / SAMPLE_HZ)
    ends_s = [each.until_s for each in felt]
    spreads = np.array([SPREAD_M_S2[each.how] for each in felt])
    spread = spreads[np.searchsorted(ends_s, time_s, side="right")]
    force = chance.normal(size=(len(time_s), 3)) * spread[:, None]
    upright = time_s < turned_after_s
    force[upright, 2] -= G_M_S2
    force[~upright, 0] += G_M_S2
    return [
        (at(each_s), (x, y, z))
        for each_s, (x, y, z) in zip(time_s.tolist(), force.tolist(), strict=True)
    ]
