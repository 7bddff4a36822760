"""Outlines of few corners: rings simplified, and holes cut open to the ring around them."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]

CORNERS = 64
_LEAST_CORNERS = 6
_MOST_HOLES = 4


def outline(rings: list[Floats]) -> Floats:
    """Return one outline of at most 64 corners (m, 2) for an outer ring and the holes in it.

    Only the largest holes are kept. A hole runs against its outer ring and is joined to it by a
    cut there and back, so that what is within by the even-odd rule, or the nonzero one, is what
    is between them.
    """
    outer, *holes = rings
    holes = sorted(holes, key=lambda ring: -abs(twice_area(ring)))[:_MOST_HOLES]
    corners = CORNERS - 2 * len(holes)
    lengths = [len(ring) for ring in (outer, *holes)]
    shares = [max(corners * length // sum(lengths), _LEAST_CORNERS) for length in lengths]
    shares[0] = corners - sum(shares[1:])
    whole = simplified(outer, shares[0])
    for hole, share in zip(holes, shares[1:], strict=True):
        whole = _cut_open(whole, simplified(hole, share))
    return whole


@compiled
def simplified(ring: Floats, corners: int) -> Floats:
    """Return a closed ring with at most so many corners.

    Time and again the corner goes that spans the smallest triangle with its neighbours
    (Visvalingam and Whyatt 1993).
    """
    kept = ring.copy()
    left = len(ring)
    while left > corners:
        least, goes = np.inf, 0
        for i in range(left):
            before, after = kept[i - 1 if i > 0 else left - 1], kept[i + 1 if i + 1 < left else 0]
            u_north, u_east = kept[i, 0] - before[0], kept[i, 1] - before[1]
            v_north, v_east = after[0] - before[0], after[1] - before[1]
            area = abs(u_north * v_east - u_east * v_north)
            if area < least:
                least, goes = area, i
        for i in range(goes, left - 1):
            kept[i] = kept[i + 1]
        left -= 1
    return kept[:left].copy()


def twice_area(ring: Floats) -> float:
    """Return twice the signed area of a closed ring."""
    after = np.roll(ring, -1, axis=0)
    return float((ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]).sum())


def _cut_open(ring: Floats, hole: Floats) -> Floats:
    """Return ``ring`` with a cut to ``hole`` and back where their corners are nearest."""
    apart = ((ring[:, None, :] - hole[None, :, :]) ** 2).sum(axis=2)
    i, j = divmod(int(np.argmin(apart)), len(hole))
    around = np.roll(hole, -j, axis=0)
    return np.concatenate([ring[: i + 1], around, around[:1], ring[i:]])
