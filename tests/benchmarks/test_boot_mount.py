"""What a sample costs: the boot mount, sample by sample and in blocks, and the whole agent."""

from __future__ import annotations

import time

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from edge_agent.agent import Agent
from edge_agent.mounts.methods import MethodName, make_mount
from edge_agent.sources.recording import Recording
from shared.bus.interface import Received
from shared.bus.memory import MemoryNetwork
from shared.messages import ImuSample
from shared.sender import Sender
from tests.recorded import recorded
from tests.synthetic_boot import SyntheticWalk

pytestmark = pytest.mark.benchmark(timer=time.process_time)


@pytest.fixture(scope="module")
def walk() -> Recording:
    return recorded(SyntheticWalk(strides=50), 200.0)


@pytest.fixture(scope="module")
def samples(walk: Recording) -> list[ImuSample]:
    return list(walk)


def tell_rate(benchmark: BenchmarkFixture, count: int) -> None:
    """Write the samples a second of one core, if it was measured."""
    if benchmark.stats is not None:
        fastest_s = benchmark.stats.stats.min
        benchmark.extra_info["samples_per_s"] = round(count / fastest_s)
        benchmark.extra_info["us_per_sample"] = round(1e6 * fastest_s / count, 2)


@pytest.mark.parametrize("method", ["eskf", "linear"])
def test_a_mount_sample_by_sample(
    benchmark: BenchmarkFixture, samples: list[ImuSample], method: MethodName
) -> None:
    make_mount("boot", method)  # compiles, or reads from disk

    def follow() -> int:
        mount = make_mount("boot", method)
        return sum(mount.step(sample) is not None for sample in samples)

    assert benchmark(follow) >= 49
    tell_rate(benchmark, len(samples))


def test_a_mount_in_blocks(benchmark: BenchmarkFixture, walk: Recording) -> None:
    make_mount("boot", "eskf")
    assert len(benchmark(lambda: make_mount("boot", "eskf").steps(walk))) >= 49
    tell_rate(benchmark, len(walk))


@pytest.mark.parametrize("sends_imu", [True, False])
def test_an_agent(benchmark: BenchmarkFixture, samples: list[ImuSample], sends_imu: bool) -> None:
    make_mount("boot", "eskf")
    network = MemoryNetwork()
    heard: list[Received] = []
    network.connect().subscribe("clew/**/increment", heard.append)

    def follow() -> int:
        heard.clear()
        sender = Sender(network.connect(), "fire", "responder", "r1")
        agent = Agent(sender, make_mount("boot", "eskf"), "eskf", None, sends_imu=sends_imu)
        for sample in samples:
            agent.take(sample)
        return len(heard)

    assert benchmark(follow) >= 49
    tell_rate(benchmark, len(samples))
