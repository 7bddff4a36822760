"""What the team's fusion costs: one cold solution of a long exercise, and the post as a whole."""

from __future__ import annotations

from time import process_time

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from command_post.fusion.team.assembly import AS_TOLD, AxisBelief, assemble
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.marginals import EVERY_NODE
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.smoother import smooth
from command_post.fusion.team.solution import NOTHING, begin_from
from command_post.incident import Incident, IncidentSettings
from shared.codec import encode
from shared.messages import DapInstallation, Message, OdometryIncrement, RssiPeak, TrackStart
from shared.topics import TOPICS, Key, Role
from shared.units import NS_PER_S
from tests.benchmarks.crowd import START_NS, crowd

RESPONDERS, MINUTES, STRIDES_A_SECOND = 40, 36.0, 0.9
POST_MINUTES, FEW_POST_MINUTES = 1.5, 0.5
"""The few where nothing is timed."""

SETTINGS = TeamSettings()


@pytest.fixture(scope="module")
def log() -> TeamLog:
    """Everything that forty responders said in 36 minutes, all of them past the same DAPs."""
    told = TeamLog()
    for node_id, message in crowd(1, RESPONDERS, MINUTES, STRIDES_A_SECOND, seed=1):
        match message:
            case TrackStart():
                told.add_start(node_id, message)
            case OdometryIncrement():
                told.add_move(node_id, message)
            case RssiPeak():
                told.add_peak(node_id, message)
            case DapInstallation():
                told.add_dap(node_id, message)
    return told


def test_smoother_cold_with_covariance(benchmark: BenchmarkFixture, log: TeamLog) -> None:
    until_ns = START_NS + round((60.0 * MINUTES + 120.0) * NS_PER_S)
    belief = AxisBelief(
        "given", 0.0, SETTINGS.axis_sd_rad, frozenset((each, 0) for each in log.responders)
    )

    def solve() -> tuple[int, int, int]:
        assembled = assemble(log, until_ns, belief, AS_TOLD, SETTINGS)
        assert assembled is not None
        pose, arrow = begin_from(NOTHING, assembled)
        _, made, covariance, _ = smooth(
            assembled.graph, pose, arrow, SETTINGS.commit_iterations, SETTINGS.settled_m, EVERY_NODE
        )
        assert (covariance[:, 0] > 0.0).all()
        return made, len(pose), len(assembled.graph.tie)

    solve()
    began_s = process_time()
    made, nodes, ties = solve()
    benchmark.extra_info["processor_s"] = round(process_time() - began_s, 3)
    benchmark.extra_info.update(iterations=made, nodes=nodes, ties=ties)
    benchmark(solve)


@pytest.mark.parametrize("crews", [2, 8])
def test_whole_post_messages_in_to_estimates_out(benchmark: BenchmarkFixture, crews: int) -> None:
    """Processor time a message, and the share of a core that keeping up takes."""
    minutes = POST_MINUTES if benchmark.enabled else FEW_POST_MINUTES
    said = list(crowd(crews, 4, minutes, 2.0, seed=2))
    frames = [
        (str(Key("exercise", role_of(each.message), each.node_id, topic_of(each.message))),
         encode(each.message), each.message.event_time_ns)
        for each in said
    ]  # fmt: skip
    handled_ms: list[float] = []

    def run() -> int:
        incident, estimates = Incident(IncidentSettings()), 0
        handled_ms.clear()
        for key, payload, now_ns in frames:
            began_s = process_time()
            estimates += len(incident.handle(key, payload, now_ns))
            handled_ms.append(1e3 * (process_time() - began_s))
        return estimates

    assert benchmark.pedantic(run, rounds=1, iterations=1) >= len(frames) // 2  # type: ignore[no-untyped-call]
    p50_ms, p99_ms = np.percentile(handled_ms, (50.0, 99.0)).tolist()
    benchmark.extra_info.update(
        responders=4 * crews,
        p50_ms=round(p50_ms, 3),
        p99_ms=round(p99_ms, 3),
        worst_ms=round(max(handled_ms), 1),
        share_of_a_core=round(sum(handled_ms) / (60e3 * minutes), 3),
    )


def role_of(message: Message) -> Role:
    """Return who says such a message."""
    return "dap" if isinstance(message, (RssiPeak, DapInstallation)) else "responder"


def topic_of(message: Message) -> str:
    """Return the topic of a message."""
    return next(name for name, topic in TOPICS.items() if topic.message is type(message))
