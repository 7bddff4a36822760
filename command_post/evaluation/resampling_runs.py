"""How sure a figure over many runs is: the same figure of runs drawn again, with repetition.

The bootstrap's percentile interval (Efron 1979), with runs as what is drawn: errors within a run
belong together, those of two runs do not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Interval: TypeAlias = tuple[float, float]

DRAWS = 1000
SEED = 18305
BINS = 4000
"""Errors are counted in so many steps up to the largest: finer than any figure is read."""


class Redrawn:
    """The same draws for all figures of one scenario: how often each run is in each draw."""

    def __init__(self, runs: int) -> None:
        chance = np.random.Generator(np.random.Philox(SEED))
        self._weights = chance.multinomial(runs, np.full(runs, 1.0 / runs), DRAWS).astype(float)

    def percentiles(self, errors_m: Sequence[Floats], percent: Sequence[float]) -> list[Interval]:
        """Return the 95 % interval of each percentile of all runs' errors thrown together.

        ``errors_m`` has an array for each run; there is to be an error in one at least.
        """
        largest_m = max(float(each.max()) for each in errors_m if each.size) or 1.0
        edges_m = np.linspace(0.0, largest_m, BINS + 1)
        counts = np.array([np.histogram(each, edges_m)[0] for each in errors_m], dtype=float)
        below = np.cumsum(self._weights @ counts, axis=1)
        found = below[:, -1] > 0.0
        shares = below[found] / below[found, -1:]
        told = []
        for each in percent:
            bins = np.count_nonzero(shares < each / 100.0, axis=1)
            told.append(_interval(edges_m[1:][np.minimum(bins, BINS - 1)]))
        return told

    def share_pct(self, hits: Sequence[float], trials: Sequence[float]) -> Interval:
        """Return the 95 % interval of the share, in percent, of ``hits`` among ``trials``.

        Both are counts of each run; there is to be a trial in one at least.
        """
        tried = self._weights @ np.asarray(trials, dtype=float)
        shares = (self._weights @ np.asarray(hits, dtype=float))[tried > 0.0] / tried[tried > 0.0]
        return _interval(100.0 * shares)


def _interval(values: Floats) -> Interval:
    low, high = np.percentile(values, (2.5, 97.5))
    return float(low), float(high)
