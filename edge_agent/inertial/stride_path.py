"""The path of a stride as arrays, read as a sequence of points: most are never looked at."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import overload

import numpy as np
from numpy.typing import NDArray

from edge_agent.inertial.linear_zupt import PathPoint


class StridePath(Sequence[PathPoint]):
    """Points of ``time_ns`` (n,) and ``position_m`` (n×3), north, east, down of the start."""

    __slots__ = ("position_m", "time_ns")

    def __init__(self, time_ns: NDArray[np.int64], position_m: NDArray[np.float64]) -> None:
        self.time_ns = time_ns
        self.position_m = position_m

    def __len__(self) -> int:
        return len(self.time_ns)

    def __iter__(self) -> Iterator[PathPoint]:
        points = zip(self.time_ns.tolist(), self.position_m.tolist(), strict=True)
        return (PathPoint(time_ns, *position_m) for time_ns, position_m in points)

    @overload
    def __getitem__(self, index: int) -> PathPoint: ...
    @overload
    def __getitem__(self, index: slice) -> StridePath: ...
    def __getitem__(self, index: int | slice) -> PathPoint | StridePath:
        if isinstance(index, slice):
            return StridePath(self.time_ns[index], self.position_m[index])
        return PathPoint(int(self.time_ns[index]), *self.position_m[index].tolist())

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, StridePath)
            and np.array_equal(self.time_ns, other.time_ns)
            and np.array_equal(self.position_m, other.position_m)
        )

    def __hash__(self) -> int:
        return hash((self.time_ns.tobytes(), self.position_m.tobytes()))


NO_PATH = StridePath(np.empty(0, np.int64), np.empty((0, 3)))
