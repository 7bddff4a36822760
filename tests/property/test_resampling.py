"""Resampling keeps expectations, and never draws what weighs nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from command_post.fusion.resampling import Scheme, resample

SCHEMES: tuple[Scheme, ...] = ("systematic", "multinomial")


def generator(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(seed))


weights = arrays(
    np.float64, st.integers(1, 60), elements=st.one_of(st.just(0.0), st.floats(1e-12, 1.0))
).filter(lambda drawn: bool(drawn.sum() > 0.0))


@given(weights, st.integers(0, 2**32 - 1), st.sampled_from(SCHEMES))
def test_only_particles_with_weight_live_on(
    drawn: NDArray[np.float64], seed: int, scheme: Scheme
) -> None:
    chosen = resample(drawn, scheme, generator(seed))
    assert chosen.shape == drawn.shape
    assert (drawn[chosen] > 0.0).all()


@given(weights, st.integers(0, 2**32 - 1))
def test_systematic_counts_are_within_one_of_their_expectation(
    drawn: NDArray[np.float64], seed: int
) -> None:
    counts = np.bincount(resample(drawn, "systematic", generator(seed)), minlength=drawn.size)
    expected = drawn.size * drawn / drawn.sum()
    assert (np.abs(counts - expected) < 1.0 + 1e-9).all()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_counts_are_their_expectation_on_average(scheme: Scheme) -> None:
    drawn = np.array([0.05, 0.0, 0.4, 0.25, 0.3])
    numbers = generator(5)
    trials = 4000
    total = sum(
        np.bincount(resample(drawn, scheme, numbers), minlength=drawn.size) for _ in range(trials)
    )
    # Standard error of a multinomial count's mean is at most √(n/4 / trials) = 0.018.
    np.testing.assert_allclose(total / trials, drawn.size * drawn, atol=0.08)


def test_systematic_wanders_less_than_multinomial() -> None:
    values, drawn = np.arange(50.0), np.linspace(1.0, 2.0, 50)
    spread = {
        scheme: np.std([values[resample(drawn, scheme, generator(s))].mean() for s in range(300)])
        for scheme in SCHEMES
    }
    assert spread["systematic"] < 0.2 * spread["multinomial"]
