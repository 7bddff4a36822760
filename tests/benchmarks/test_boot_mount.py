"""What a sample costs the boot mount: a sensor of 1 kHz leaves it 1 ms."""

from __future__ import annotations

from pytest_benchmark.fixture import BenchmarkFixture

from edge_agent.mounts.boot import BootMount
from tests.synthetic_boot import SyntheticWalk


def test_a_thousand_samples(benchmark: BenchmarkFixture) -> None:
    samples = list(SyntheticWalk(strides=8).samples(100.0))[:1000]

    def follow() -> int:
        mount = BootMount()
        return sum(mount.step(sample) is not None for sample in samples)

    assert benchmark(follow) >= 6
