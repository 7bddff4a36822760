"""Short gaps bridged with the wearer's own last stride.

Gait repeats itself: the stretch of recent signal that agrees best with what was measured just
before and just after a gap is laid into it, bent linearly so that both ends meet. A straight line
between the ends would lose up to 80° of pitch in 0.2 s of swing. How badly the best stretch agrees
is kept beside every bridged sample as a share of the doubt a blind bridge would deserve.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from edge_agent.inertial.eskf_parameters import ParametersRecord
from edge_agent.inertial.sample_ring import DOUBT
from shared.compiled import compiled

LEAST_DOUBT = 0.1

Samples = NDArray[np.float64]


@compiled
def disagreement_at(
    samples: Samples, first: int, last: int, head: int, shift: int, p: ParametersRecord
) -> float:
    """Mean squared disagreement on both sides of a gap with the signal ``shift`` slots earlier.

    Specific force is cut off at two scales: heel strikes are never twice alike.
    """
    mask = samples.shape[0] - 1
    total = 0.0
    for slot in range(first - p.bridge_margin, min(last + p.bridge_margin + 1, head)):
        if first <= slot <= last:
            continue
        now, then = samples[slot & mask], samples[(slot - shift) & mask]
        for c in range(3):
            force = (now[c] - then[c]) / p.bridge_force_scale_m_s2
            rate = (now[3 + c] - then[3 + c]) / p.bridge_rate_scale_rad_s
            total += min(force * force, 4.0) + rate * rate
    beside = min(last + p.bridge_margin + 1, head) - (first - p.bridge_margin) - (last - first + 1)
    return float(total / (6.0 * beside))


@compiled
def bridge_gap(samples: Samples, first: int, last: int, head: int, p: ParametersRecord) -> float:
    """Fill slots ``first … last`` of the ring, whose newest slot is ``head − 1``.

    Returns the disagreement of the stretch laid in, or −1 where history was too short for one and
    a straight line was drawn instead.
    """
    mask = samples.shape[0] - 1
    span = last - first + 2
    oldest = max(0, head - samples.shape[0])
    best, least = 0, math.inf
    for shift in range(max(p.bridge_shortest, span + p.bridge_margin), p.bridge_longest + 1):
        if first - p.bridge_margin - shift < oldest:
            break
        disagreement = disagreement_at(samples, first, last, head, shift, p)
        if disagreement < least:
            best, least = shift, disagreement
    for c in range(6):
        y0 = samples[(first - 1) & mask, c]
        y1 = samples[(last + 1) & mask, c]
        if best > 0:
            y0 -= samples[(first - 1 - best) & mask, c]
            y1 -= samples[(last + 1 - best) & mask, c]
        for slot in range(first, last + 1):
            shape = samples[(slot - best) & mask, c] if best > 0 else 0.0
            samples[slot & mask, c] = shape + y0 + (y1 - y0) * (slot - first + 1) / span
    doubt = min(1.0, max(LEAST_DOUBT, math.sqrt(least))) if best > 0 else 1.0
    for slot in range(first, last + 1):
        samples[slot & mask, DOUBT] = doubt
    return least if best > 0 else -1.0
