"""Zero velocity of the foot: the SHOE statistic and the classes of stillness drawn from it.

The statistic is the generalised likelihood ratio of Skog, Händel, Nilsson and Rantakokko 2010,
"Zero-velocity detection: an algorithm evaluation", eq. 12, over a centred window:
``T = mean|f − g·f̄/|f̄||² / σ_f² + mean|ω|² / σ_ω²``.
No one threshold serves a crawl and a sprint, so besides ``STRONG`` stillness (T below a low
threshold) there is ``DEEP``: near the lowest T of its surroundings, wherever that lies. The filter
then decides whether it can believe a deep minimum (zupt_filter.py).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from edge_agent.inertial.eskf_parameters import ParametersRecord
from shared.compiled import compiled

MOVING, DEEP, STRONG = 0, 1, 2

Array = NDArray[np.float64]


@compiled
def shoe_statistic(
    samples: Array, first: int, count: int, gravity: float, force_scale: float, rate_scale: float
) -> float:
    """SHOE over ``count`` slots of the ring ``samples`` (f, ω, …) from slot ``first``."""
    mask = samples.shape[0] - 1
    x = y = z = ff = ww = 0.0
    for i in range(first, first + count):
        row = samples[i & mask]
        x += row[0]
        y += row[1]
        z += row[2]
        ff += row[0] * row[0] + row[1] * row[1] + row[2] * row[2]
        ww += row[3] * row[3] + row[4] * row[4] + row[5] * row[5]
    mean_norm = math.sqrt(x * x + y * y + z * z) / count
    residual = max(ff / count - 2.0 * gravity * mean_norm + gravity * gravity, 0.0)
    return residual / (force_scale * force_scale) + ww / count / (rate_scale * rate_scale)


def shoe_reference(
    force_m_s2: Array, rate_rad_s: Array, gravity: float, force_scale: float, rate_scale: float
) -> float:
    """The same statistic of one window (n×3 each) as the paper writes it."""
    mean = force_m_s2.mean(axis=0)
    residual = force_m_s2 - gravity * mean / np.linalg.norm(mean)
    force = float(np.mean(np.sum(residual**2, axis=1))) / force_scale**2
    return force + float(np.mean(np.sum(rate_rad_s**2, axis=1))) / rate_scale**2


@compiled
def stillness_class(statistic: Array, centre: int, newest: int, p: ParametersRecord) -> int:
    """Class of stillness at slot ``centre`` of the ring of statistics, filled up to ``newest``."""
    mask = statistic.shape[0] - 1
    value = statistic[centre & mask]
    if value < p.strong_limit:
        return STRONG
    if value >= p.deep_limit:
        return MOVING
    ceiling = value / p.deep_ratio
    for i in range(max(0, centre - p.deep_past), min(newest, centre + p.look_ahead) + 1):
        other = statistic[i & mask]
        if other <= ceiling or (other < p.strong_limit and abs(i - centre) <= p.guard):
            return MOVING
    return DEEP
