"""What a stride and a proximity cost at a thousand particles."""

from __future__ import annotations

from itertools import count

from pytest_benchmark.fixture import BenchmarkFixture

from command_post.fusion.settings import FusionSettings
from command_post.fusion.tracker import Tracker
from command_post.incident import Incident, IncidentSettings
from tests.stride_world import exercise, installation, proximity, stride, track_start


def started() -> Tracker:
    tracker = Tracker(FusionSettings(particles=1000))
    tracker.install("dap1", installation(0.0, None, (0.0, 0.0)))
    tracker.start("r1", track_start(0.0))
    return tracker


def test_stride(benchmark: BenchmarkFixture) -> None:
    tracker, numbers = started(), count()
    benchmark(lambda: tracker.move("r1", stride(1.0, 0.6, 0.1, sequence=next(numbers))))
    assert tracker.estimates["r1"].north_m > 0.0


def test_stride_and_proximity(benchmark: BenchmarkFixture) -> None:
    tracker, numbers = started(), count()

    def step() -> None:
        number = next(numbers)
        tracker.move("r1", stride(1.0, 0.6 * (-1) ** number, 0.1, sequence=number))
        tracker.near("dap1", proximity(1.0, "r1", sequence=number))

    benchmark(step)
    assert tracker.estimates["r1"].last_proximity_time_ns is not None


def test_exercise(benchmark: BenchmarkFixture) -> None:
    heard = exercise(1) if benchmark.enabled else exercise(1)[:200]

    def run() -> Incident:
        incident = Incident(IncidentSettings())
        for key, payload, now_ns in ((h.key, h.payload, h.now_ns) for h in heard):
            incident.handle(key, payload, now_ns)
        return incident

    assert benchmark(run).estimates
