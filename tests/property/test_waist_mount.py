"""Whatever a sensor on the belt reads, the mount goes on, and its way is made of numbers."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from edge_agent.mounts.methods import MethodName, make_mount
from shared.messages import ImuSample, Vector3

AXIS = st.floats(-60.0, 60.0) | st.sampled_from([math.nan, math.inf, -1e300, 0.0])
VECTOR = st.tuples(AXIS, AXIS, AXIS)
SAMPLE = st.builds(
    lambda since_ms, force, rate, field, held: (since_ms, force, rate, field, held),
    st.sampled_from([10, 10, 10, 0, -30, 140, 1500, 10**12]),
    VECTOR,
    VECTOR,
    st.none() | VECTOR,
    st.integers(1, 40),
)


@given(st.lists(SAMPLE, max_size=12), st.sampled_from(["robust", "published"]))
def test_no_readings_stop_the_mount(
    stretches: list[tuple[int, Vector3, Vector3, Vector3 | None, int]],
    method: MethodName,
) -> None:
    mount = make_mount("waist", method)
    time_ns, told = 0, []
    for since_ms, force, rate, field, held in stretches:
        for _ in range(held):
            time_ns += since_ms * 1_000_000
            told.append(mount.step(ImuSample(time_ns, force, rate, field)))
    for one in (*filter(None, told), *mount.finish()):
        assert all(map(math.isfinite, (*one.displacement_m, one.heading_rad, *one.covariance)))
        assert one.start_time_ns <= one.end_time_ns
