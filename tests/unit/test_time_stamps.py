"""Stamps of recorders become times of samples."""

from __future__ import annotations

import numpy as np
import pytest

from edge_agent.sources.time_stamps import repaired

RATE_HZ = 397.7


def test_even_stamps_are_left_as_they_are() -> None:
    time_s = np.arange(50) / RATE_HZ
    rows, found_s = repaired(time_s, np.random.default_rng(0).normal(size=(50, 6)))
    assert rows.tolist() == list(range(50))
    np.testing.assert_array_equal(found_s, time_s)


def test_lost_samples_stay_lost() -> None:
    time_s = np.delete(np.arange(50) / RATE_HZ, [10, 11, 30])
    _, found_s = repaired(time_s, np.random.default_rng(0).normal(size=(47, 6)))
    np.testing.assert_array_equal(found_s, time_s)


def test_rows_sent_twice_are_dropped() -> None:
    time_s = np.arange(50) / RATE_HZ
    readings = np.random.default_rng(0).normal(size=(50, 6))
    twice = np.sort(np.concatenate((np.arange(50), [3, 20, 21])))
    rows, found_s = repaired(time_s[twice], readings[twice])
    np.testing.assert_array_equal(readings[twice][rows], readings)
    np.testing.assert_array_equal(found_s, time_s)


def test_bursts_are_spread_at_the_true_rate() -> None:
    true_s = 100.0 + np.arange(4000) / RATE_HZ
    # The program stamps what has arrived every 12.5 ms.
    stamps_s = np.ceil(true_s / 0.0125) * 0.0125
    rows, found_s = repaired(stamps_s, np.random.default_rng(0).normal(size=(4000, 6)))
    assert len(rows) == 4000
    assert 1.0 / np.diff(found_s).mean() == pytest.approx(RATE_HZ, rel=1e-4)
    assert np.ptp(found_s - true_s) < 1e-3


def test_a_pause_is_not_spread_over() -> None:
    burst_s = np.repeat(np.arange(40) * 0.01, 4)
    stamps_s = np.concatenate((burst_s, 10.0 + burst_s))
    _, found_s = repaired(stamps_s, np.random.default_rng(0).normal(size=(320, 6)))
    assert np.diff(found_s).max() > 9.0
    assert np.median(np.diff(found_s)) == pytest.approx(0.0025, rel=0.02)
