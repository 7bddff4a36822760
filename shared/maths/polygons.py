"""Points and polygons in the plane."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats: TypeAlias = NDArray[np.float64]


def inside_polygon(points: ArrayLike, corners: ArrayLike) -> NDArray[np.bool_]:
    """Say which of ``points`` (n, 2) lie in the polygon of ``corners`` (c, 2), in order around it.

    By the even-odd rule; what lies on the outline itself may count either way.
    """
    point = np.asarray(points, dtype=np.float64)[:, None, :]
    start = np.asarray(corners, dtype=np.float64)
    end = np.roll(start, -1, axis=0)
    spans = (start[:, 0] > point[..., 0]) != (end[:, 0] > point[..., 0])
    # Sides along the second axis span nothing, and what they divide by nought is not looked at.
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (point[..., 0] - start[:, 0]) / (end - start)[:, 0]
        crossing = start[:, 1] + share * (end - start)[:, 1]
    return np.asarray(np.count_nonzero(spans & (point[..., 1] < crossing), axis=1) % 2 == 1)
