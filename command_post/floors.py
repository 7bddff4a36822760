"""The storeys of a building nobody knows (pure): heights that people and DAPs are at, in groups."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

APART_M = 1.8
"""Heights further apart than this are of two storeys; no storey is so low."""


class Floor(msgspec.Struct, frozen=True):
    """A storey at ``down_m``; ``level`` counts from the one nearest the incident's origin, 0."""

    level: int
    down_m: float


def floors_of(downs_m: Iterable[float]) -> list[Floor]:
    """Return the storeys on which heights (m, downwards) lie, from the highest; one at least."""
    groups: list[list[float]] = []
    for down_m in sorted(downs_m):
        if groups and down_m - groups[-1][-1] <= APART_M:
            groups[-1].append(down_m)
        else:
            groups.append([down_m])
    middles_m = [sum(group) / len(group) for group in groups] or [0.0]
    ground = min(range(len(middles_m)), key=lambda number: abs(middles_m[number]))
    return [Floor(ground - number, round(each, 2)) for number, each in enumerate(middles_m)]
