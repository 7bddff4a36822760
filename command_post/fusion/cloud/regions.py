"""The 95 % region of a cloud: its ellipse where that tells it, else outlines.

The region is that of highest density (Hyndman 1996): no smaller one holds as much. The density is
the cloud's own, smoothed by as much as so many particles need; the outline is where it crosses the
level above which 95 % of the weight stands.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple, TypeAlias, cast

import numpy as np
from contourpy import FillType, contour_generator
from numpy.typing import NDArray

from command_post.fusion.cloud.cloud import Cloud, Moments, places
from command_post.fusion.cloud.outlines import outline, twice_area
from command_post.fusion.track import MOST_COORDINATE_M
from shared.compiled import compiled
from shared.messages import Outline

Floats: TypeAlias = NDArray[np.float64]
Weights: TypeAlias = NDArray[np.float32]

SHARE = 0.95
ELLIPSE_SCALE = -2.0 * math.log(1.0 - SHARE)
"""Squared radius, in standard deviations, within which a Gaussian of the plane has its 95 %."""

MOST_OUTLINES = 8

# An outline fitted to a thousand particles holds half a percent less of what they stand for.
_HELD = SHARE + 0.005
_SMALL_M2 = 20.0
_FILLED_SHARE = 0.75
_ONE_PEAK = ((0.575, 0.15, 0.42), (1.386, 0.38, 0.65), (ELLIPSE_SCALE, 0.93, 0.99))
_CELLS = 80
_LEFT_OUT = 0.002
_LEAST_CELL_M = 0.05
_TRIES = 6


class _Density(NamedTuple):
    """Smoothed weight by cell; ``values[i, j]`` at ``origin_m`` + ``cell_m`` × (i, j)."""

    values: Floats
    origin_m: Floats
    cell_m: float


def regions(cloud: Cloud, told: Moments) -> tuple[Outline, ...]:
    """Return outlines (north, east) in m that hold 95 % of the cloud's weight, at most eight.

    None where the ellipse of its moments, ``ELLIPSE_SCALE`` times the covariance, tells as much.
    A region around a hole is told by one outline, cut open where the two are nearest.
    """
    north, east, weights = places(cloud)
    place = np.stack([north, east]).astype(np.float64) + np.array(cloud.origin_m)[:, None]
    nn, ne, ee = told.covariance_m2
    ellipse_m2 = math.pi * ELLIPSE_SCALE * math.sqrt(max(nn * ee - ne * ne, 0.0))
    off_m = place - np.array([[told.north_m], [told.east_m]])
    like_one = _is_like_one_peak(off_m, weights, told.covariance_m2)
    if like_one and ellipse_m2 < _SMALL_M2:
        return ()
    density = _density(place, weights, told.effective_count, 1.0)
    if like_one and _area_m2(density, place, weights) > _FILLED_SHARE * ellipse_m2:
        return ()
    found = _smallest(density, place, weights, told.effective_count)
    on_map = [ring.clip(-MOST_COORDINATE_M, MOST_COORDINATE_M) for ring in found]
    return tuple(tuple((north, east) for north, east in ring.tolist()) for ring in on_map)


def _smallest(
    density: _Density, place: Floats, weights: Weights, effective_count: float
) -> list[Floats]:
    """Return the outlines that hold ``_HELD``: fewer by more blur, larger by a lower level."""
    share, blur = _HELD, 1.0
    for _ in range(_TRIES):
        found = _outlines(density, _level(density, place, weights, share))
        if len(found) > MOST_OUTLINES:
            blur *= 1.5
            density = _density(place, weights, effective_count, blur)
            continue
        held = sum(weight_within(place, weights, each) for each in found)
        if held >= _HELD:
            break
        share = min(share + max(_HELD - held, 0.002), 0.999)
    return sorted(found, key=lambda ring: -weight_within(place, weights, ring))[:MOST_OUTLINES]


def _area_m2(density: _Density, place: Floats, weights: Weights) -> float:
    """Return the area of the region, before any outline is drawn."""
    above = density.values >= _level(density, place, weights, _HELD)
    return int(np.count_nonzero(above)) * density.cell_m**2


def _is_like_one_peak(
    off_m: Floats, weights: Weights, covariance_m2: tuple[float, float, float]
) -> bool:
    """Whether weight lies about the mean as a Gaussian's does: in the middle, half-way, and out."""
    nn, ne, ee = covariance_m2
    determinant = nn * ee - ne * ne
    if determinant <= 0.0:
        return True
    u, v = off_m
    distance = (ee * u * u - 2.0 * ne * u * v + nn * v * v) / determinant
    within = [float(weights[distance < limit].sum()) for limit, _, _ in _ONE_PEAK]
    return all(low <= w <= high for w, (_, low, high) in zip(within, _ONE_PEAK, strict=True))


