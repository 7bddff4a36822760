"""How surely something is known: the region that holds 95 % of a normal distribution (pure)."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]

CHI_SQUARE_95 = -2.0 * math.log(0.05)
"""95 % quantile of χ² with two degrees of freedom: the square of the 95 % ellipse's scale."""

HEADING_KNOWN_RAD = 0.6
"""Up to this standard deviation it is told which way somebody faces: wider, it may be anywhere."""


def radii95_m(covariance_m2: tuple[float, float, float]) -> tuple[float, float]:
    """Return the semi-axes of the 95 % ellipse of a covariance (nn, ne, ee), the longer first."""
    nn, ne, ee = covariance_m2
    middle = 0.5 * (nn + ee)
    spread = math.hypot(0.5 * (nn - ee), ne)
    longer, shorter = max(middle + spread, 0.0), max(middle - spread, 0.0)
    return math.sqrt(CHI_SQUARE_95 * longer), math.sqrt(CHI_SQUARE_95 * shorter)


def axes95(covariance_m2: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the semi-axes of the 95 % ellipse and the bearing of the longer (rad from north)."""
    nn, ne, ee = covariance_m2
    return *radii95_m(covariance_m2), 0.5 * math.atan2(2.0 * ne, nn - ee)


def inside95(error_m: Floats, covariance_m2: Floats) -> NDArray[np.bool_]:
    """Say which errors (n, ≥2: north, east) lie in the 95 % ellipses of (n, 3: nn, ne, ee).

    An ellipse of no area holds only the error that is exactly nought.
    """
    north, east = error_m[:, 0], error_m[:, 1]
    nn, ne, ee = covariance_m2.T
    determinant = nn * ee - ne**2
    # Mahalanobis distance times the determinant, so that a flat ellipse divides by nothing.
    scaled = ee * north**2 - 2.0 * ne * north * east + nn * east**2
    on_centre = (north == 0.0) & (east == 0.0)
    inside = (determinant > 0.0) & (scaled <= CHI_SQUARE_95 * determinant)
    return np.asarray(on_centre | inside)


def normalised_squared_error(error_m: Floats, covariance_m2: Floats) -> Floats:
    """Return errors (n, ≥2: north, east) squared and normalised by (n, 3: nn, ne, ee).

    The square of the Mahalanobis distance. Where an ellipse has no area it is infinite.
    """
    north, east = error_m[:, 0], error_m[:, 1]
    nn, ne, ee = covariance_m2.T
    determinant = nn * ee - ne**2
    scaled = ee * north**2 - 2.0 * ne * north * east + nn * east**2
    told = np.full(len(scaled), np.inf)
    np.divide(scaled, determinant, out=told, where=determinant > 0.0)
    return told
