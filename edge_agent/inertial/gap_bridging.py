"""Short gaps bridged with the wearer's own last strides.

Gait repeats itself: the stretches of recent signal that agree best with what was measured just
before and just after a gap are laid into it, the more alike the weightier. They are bent to meet
what was measured at either end, and the bend fades away from it: soon in specific force, where a
heel strike beside a gap, never twice alike, says little of what is in it; later in angular rate,
for who turns now may not have turned then. A straight line between the ends would lose up to 80°
of pitch in 0.2 s of swing.

How badly the best stretch agrees tells how far the bridge is to be doubted. On recordings with
gaps cut into them, errors grew with that disagreement's root, and their effect as the gap's length
rather than as its root: they last.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from edge_agent.inertial.eskf_parameters import ParametersRecord
from edge_agent.inertial.sample_ring import DOUBT, RATE, RATE_DOUBT, STEP
from shared.compiled import compiled

LIKEST = 4
"""So many stretches are laid over one another, at most."""

WORSE, MUCH_THE_SAME = 2.0, 0.02
"""One that disagrees by more than ``WORSE`` times as much as the best, and by more than
``MUCH_THE_SAME`` beyond that, is left out."""

STEEPEST = 100.0
"""Of a hyperbolic sine's argument: a bend has long faded, and numbers stay finite."""

LIKE, UNLIKE = 0.05, 1.0
"""Root of the least disagreement that is believed, and the disagreement of a straight line."""

DOUBTED_S, TURNING_S = 0.2, 0.05
MOST_DOUBT = 2.0
"""Doubt is 1 in a gap of ``DOUBTED_S`` whose disagreement is 1. Angular rate is smooth: in a gap
shorter than ``TURNING_S`` it is doubted less than force, as the gap is shorter."""

Samples = NDArray[np.float64]


@compiled
def disagreement_at(
    samples: Samples, first: int, last: int, head: int, shift: int, most: float, p: ParametersRecord
) -> float:
    """Mean squared disagreement on both sides of a gap with the signal ``shift`` slots earlier.

    Specific force is cut off at two scales. Infinite where it is more than ``most``.
    """
    mask = samples.shape[0] - 1
    after = min(last + p.bridge_margin + 1, head)
    beside = after - (first - p.bridge_margin) - (last - first + 1)
    total, most_total = 0.0, 6.0 * beside * most
    for slot in range(first - p.bridge_margin, after):
        if first <= slot <= last:
            continue
        now, then = samples[slot & mask], samples[(slot - shift) & mask]
        for c in range(3):
            force = (now[c] - then[c]) / p.bridge_force_scale_m_s2
            rate = (now[3 + c] - then[3 + c]) / p.bridge_rate_scale_rad_s
            total += min(force * force, 4.0) + rate * rate
        if total > most_total:
            return math.inf
    return float(total / (6.0 * beside))


@compiled
def find_likest(
    samples: Samples,
    first: int,
    last: int,
    head: int,
    shifts: NDArray[np.int64],
    disagreements: NDArray[np.float64],
    p: ParametersRecord,
) -> int:
    """Write the shifts (:data:`LIKEST`) that agree best, best first; return how many there are."""
    shortest = max(p.bridge_shortest, last - first + 2 + p.bridge_margin)
    oldest = max(0, head - samples.shape[0])
    longest = min(p.bridge_longest, first - p.bridge_margin - oldest)
    at = np.full(max(longest + 1, 0), math.inf)
    best = math.inf
    for shift in range(shortest, longest + 1):
        most = WORSE * best + MUCH_THE_SAME
        at[shift] = disagreement_at(samples, first, last, head, shift, most, p)
        best = min(best, at[shift])
    found = 0
    while found < LIKEST and longest >= shortest:
        shift = int(np.argmin(at))
        if not at[shift] <= WORSE * best + MUCH_THE_SAME:
            break
        shifts[found], disagreements[found] = shift, at[shift]
        at[max(0, shift - p.bridge_apart) : shift + p.bridge_apart + 1] = math.inf
        found += 1
    return found


@compiled
def lay_in(
    samples: Samples, first: int, last: int, shift: int, weight: float, p: ParametersRecord
) -> None:
    """Add ``weight`` times the stretch ``shift`` slots earlier to slots ``first … last``.

    The bend is that of a rod held at both ends on springs: a straight line in a short gap,
    exponentials from either end in a long one.
    """
    mask = samples.shape[0] - 1
    span = last - first + 2
    for c in range(6):
        y0 = samples[(first - 1) & mask, c] - samples[(first - 1 - shift) & mask, c]
        y1 = samples[(last + 1) & mask, c] - samples[(last + 1 - shift) & mask, c]
        fade = p.bridge_rate_fade if c >= RATE else p.bridge_force_fade
        whole = math.sinh(min(span / fade, STEEPEST))
        for slot in range(first, last + 1):
            at = slot - first + 1
            bend = y0 * math.sinh(min((span - at) / fade, STEEPEST))
            bend += y1 * math.sinh(min(at / fade, STEEPEST))
            value = samples[(slot - shift) & mask, c] + bend / whole
            samples[slot & mask, c] += weight * value


@compiled
def draw_line(samples: Samples, first: int, last: int) -> None:
    """Fill slots ``first … last`` with a straight line between what is on either side."""
    mask = samples.shape[0] - 1
    for c in range(6):
        y0, y1 = samples[(first - 1) & mask, c], samples[(last + 1) & mask, c]
        for slot in range(first, last + 1):
            share = (slot - first + 1) / (last - first + 2)
            samples[slot & mask, c] = y0 + (y1 - y0) * share


@compiled
def bridge_gap(samples: Samples, first: int, last: int, head: int, p: ParametersRecord) -> float:
    """Fill slots ``first … last`` of the ring, whose newest slot is ``head − 1``.

    Returns the disagreement of the likest stretch, or −1 where history was too short for one and
    a straight line was drawn instead.
    """
    mask = samples.shape[0] - 1
    shifts, disagreements = np.empty(LIKEST, np.int64), np.empty(LIKEST)
    found = find_likest(samples, first, last, head, shifts, disagreements, p)
    if found == 0:
        draw_line(samples, first, last)
        disagreements[0] = UNLIKE
    else:
        weights = 1.0 / (disagreements[:found] + MUCH_THE_SAME)
        for slot in range(first, last + 1):
            samples[slot & mask, : RATE + 3] = 0.0
        for i in range(found):
            lay_in(samples, first, last, shifts[i], weights[i] / weights.sum(), p)
    lasted_s = samples[first & mask, STEP] * (last - first + 1)
    unlike = max(LIKE, math.sqrt(disagreements[0]))
    doubt = min(MOST_DOUBT, unlike * math.sqrt(lasted_s / DOUBTED_S))
    for slot in range(first, last + 1):
        samples[slot & mask, DOUBT] = doubt
        samples[slot & mask, RATE_DOUBT] = doubt * min(1.0, lasted_s / TURNING_S)
    return float(disagreements[0]) if found > 0 else -1.0