def _density(place: Floats, weights: Weights, effective_count: float, blur: float) -> _Density:
    """Smooth the weight on a grid, ``blur`` times as wide as so many particles need.

    The width is Scott's (1992, eq. 6.42) for a Gaussian that filled as large an area as 95 % of
    the weight does; the spread of all peaks together would blur each of them away.
    """
    low, high = np.array([_bounds(axis, weights) for axis in place]).T
    cell_m = max(float((high - low).max()) / _CELLS, _LEAST_CELL_M)
    coarse = _smoothed(place, weights, low, high, cell_m, 1.5 * cell_m)
    heights = np.sort(coarse.values.ravel())[::-1]
    filled = int(np.searchsorted(np.add.accumulate(heights), SHARE)) + 1
    sd_m = math.sqrt(filled * cell_m**2 / (math.pi * ELLIPSE_SCALE))
    width_m = max(blur * sd_m / _cube_root(math.sqrt(effective_count)), cell_m)
    return _smoothed(place, weights, low, high, cell_m, width_m)


def _bounds(axis: Floats, weights: Weights) -> tuple[float, float]:
    """Return between which coordinates all but the outermost weight stands."""
    order = np.argsort(axis, kind="stable")
    reached = np.add.accumulate(weights[order].astype(np.float64))
    ends = np.searchsorted(reached, np.array([_LEFT_OUT, 1.0 - _LEFT_OUT]) * reached[-1])
    low, high = axis[order[np.minimum(ends, axis.size - 1)]]
    return float(low), float(high)


def _cube_root(number: float) -> float:
    """Return the cube root of a number from 1 to 10⁶, by Newton; a library's bits may differ."""
    root = 1.0 + number / 10.0
    for _ in range(40):
        root -= (root - number / (root * root)) / 3.0
    return root


def _smoothed(
    place: Floats,
    weights: Weights,
    low: Floats,
    high: Floats,
    cell_m: float,
    width_m: float,
) -> _Density:
    """Count the weight by cells, and spread each cell's with a standard deviation of ``width_m``.

    The kernel is the product of two biweights (1 - x²)², which need no exponential.
    """
    reach = math.ceil(math.sqrt(7.0) * width_m / cell_m)
    origin_m: Floats = low - (reach + 1) * cell_m
    shape = np.ceil((high - low) / cell_m).astype(np.int64) + 2 * reach + 3
    cells = np.rint((place - origin_m[:, None]) / cell_m).astype(np.int64)
    kept = np.all((cells >= reach) & (cells < shape[:, None] - reach), axis=0)
    flat = cells[0, kept] * shape[1] + cells[1, kept]
    counted = np.bincount(flat, weights[kept], int(shape[0] * shape[1]))
    values = counted.astype(np.float64).reshape(shape)
    taps = (1.0 - (np.arange(1 - reach, reach) * cell_m) ** 2 / (7.0 * width_m**2)).clip(0.0) ** 2
    taps /= np.add.accumulate(taps)[-1]
    for axis in (0, 1):
        spread = np.zeros_like(values)
        for shift, tap in enumerate(taps, start=1 - reach):
            spread += tap * np.roll(values, shift, axis)
        values = spread
    return _Density(values, origin_m, cell_m)


def _level(density: _Density, place: Floats, weights: Weights, share: float) -> float:
    """Return the density above which ``share`` of the particles' weight stands."""
    at = (place - density.origin_m[:, None]) / density.cell_m
    most = np.array(density.values.shape)[:, None] - 1.001
    at = at.clip(0.0, most)
    corner = at.astype(np.int64)
    (i, j), (u, v) = corner, at - corner
    values = density.values
    heights = (1.0 - u) * ((1.0 - v) * values[i, j] + v * values[i, j + 1]) + u * (
        (1.0 - v) * values[i + 1, j] + v * values[i + 1, j + 1]
    )
    order = np.argsort(-heights, kind="stable")
    reached = np.add.accumulate(weights[order].astype(np.float64))
    last = int(np.searchsorted(reached, share * reached[-1]))
    return float(max(heights[order[min(last, order.size - 1)]], values.max() * 1e-6))


def _outlines(density: _Density, level: float) -> list[Floats]:
    """Return the outlines (m, 2) of where the density is above ``level``, largest first."""
    generator = contour_generator(z=density.values.T, fill_type=FillType.OuterOffset)
    filled = generator.filled(level, np.inf)
    points, offsets = cast("tuple[list[Floats], list[NDArray[np.uint32]]]", filled)
    found = []
    for corners, ends in zip(points, offsets, strict=True):
        rings = [density.origin_m + density.cell_m * corners[a : b - 1] for a, b in pairwise(ends)]
        found.append(outline(rings))
    return sorted(found, key=lambda ring: -abs(twice_area(ring)))


@compiled
def weight_within(place: Floats, weights: Weights, ring: Floats) -> float:
    """Return the weight of the places (2, n) within a closed ``ring`` (m, 2): even-odd rule."""
    total = 0.0
    for k in range(place.shape[1]):
        north, east = place[0, k], place[1, k]
        inside = False
        before = ring.shape[0] - 1
        for corner in range(ring.shape[0]):
            from_east, to_east = ring[before, 1], ring[corner, 1]
            if (from_east > east) != (to_east > east):
                along = (east - from_east) / (to_east - from_east)
                if north < ring[before, 0] + along * (ring[corner, 0] - ring[before, 0]):
                    inside = not inside
            before = corner
        if inside:
            total += weights[k]
    return total
