"""Stamps that jitter are made even again; those that are as they should be are left alone."""

from __future__ import annotations

import numpy as np
import pytest

from edge_agent.mounts.steady_samples import SteadySamples
from shared.messages import ImuSample

PERIOD_NS = 10_000_000
BEGIN_NS = 1_698_501_144_401_773_000
FIRST = 500


def even(count: int = 3000) -> np.ndarray:
    return BEGIN_NS + PERIOD_NS * np.arange(count)


def jittered(times_ns: np.ndarray, sd_ms: float = 5.0, seed: int = 1) -> np.ndarray:
    """Return stamps that rise, as those that an intake lets in."""
    off_ns = 1e6 * sd_ms * np.random.default_rng(seed).normal(size=len(times_ns))
    return np.maximum.accumulate(
        np.sort(times_ns + off_ns.astype(np.int64)) + np.arange(len(off_ns))
    )


def steadied(stamps_ns: np.ndarray) -> np.ndarray:
    steady = SteadySamples(stamps_ns[:FIRST].tolist())
    taken = [
        steady.take(ImuSample(one, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0))).time_ns
        for one in stamps_ns.tolist()
    ]
    assert np.diff(taken).min() > 0
    return np.array(taken)


def off_ms(taken_ns: np.ndarray, times_ns: np.ndarray) -> float:
    """Return by how much they are off but for a constant, root mean square."""
    return float(np.std((taken_ns - times_ns)[FIRST:])) / 1e6


@pytest.mark.parametrize("seed", range(5))
def test_jitter_is_taken_out(seed: int) -> None:
    stamps_ns = jittered(even(), seed=seed)
    assert off_ms(stamps_ns, even()) > 4.0
    assert off_ms(steadied(stamps_ns), even()) < 1.0


@pytest.mark.parametrize(
    "kept",
    [
        np.arange(3000),
        np.flatnonzero(np.random.default_rng(2).random(3000) > 0.2),
        np.unique(np.round(np.arange(0, 2900, 1.923)).astype(int)),
        np.r_[0:1000, 1400:3000],
    ],
    ids=["even", "a fifth lost", "52 Hz of 100", "a gap"],
)
def test_stamps_on_a_grid_are_left_as_they_are(kept: np.ndarray) -> None:
    stamps_ns = even()[kept]
    assert (steadied(stamps_ns) == stamps_ns).all()


def test_a_sample_lost_among_the_jitter_is_noticed() -> None:
    times_ns = np.delete(even(), np.arange(600, 3000, 150))
    assert off_ms(steadied(jittered(times_ns)), times_ns) < 2.5


def test_a_gap_among_the_jitter_is_kept() -> None:
    times_ns = np.r_[even()[:1000], even()[1700:]]
    taken_ns = steadied(jittered(times_ns))
    assert taken_ns[1000] - taken_ns[999] == pytest.approx(7.01e9, abs=0.02e9)
    assert off_ms(taken_ns, times_ns) < 6.0


def test_where_many_are_lost_among_the_jitter_stamps_are_left_as_they_are() -> None:
    kept = np.flatnonzero(np.random.default_rng(3).random(3000) > 0.1)
    stamps_ns = jittered(even()[kept])
    assert (steadied(stamps_ns) == stamps_ns).all()


def test_another_rate_is_followed() -> None:
    slow_ns = even(1000)
    times_ns = np.r_[slow_ns, slow_ns[-1] + PERIOD_NS // 4 * np.arange(1, 3001)]
    taken_ns = steadied(np.r_[jittered(slow_ns), jittered(times_ns[1000:], 1.0)])
    assert np.std((taken_ns - times_ns)[1500:]) < 5e6


def test_too_few_tell_no_rate() -> None:
    stamps_ns = jittered(even(5))
    assert (steadied(stamps_ns) == stamps_ns).all()
