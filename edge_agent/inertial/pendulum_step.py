"""How long a step is, by how much and how slowly the trunk bounces."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

PENDULUM_K = 0.78
"""In √m: the median of nine people's own, which are from 0.72 to 0.84."""


def pendulum_m(period_s: float, bounce_m_s2: float, k: float = PENDULUM_K) -> float:
    """Return the length of a step of ``period_s`` over which upward acceleration deviates so.

    The trunk passes over a stiff leg ``l`` and bounces by ``h``: the step is ``2·√(2·l·h)`` long
    (Zijlstra and Hof, "Displacement of the pelvis during human walking: experimental data and model
    predictions", Gait & Posture 6, 1997). A bounce once a step whose acceleration has the standard
    deviation σ goes as high as ``h ∝ σ·T²``; hence ``K·T·√σ``. Being in proportion to time it makes
    no more way of a step that is counted as two.
    """
    return k * period_s * math.sqrt(bounce_m_s2)


USUAL_STEPS = 8
ON_THE_SPOT = 0.5
"""Who bounces by less than this share of the usual turns on the spot, or shuffles."""


class PendulumSteps:
    """Lengths of steps in turn: what is usual for this wearer tells which of them lead nowhere."""

    def __init__(self) -> None:
        self._bounces_m_s2: deque[float] = deque(maxlen=USUAL_STEPS)

    def length_m(self, period_s: float, up_m_s2: Sequence[float]) -> float:
        """Return the length of a step of ``period_s``, by the upward accelerations over it."""
        bounce_m_s2 = _deviation(up_m_s2)
        self._bounces_m_s2.append(bounce_m_s2)
        usual_m_s2 = sorted(self._bounces_m_s2)[(3 * len(self._bounces_m_s2)) // 4]
        least_m_s2 = ON_THE_SPOT * usual_m_s2
        share = 1.0 if bounce_m_s2 >= least_m_s2 else bounce_m_s2 / least_m_s2
        return share * pendulum_m(period_s, bounce_m_s2)


def _deviation(values: Sequence[float]) -> float:
    """Return the standard deviation of values; 0 of none."""
    if not values:
        return 0.0
    mean = sum(values) / len(values)
    return math.sqrt(sum((value - mean) ** 2 for value in values) / len(values))
