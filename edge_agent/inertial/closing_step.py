"""The step that closes a walk: told by the speed that was left as the last foot seemed to land.

Who stops sets the other foot down beside, so softly that it hardly throws the trunk up. But at the
landing before, the trunk still went on, and nothing stops it but one more foot: by the time it is
at rest it has lost that speed, which level acceleration tells. At a landing that closed the walk
itself none was left.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import islice

from shared.maths.rotations import Vector3
from shared.units import NS_PER_S

REST_S = 0.3
"""The trunk is at rest once it was quiet for so long."""

QUIET_M_S2 = 0.35
"""Of who stands, upward acceleration is smaller."""

LEFT_M_S = 0.37
"""Halfway between what a push from a stand gives (0.26 m/s at most in 27 walks of nine people) and
what a trunk has at the first landing (0.49 at least): with more, nobody stands."""

LONGEST_S = 1.5
"""From a landing to the end of ``REST_S``: who takes longer stopped in some other way."""


class ClosingStep:
    """Takes level acceleration at even samples, and when a foot landed. Plain state."""

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self._rest = round(REST_S * rate_hz)
        self._since: deque[tuple[int, float, float]] = deque(maxlen=round(LONGEST_S * rate_hz))
        self._landed_ns: int | None = None
        self._quiet = 0

    def land(self, time_ns: int) -> None:
        """Take a foot to have landed at ``time_ns``."""
        self._landed_ns = time_ns

    def step(self, time_ns: int, level_m_s2: Vector3) -> int | None:
        """Take in acceleration, north, east and up, free of gravity, in any fixed level frame.

        Return when a foot landed that nothing else has told, once that is sure: as the rest began.
        """
        north_m_s2, east_m_s2, up_m_s2 = level_m_s2
        self._since.append((time_ns, north_m_s2, east_m_s2))
        self._quiet = self._quiet + 1 if abs(up_m_s2) < QUIET_M_S2 else 0
        if self._quiet != self._rest:
            return None
        landed_ns, self._landed_ns = self._landed_ns, None
        if landed_ns is None or time_ns - landed_ns > LONGEST_S * NS_PER_S:
            return None
        began_ns = self._since[-self._rest][0]
        closes = began_ns > landed_ns and self._left_m_s(landed_ns) >= LEFT_M_S
        return began_ns if closes else None

    def _left_m_s(self, landed_ns: int) -> float:
        """Return the speed lost since then; what is read at rest is how far level is off."""
        resting = list(islice(self._since, len(self._since) - self._rest, None))
        since = [moment for moment in self._since if moment[0] > landed_ns]
        lost_m_s = [
            self._period_s
            * (
                math.fsum(moment[axis] for moment in since)
                - len(since) / len(resting) * math.fsum(moment[axis] for moment in resting)
            )
            for axis in (1, 2)
        ]
        return math.hypot(*lost_m_s)
