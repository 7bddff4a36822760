"""Whatever samples come, the mount neither raises nor says what the wire cannot carry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge_agent.mounts.methods import MethodName, make_mount
from shared.codec import decode, encode
from shared.messages import ImuSample, OdometryIncrement, Vector3
from shared.topics import Key

KEY = Key("drill", "responder", "r1", "increment")

readings = st.one_of(
    st.sampled_from([0.0, -9.81, 1.0, 40.0, math.nan, math.inf, -1e308]), st.floats()
)
vectors: st.SearchStrategy[Vector3] = st.tuples(readings, readings, readings)
steps_ns = st.one_of(
    st.sampled_from([10_000_000, 10_000_000, 10_000_000, 0, -10_000_000, 60_000_000]),
    st.integers(-(10**12), 10**12),
)
pressures = st.none() | st.floats() | st.floats(25_000.0, 125_000.0)


@st.composite
def streams(draw: st.DrawFn) -> list[ImuSample]:
    """Spells of one reading repeated: long enough to pass for standing, swinging and being lost."""
    time_ns, samples = 10**15, []
    for _ in range(draw(st.integers(1, 8))):
        force, rate, field = draw(vectors), draw(vectors), draw(st.none() | vectors)
        step_ns, pressure_pa = draw(steps_ns), draw(pressures)
        for index in range(draw(st.sampled_from([1, 3, 30, 150]))):
            time_ns += step_ns
            weighs_pa = None if pressure_pa is None else pressure_pa - 5.0 * index
            samples.append(ImuSample(max(0, time_ns), force, rate, field, weighs_pa))
    return samples


@pytest.mark.parametrize("method", ["eskf", "linear"])
@given(samples=streams())
def test_any_stream_gives_only_increments_that_can_be_sent(
    method: MethodName, samples: list[ImuSample]
) -> None:
    mount = make_mount("boot", method)
    increments = []
    for sample in samples:
        increment = mount.step(sample)
        assert math.isfinite(mount.heading_rad)
        increments += [] if increment is None else [increment]
    for increment in increments + mount.finish():
        assert increment.start_time_ns <= increment.end_time_ns
        north_m, east_m, down_m = increment.displacement_m
        message = OdometryIncrement(
            event_time_ns=increment.end_time_ns,
            sequence=0,
            start_time_ns=increment.start_time_ns,
            d_north_m=north_m,
            d_east_m=east_m,
            d_down_m=down_m,
            d_heading_rad=increment.d_heading_rad,
            heading_rad=increment.heading_rad,
            covariance=increment.covariance,
            mount="boot",
        )
        assert decode(KEY, encode(message)) == message
        covariance = np.zeros((4, 4))
        covariance[np.triu_indices(4)] = increment.covariance
        covariance += np.triu(covariance, 1).T
        assert np.linalg.eigvalsh(covariance).min() > -1e-9 * covariance.max()
