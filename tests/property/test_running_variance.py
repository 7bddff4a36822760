"""The running variance is the variance of what is in the window, however long it has run."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from edge_agent.inertial.stance import RunningVariance


@given(st.lists(st.floats(-1e5, 1e5), min_size=1, max_size=60), st.integers(1, 12))
def test_equals_the_variance_of_the_window(values: list[float], window: int) -> None:
    running = RunningVariance()
    for index, value in enumerate(values):
        running.push(value)
        if index >= window:
            running.drop()
        inside = values[max(0, index - window + 1) : index + 1]
        expected = float(np.var(inside))
        assert np.isclose(
            running.variance(), expected, rtol=1e-4, atol=1e-6 * max(map(abs, inside))
        )
