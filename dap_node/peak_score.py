"""What a peak of signal strength says about the range, and when (pure)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dap_node.true_range import TrueRange
from shared.rssi_peaks import Peak
from shared.units import NS_PER_S

Array: TypeAlias = NDArray[np.float64]

BIN_DB = 4
"""Peaks are told apart by strength in steps of this."""

STRONG_DBM = -48.0
FALSE_M = 3.0
"""A strong peak from farther than this is a false one."""


class PeakTrial(NamedTuple):
    """The peaks of one DAP and one responder.

    Of each peak ``peak_dbm``, the true ``range_m`` at its moment, and ``delay_s`` until it was
    told. Of ``passes``, ``noticed`` had a peak, ``in_passes`` peaks in all; ``off_s`` is how much
    later than the nearest the strongest peak of each noticed pass was.
    """

    peak_dbm: Array
    range_m: Array
    delay_s: Array
    passes: int
    noticed: int
    in_passes: int
    off_s: Array


class PeakBin(NamedTuple):
    """Peaks of ``from_dbm`` to ``BIN_DB`` more: how many, and the range at their moment (m).

    ``sigma_m`` is the standard deviation in each horizontal direction that has the range's root
    mean square; ``robust_sigma_m`` the one that has its median.
    """

    from_dbm: int
    peaks: int
    p50_m: float
    p95_m: float
    sigma_m: float
    robust_sigma_m: float


class PeakScore(NamedTuple):
    """Trials together; times are NaN where there was nothing to measure."""

    peaks: int
    passes: int
    noticed: int
    in_passes: int
    off_p50_s: float
    off_abs_p95_s: float
    delay_p50_s: float
    strong: int
    strong_false: int
    bins: list[PeakBin]


def try_peaks(told: Sequence[tuple[int, Peak]], true_range: TrueRange, pass_m: float) -> PeakTrial:
    """Measure the peaks of one responder, each ``told`` with the time (ns) at which it was."""
    time_s = np.array([peak.time_ns / NS_PER_S for _, peak in told])
    peak_dbm = np.array([peak.peak_dbm for _, peak in told])
    passes = true_range.passes(pass_m)
    within = [one.holds(time_s) for one in passes]
    strongest_s = [
        one.off_s(float(time_s[held][np.argmax(peak_dbm[held])]))
        for one, held in zip(passes, within, strict=True)
        if held.any()
    ]
    return PeakTrial(
        peak_dbm=peak_dbm,
        range_m=true_range.at(time_s),
        delay_s=np.array([now_ns / NS_PER_S for now_ns, _ in told]) - time_s,
        passes=len(passes),
        noticed=len(strongest_s),
        in_passes=int(sum(held.sum() for held in within)),
        off_s=np.array(strongest_s),
    )


def score_peaks(trials: Iterable[PeakTrial]) -> PeakScore:
    """Sum up ``trials`` (n ≥ 1)."""
    all_dbm, all_range_m, all_delay_s, passes, noticed, in_passes, all_off_s = zip(
        *trials, strict=True
    )
    peak_dbm, range_m = np.concatenate(all_dbm), np.concatenate(all_range_m)
    off_s = np.concatenate(all_off_s)
    is_strong = peak_dbm >= STRONG_DBM
    return PeakScore(
        peaks=len(peak_dbm),
        passes=sum(passes),
        noticed=sum(noticed),
        in_passes=sum(in_passes),
        off_p50_s=_percentile(off_s, 50.0),
        off_abs_p95_s=_percentile(np.abs(off_s), 95.0),
        delay_p50_s=_percentile(np.concatenate(all_delay_s), 50.0),
        strong=int(is_strong.sum()),
        strong_false=int(np.sum(range_m[is_strong] > FALSE_M)),
        bins=_bins(peak_dbm, range_m),
    )


def _bins(peak_dbm: Array, range_m: Array) -> list[PeakBin]:
    """Sort peaks into bins, weakest first; leave out the empty ones."""
    index = np.floor(peak_dbm / BIN_DB).astype(int)
    return [_bin(int(one) * BIN_DB, range_m[index == one]) for one in np.unique(index)]


def _bin(from_dbm: int, range_m: Array) -> PeakBin:
    median_m = _percentile(range_m, 50.0)
    return PeakBin(
        from_dbm=from_dbm,
        peaks=len(range_m),
        p50_m=median_m,
        p95_m=_percentile(range_m, 95.0),
        sigma_m=float(np.sqrt(np.mean(range_m**2) / 2.0)),
        # The range is Rayleigh distributed, whose median is σ √(2 ln 2).
        robust_sigma_m=median_m / float(np.sqrt(2.0 * np.log(2.0))),
    )


def _percentile(values: Array, share: float) -> float:
    return float(np.percentile(values, share)) if len(values) else float("nan")
