"""What a sample costs the boot mount: a sensor of 1 kHz leaves it 1 ms."""

from __future__ import annotations

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from edge_agent.mounts.methods import MethodName, make_mount
from tests.synthetic_boot import SyntheticWalk


@pytest.mark.parametrize("method", ["eskf", "linear"])
def test_a_thousand_samples(benchmark: BenchmarkFixture, method: MethodName) -> None:
    samples = list(SyntheticWalk(strides=8).samples(100.0))[:1000]

    make_mount("boot", method)  # compiles, or reads from disk

    def follow() -> int:
        mount = make_mount("boot", method)
        return sum(mount.step(sample) is not None for sample in samples)

    assert benchmark(follow) >= 6
