"""Whatever a sensor sends, what watches it goes on watching."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from edge_agent.alarms import AlarmWatch
from edge_agent.inertial.activity import ActivityClassifier
from edge_agent.mounts.interface import Faults, Increment
from edge_agent.self_check.checker import SelfCheck
from shared.messages import ImuSample
from tests.unit.test_activity import KNOWN

numbers = st.one_of(
    st.floats(), st.floats(-20.0, 20.0), st.sampled_from([0.0, 1e200, -1e308, 1e5, float("nan")])
)
vectors = st.tuples(numbers, numbers, numbers)
samples = st.builds(ImuSample, st.integers(0, 20 * 10**9), vectors, vectors)


@given(st.lists(samples, max_size=60), st.booleans())
def test_no_sample_raises(readings: list[ImuSample], in_order: bool) -> None:
    watch, classifier = AlarmWatch(), ActivityClassifier()
    check = SelfCheck(Faults())
    watch.flat = (0.0, 0.0, -1.0)
    for sample in sorted(readings, key=lambda one: one.time_ns) if in_order else readings:
        watch.take_sample(sample)
        classifier.take_sample(sample)
        check.take_sample(sample)
        check.pass_time(sample.time_ns)
        since_ns = max(0, sample.time_ns - 10**9)
        increment = Increment(since_ns, sample.time_ns, (1.2, 0.0, -0.3), 0.0, 0.0, KNOWN, ())
        estimate = classifier.take_increment(increment)
        assert 0.0 <= estimate.confidence <= 1.0
