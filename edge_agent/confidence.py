"""How sure a decision by a limit is."""

from __future__ import annotations

import math


def confidence_of(margin: float, width: float) -> float:
    """Return the confidence in a decision by ``margin`` past its limit: 0.5 at none, towards 1.

    At ``width`` (positive, in the margin's unit) it is 0.88; a logistic curve in between.
    """
    return 0.5 * (1.0 + math.tanh(margin / width))
