"""Resampling: particles drawn anew, each as often as its weight says on the average."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.intp]
Scheme: TypeAlias = Literal["systematic", "multinomial"]

_BELOW_ONE = float(np.nextafter(1.0, 0.0))


def resample(weights: Floats, scheme: Scheme, generator: np.random.Generator) -> Indices:
    """Return which particles live on: (n,) indices, particle i on average n·``weights[i]`` times.

    ``weights`` (n,) are not negative and not all zero; they need not sum to one. A particle of
    weight zero is never drawn. *Systematic* (Kitagawa 1996, appendix) takes one random number and
    keeps the count of a particle within one of its expectation; *multinomial* draws each
    independently, as the first sampling-importance-resampling filter did (Gordon, Salmond and
    Smith 1993, section 3).
    """
    count = weights.size
    cumulative = np.add.accumulate(weights)
    cumulative /= cumulative[-1]
    if scheme == "systematic":
        drawn = (np.arange(count) + generator.random()) / count
    else:
        drawn = np.sort(generator.random(count))
    return np.searchsorted(cumulative, np.minimum(drawn, _BELOW_ONE), side="right")
