"""Peaks against the truth: what is a pass, what is at its time, and how the figures add up."""

from __future__ import annotations

import numpy as np
import pytest

from dap_node.peak_score import score_peaks, try_peaks
from dap_node.true_range import TrueRange
from shared.rssi_peaks import Peak
from shared.units import NS_PER_S

TIME_S = np.arange(0.0, 100.0, 1.0 / 32.0)
THERE_AND_BACK = TrueRange(
    TIME_S, np.minimum(np.abs(TIME_S - 20.0), np.maximum(np.abs(TIME_S - 60.0) - 5.0, 0.0)) + 0.5
)
"""Past the DAP at 20 s, at 1 m/s and half a metre; a stand beside it from 55 to 65 s."""


def peak(time_s: float, dbm: float) -> tuple[int, Peak]:
    return round((time_s + 2.0) * NS_PER_S), Peak(round(time_s * NS_PER_S), "r1", dbm, 2.0, 10)


def test_a_stand_is_nearest_as_long_as_it_lasts() -> None:
    walked, stood = THERE_AND_BACK.passes(1.5)
    assert (walked.begin_s, walked.end_s) == pytest.approx((19.0, 21.0), abs=0.04)
    assert (walked.nearest_from_s, walked.nearest_to_s) == pytest.approx((19.9, 20.1), abs=0.02)
    assert (stood.nearest_from_s, stood.nearest_to_s) == pytest.approx((54.9, 65.1), abs=0.02)
    assert stood.off_s(54.0) == pytest.approx(-0.9, abs=0.02)
    assert stood.off_s(60.0) == 0.0
    assert stood.holds(np.array([52.0, 53.5, 60.0, 66.5])).tolist() == [False, True, True, True]


def test_the_strongest_peak_of_a_pass_tells_its_time() -> None:
    peaks = [peak(19.0, -50.0), peak(21.1, -42.0), peak(30.0, -58.0)]
    trial = try_peaks(peaks, THERE_AND_BACK, 1.5)
    assert (trial.passes, trial.noticed, trial.in_passes) == (2, 1, 2)
    assert trial.off_s == pytest.approx([1.0], abs=0.02)
    assert trial.range_m == pytest.approx([1.5, 1.6, 10.5])
    assert trial.delay_s == pytest.approx([2.0, 2.0, 2.0])


def test_scores_add_up() -> None:
    trials = [
        try_peaks([peak(20.0, -42.0), peak(60.0, -43.0)], THERE_AND_BACK, 1.5),
        try_peaks([peak(30.0, -45.0)], THERE_AND_BACK, 1.5),
        try_peaks([], THERE_AND_BACK, 1.5),
    ]
    told = score_peaks(trials)
    assert (told.peaks, told.passes, told.noticed, told.in_passes) == (3, 6, 2, 2)
    assert (told.strong, told.strong_false) == (3, 1)
    assert told.off_p50_s == pytest.approx(0.0, abs=0.1)
    weak, strong = told.bins
    assert (weak.from_dbm, weak.peaks) == (-48, 1)
    assert weak.p50_m == pytest.approx(10.5)
    assert (strong.from_dbm, strong.peaks) == (-44, 2)
    assert (strong.p50_m, strong.p95_m) == pytest.approx((0.5, 0.5))
    # A Rayleigh distribution has the root mean square σ√2, and the median σ√(2 ln 2).
    assert (strong.sigma_m, strong.robust_sigma_m) == pytest.approx((0.3536, 0.4247), abs=1e-4)


def test_without_a_peak_there_is_nothing_to_measure() -> None:
    told = score_peaks([try_peaks([], THERE_AND_BACK, 1.5)])
    assert (told.peaks, told.noticed, told.bins) == (0, 0, [])
    assert np.isnan([told.off_p50_s, told.off_abs_p95_s, told.delay_p50_s]).all()
