"""Clipped angular rate put right: a flat top is a peak that a sensor's range has cut off.

A foot in a hurry turns faster than the ±500 °/s of many sensors at every stride, and the attitude
lost under each clipped peak turns the whole track. The peak is restored with the cubic that leaves
and meets the unclipped signal at its own slopes (Hermite), never below what was read. What was
added is kept beside the sample, and the filter doubts that axis by a share of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge_agent.inertial.eskf_parameters import ParametersRecord
from edge_agent.inertial.sample_ring import RATE, RESTORED
from shared.compiled import compiled

SHORTEST = 2  # a flat top has at least this many steps between its samples

Samples = NDArray[np.float64]


@compiled
def restore_peak(
    samples: Samples, column: int, first: int, last: int, gain: float, cap: float
) -> None:
    """Rewrite the flat top ``first … last`` of one column; two samples stand on either side."""
    mask = samples.shape[0] - 1
    before, after = first - 1, last + 1
    sign = 1.0 if samples[first & mask, column] > 0.0 else -1.0
    y0 = sign * samples[before & mask, column]
    y1 = sign * samples[after & mask, column]
    span = float(after - before)
    s0 = gain * span * max(y0 - sign * samples[(before - 1) & mask, column], 0.0)
    s1 = gain * span * min(sign * samples[(after + 1) & mask, column] - y1, 0.0)
    for i in range(first, last + 1):
        u = (i - before) / span
        v = 1.0 - u
        peak = v * v * ((1.0 + 2.0 * u) * y0 + u * s0) + u * u * ((3.0 - 2.0 * u) * y1 - v * s1)
        row = samples[i & mask]
        read = sign * row[column]
        peak = min(max(peak, read), (1.0 + cap) * read)
        row[column] = sign * peak
        row[column - RATE + RESTORED] = peak - read


@compiled
def watch_flat_tops(
    samples: Samples,
    runs: NDArray[np.int64],
    fastest: NDArray[np.float64],
    n: int,
    p: ParametersRecord,
) -> None:
    """Look at the newest slot ``n`` and restore the flat tops whose far side is now known.

    ``runs`` (3×2) holds per axis the slots where a flat top began and ended, or −1; ``fastest``
    (3,) the fastest rate read so far, by which a range nobody has told is known.
    """
    if n < 2:
        return
    mask = samples.shape[0] - 1
    for c in range(3):
        first, last = runs[c, 0], runs[c, 1]
        if last >= 0 and n == last + 2:
            if last - first >= SHORTEST and first >= 2:
                restore_peak(samples, RATE + c, first, last, p.peak_gain, p.peak_cap)
            runs[c, 0] = runs[c, 1] = -1
        value = samples[n & mask, RATE + c]
        step = abs(value - samples[(n - 1) & mask, RATE + c])
        fastest[c] = max(fastest[c], abs(value))
        floor = max(p.flat_top_floor_rad_s, p.flat_top_share * fastest[c])
        flat = abs(value) > floor and step < p.flat_top_tolerance * abs(value)
        if flat and runs[c, 0] < 0:
            runs[c, 0] = n - 1
        elif not flat and runs[c, 0] >= 0 and runs[c, 1] < 0:
            runs[c, 1] = n - 1
