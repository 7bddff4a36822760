"""What the team's fusion costs: one cold solution of a long exercise."""

from __future__ import annotations

from time import process_time

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from command_post.fusion.team.assembly import AxisBelief, assemble
from command_post.fusion.team.elimination import EVERY_NODE
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.smoother import smooth
from command_post.fusion.team.solution import NOTHING, begin_from
from shared.messages import DapInstallation, OdometryIncrement, RssiPeak, TrackStart
from shared.units import NS_PER_S
from tests.benchmarks.crowd import START_NS, crowd

RESPONDERS, MINUTES, STRIDES_A_SECOND = 40, 36.0, 0.9
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
    belief = AxisBelief("given", 0.0, SETTINGS.axis_sd_rad, frozenset(log.responders))

    def solve() -> tuple[int, int, int]:
        assembled = assemble(log, until_ns, belief, 1.0, SETTINGS)
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
