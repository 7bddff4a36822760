"""How errors are summed up, the same way everywhere."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Summary(NamedTuple):
    """Median, mean and 90th percentile of a set of trials."""

    median: float
    mean: float
    p90: float


def summarise(values: Sequence[float] | NDArray[np.float64]) -> Summary:
    """Sum up ``values`` (n ≥ 1); the 90th percentile is interpolated linearly."""
    array = np.asarray(values, dtype=np.float64)
    if array.size == 0:
        raise ValueError("nothing to sum up: no values")
    median, p90 = np.percentile(array, (50.0, 90.0))
    return Summary(float(median), float(array.mean()), float(p90))


class CircularError(NamedTuple):
    """CE50 and CE95: radii that half and 95 % of the position errors stay within, metres."""

    ce50_m: float
    ce95_m: float


def circular_error(errors_m: Sequence[float] | NDArray[np.float64]) -> CircularError:
    """Return the circular errors of ``errors_m`` (n ≥ 1), interpolated linearly."""
    array = np.asarray(errors_m, dtype=np.float64)
    if array.size == 0:
        raise ValueError("nothing to sum up: no errors")
    ce50_m, ce95_m = np.percentile(array, (50.0, 95.0))
    return CircularError(float(ce50_m), float(ce95_m))
