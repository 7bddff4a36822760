"""What signal strength says about range in a place: level, spread and variance (pure).

Readings are grouped into spots: those that one receiver took of a transmitter at one place. Within
a spot they differ by fading and by the wearer; from spot to spot at the same range they differ by
what stands around, and no averaging at one place removes that.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Interval: TypeAlias = tuple[float, float]

RESAMPLINGS = 200
LEAST_IN_SPOT = 3
"""A spot with fewer readings does not tell how much they vary."""

NEAREST_M = 0.3
"""Ranges count as this at least: nearer, power does not fall with the logarithm of range."""

BIN_EDGES_M = (0.0, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0, 30.0)


class RangedReadings(NamedTuple):
    """Readings of one recording: ``rssi_dbm`` (n,), true ``range_m`` (n,), and ``spot`` (n,)."""

    rssi_dbm: Array
    range_m: Array
    spot: NDArray[np.int64]


class Fit(NamedTuple):
    """Log-distance path loss: mean power at a metre (dBm), exponent, spread about it (dB).

    The intervals hold 95 % of what resampling the spots with replacement gives.
    """

    power_at_1_m_dbm: float
    exponent: float
    sigma_db: float
    exponent_interval: Interval
    sigma_interval_db: Interval


class RangeBin(NamedTuple):
    """Readings at ``from_m`` to ``to_m``.

    Their mean; the standard deviation of the spots' means; and of the readings' variance within
    spots the mean and the median (dB²). NaN where there are too few.
    """

    from_m: float
    to_m: float
    readings: int
    mean_dbm: float
    across_places_db: float
    variance_db2: float
    median_variance_db2: float


class Survey(NamedTuple):
    """A recording, or several together.

    ``same_place_db`` is the spread of readings at one spot, ``across_places_db`` that of spots'
    means at one range, fading taken out. ``variance_correlation`` is Spearman's, of the variance
    within spots with range: the published rule takes it to be clearly positive.
    """

    readings: int
    spots: int
    fit: Fit
    same_place_db: float
    across_places_db: float
    variance_correlation: float
    bins: list[RangeBin]


class _Spots(NamedTuple):
    """Spots with enough readings: how many, their mean range, mean and unbiased variance."""

    size: Array
    range_m: Array
    mean_dbm: Array
    variance_db2: Array


def survey(readings: RangedReadings, chance: np.random.Generator) -> Survey:
    """Return what ``readings`` (n ≥ 2, of two ranges at least) say; ``chance`` draws resamplings.

    Raises ``ValueError`` where all were taken at one range.
    """
    fit = fit_path_loss(readings, chance)
    spots = _spots(readings)
    decades = np.log10(np.maximum(spots.range_m, NEAREST_M))
    residual_db = spots.mean_dbm - (fit.power_at_1_m_dbm - 10.0 * fit.exponent * decades)
    within_db2 = _mean(spots.variance_db2)
    fading_db2 = _mean(spots.variance_db2 / spots.size)
    across_db2 = _mean(residual_db**2) - fading_db2
    return Survey(
        readings=len(readings.rssi_dbm),
        spots=len(np.unique(readings.spot)),
        fit=fit,
        same_place_db=float(np.sqrt(within_db2)),
        across_places_db=float(np.sqrt(max(across_db2, 0.0))),
        variance_correlation=_rank_correlation(spots.range_m, spots.variance_db2),
        bins=_bins(readings, spots),
    )


def fit_path_loss(readings: RangedReadings, chance: np.random.Generator) -> Fit:
    """Fit power to the logarithm of range by least squares; see ``survey``."""
    decades = np.log10(np.maximum(readings.range_m, NEAREST_M))
    if np.ptp(decades) < 1e-9:
        raise ValueError("all readings were taken at one range; give some from others")
    order = np.argsort(readings.spot, kind="stable")
    ends = np.flatnonzero(np.diff(readings.spot[order])) + 1
    groups = np.split(order, ends)
    drawn = [
        _line(decades[rows], readings.rssi_dbm[rows])
        for rows in (
            np.concatenate(
                [groups[which] for which in chance.integers(len(groups), size=len(groups))]
            )
            for _ in range(RESAMPLINGS)
        )
        if np.ptp(decades[rows]) > 1e-9
    ]
    _, exponents, sigmas_db = zip(*drawn, strict=True)
    power_dbm, exponent, sigma_db = _line(decades, readings.rssi_dbm)
    return Fit(power_dbm, exponent, sigma_db, _interval(exponents), _interval(sigmas_db))


def together(every: list[RangedReadings]) -> RangedReadings:
    """Return the readings of several recordings as one, no two of which share a spot."""
    spots, first = [], 0
    for one in every:
        _, spot = np.unique(one.spot, return_inverse=True)
        spots.append(spot.astype(np.int64) + first)
        first += int(spot.max()) + 1
    return RangedReadings(
        np.concatenate([one.rssi_dbm for one in every]),
        np.concatenate([one.range_m for one in every]),
        np.concatenate(spots),
    )


def _line(decades: Array, rssi_dbm: Array) -> tuple[float, float, float]:
    slope_db, power_dbm = np.polyfit(decades, rssi_dbm, 1)
    residual_db = rssi_dbm - (power_dbm + slope_db * decades)
    return float(power_dbm), float(-slope_db / 10.0), float(residual_db.std())


def _spots(readings: RangedReadings) -> _Spots:
    _, spot = np.unique(readings.spot, return_inverse=True)
    count = np.bincount(spot).astype(np.float64)
    mean_dbm = np.bincount(spot, readings.rssi_dbm) / count
    square_db2 = np.bincount(spot, (readings.rssi_dbm - mean_dbm[spot]) ** 2)
    enough = count >= LEAST_IN_SPOT
    return _Spots(
        count[enough],
        (np.bincount(spot, readings.range_m) / count)[enough],
        mean_dbm[enough],
        square_db2[enough] / (count[enough] - 1.0),
    )


def _bins(readings: RangedReadings, spots: _Spots) -> list[RangeBin]:
    edges_m = [*BIN_EDGES_M, float("inf")]
    bins = []
    for from_m, to_m in pairwise(edges_m):
        here = (readings.range_m >= from_m) & (readings.range_m < to_m)
        spot = (spots.range_m >= from_m) & (spots.range_m < to_m)
        if here.any():
            variance_db2 = spots.variance_db2[spot]
            bins.append(
                RangeBin(
                    from_m,
                    min(to_m, float(readings.range_m.max())),
                    int(here.sum()),
                    float(readings.rssi_dbm[here].mean()),
                    float(spots.mean_dbm[spot].std(ddof=1)) if spot.sum() > 2 else float("nan"),
                    _mean(variance_db2),
                    float(np.median(variance_db2)) if len(variance_db2) else float("nan"),
                )
            )
    return bins


def _rank_correlation(one: Array, other: Array) -> float:
    if len(one) < 3 or np.ptp(one) == 0.0 or np.ptp(other) == 0.0:
        return float("nan")
    return float(np.corrcoef(one.argsort().argsort(), other.argsort().argsort())[0, 1])


def _interval(values: tuple[float, ...]) -> Interval:
    low, high = np.percentile(values, (2.5, 97.5))
    return float(low), float(high)


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else float("nan")
