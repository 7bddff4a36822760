"""The path that a mount's increments add up to, at any moment of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edge_agent.evaluation.truth import Array
from edge_agent.mounts.interface import Increment
from shared.units import NS_PER_S


@dataclass(frozen=True)
class EstimatedPath:
    """Knots of a path, ``time_s`` (n,) and ``position_m`` (n, 3) NED from zero, and its stances.

    ``stances_s`` (m, 2) has when each detected stance began and ended, from −∞ to ∞.
    """

    time_s: Array
    position_m: Array
    stances_s: Array

    def at(self, time_s: Array) -> Array:
        """Return positions (k, 3) at ``time_s`` (k,): linear between knots, held beyond."""
        return np.column_stack(
            [np.interp(time_s, self.time_s, self.position_m[:, axis]) for axis in range(3)]
        )


def estimated_path(increments: Sequence[Increment]) -> EstimatedPath:
    """Lay ``increments`` (one or more, in order) end to end."""
    times_ns: list[int] = []
    positions_m: list[tuple[float, float, float]] = []
    stances_s: list[tuple[float, float]] = []
    north_m = east_m = down_m = 0.0
    stood_from_s = -np.inf
    for increment in increments:
        start_s = increment.start_time_ns / NS_PER_S
        if start_s > stood_from_s or increment.path:
            stances_s.append((stood_from_s, start_s))
        way = increment.path or ((increment.start_time_ns, 0.0, 0.0, 0.0),)
        for time_ns, north, east, down in way:
            times_ns.append(time_ns)
            positions_m.append((north_m + north, east_m + east, down_m + down))
        north, east, down = increment.displacement_m
        north_m, east_m, down_m = north_m + north, east_m + east, down_m + down
        times_ns.append(increment.end_time_ns)
        positions_m.append((north_m, east_m, down_m))
        stood_from_s = increment.end_time_ns / NS_PER_S
    stances_s.append((stood_from_s, np.inf))
    return EstimatedPath(
        np.array(times_ns, dtype=np.float64) / NS_PER_S,
        np.array(positions_m),
        np.array(stances_s),
    )
