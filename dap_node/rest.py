"""Whether the box lies still, is shaken or has been turned over, by its accelerometer (pure)."""

from __future__ import annotations

from collections import deque
from math import acos, fsum, hypot, sqrt

from shared.messages import Vector3
from shared.units import NS_PER_S

WINDOW_NS = NS_PER_S
LEAST_SAMPLES = 5
STILL_M_S2 = 0.1
"""Specific force spreads less, all axes together, where nobody holds the box; in a hand more."""

SHAKEN_M_S2 = 0.6
"""It spreads more while somebody walks with it."""

SHAKEN_FOR_NS = 5 * NS_PER_S // 2
"""What is only bumped into is found shaken for less: for the bump and the window after it."""

TURNED_RAD = 0.26
"""Lying still with gravity from so much elsewhere, 15 degrees, it has been moved."""


class RestWatch:
    """Looks at the specific force of the last second."""

    def __init__(self) -> None:
        self._samples: deque[tuple[int, Vector3]] = deque()
        self._lay: Vector3 | None = None
        self._lies: Vector3 | None = None
        self.still_since_ns: int | None = None
        """Since when the box lies still; ``None`` while it does not."""

        self.shaken_since_ns: int | None = None
        """Since when it is shaken without a pause; ``None`` while it is not."""

    def feel(self, time_ns: int, force_m_s2: Vector3) -> None:
        """Take in a sample; times must not go back."""
        self._samples.append((time_ns, force_m_s2))

    def tick(self, now_ns: int) -> None:
        """Judge the second before ``now_ns``; with too few samples nothing changes."""
        while self._samples and self._samples[0][0] <= now_ns - WINDOW_NS:
            self._samples.popleft()
        if len(self._samples) < LEAST_SAMPLES:
            return
        mean, spread_m_s2 = _mean_and_spread([force for _, force in self._samples])
        if spread_m_s2 < STILL_M_S2:
            self.still_since_ns = self.still_since_ns or now_ns - WINDOW_NS
            self._lies = mean
            self._lay = self._lay or mean
        else:
            self.still_since_ns = None
        if spread_m_s2 > SHAKEN_M_S2:
            self.shaken_since_ns = self.shaken_since_ns or now_ns
        else:
            self.shaken_since_ns = None

    def remember(self) -> None:
        """Take how the box lies now for how it is to lie."""
        self._lay = self._lies

    def is_moved(self, now_ns: int) -> bool:
        """Say whether it is being carried, or lies otherwise than when this was remembered."""
        shaken_ns = 0 if self.shaken_since_ns is None else now_ns - self.shaken_since_ns
        is_turned = (
            self.still_since_ns is not None
            and self._lay is not None
            and self._lies is not None
            and _angle_rad(self._lay, self._lies) > TURNED_RAD
        )
        return shaken_ns >= SHAKEN_FOR_NS or is_turned


def _mean_and_spread(forces_m_s2: list[Vector3]) -> tuple[Vector3, float]:
    """Return the mean of vectors (n ≥ 1), and the root of their mean squared distance from it."""
    count = len(forces_m_s2)
    x, y, z = (fsum(axis) / count for axis in zip(*forces_m_s2, strict=True))
    squares = ((fx - x) ** 2 + (fy - y) ** 2 + (fz - z) ** 2 for fx, fy, fz in forces_m_s2)
    return (x, y, z), sqrt(fsum(squares) / count)


def _angle_rad(one: Vector3, other: Vector3) -> float:
    lengths = hypot(*one) * hypot(*other)
    cosine = fsum(a * b for a, b in zip(one, other, strict=True)) / lengths if lengths else 1.0
    return acos(min(max(cosine, -1.0), 1.0))
