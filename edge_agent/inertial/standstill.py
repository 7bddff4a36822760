"""Whether a vehicle stands, by how little it trembles: rolling wheels shake what they carry.

How much they shake depends on the vehicle and on where the phone lies, so the threshold is a share
of what was usual when it was known to go: an engine that idles shakes less than that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SHARE_OF_GOING = 0.25
THRESHOLDS_M_S2 = (0.04, 0.15)
"""Not below a sensor's own noise; not above the smoothest road."""

STEADY_RAD_S = math.radians(1.0)
USUAL_SECONDS = 20.0


@dataclass
class Standstill:
    """Learns how much going shakes. Plain state."""

    going_m_s2: float = 0.5

    @property
    def threshold_m_s2(self) -> float:
        """Standard deviation of specific force, all axes together, below which it stands."""
        least_m_s2, most_m_s2 = THRESHOLDS_M_S2
        return min(max(SHARE_OF_GOING * self.going_m_s2, least_m_s2), most_m_s2)

    def stands(self, force_m_s2: Array, rate_rad_s: Array) -> bool:
        """Return whether these samples (n, 3) of a second, in any axes, are a standstill's."""
        return (
            _trembling(force_m_s2) < self.threshold_m_s2 and _trembling(rate_rad_s) < STEADY_RAD_S
        )

    def goes(self, force_m_s2: Array) -> None:
        """Learn from samples (n, 3) of a second in which the vehicle is known to go."""
        trembling_m_s2 = _trembling(force_m_s2)
        if trembling_m_s2 > 0.0:
            share = math.log(trembling_m_s2 / self.going_m_s2) / USUAL_SECONDS
            self.going_m_s2 *= math.exp(share)


def _trembling(signal: Array) -> float:
    return float(np.sqrt(np.sum(np.var(signal, axis=0)))) if len(signal) else 0.0
