"""A DAP offline: the log is what it would have said, and the same each time."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from structlog.testing import capture_logs

from dap_node.__main__ import app
from dap_node.commands.rehearse import rehearse_dap
from dap_node.evaluation import LinkTrial, detect, score, try_dap
from dap_node.peak_score import PeakTrial, score_peaks
from dap_node.proximity import ProximitySettings
from dap_node.scanners.simulated import SimulatedScanner
from dap_node.settings import DapSettings
from dap_node.true_range import PASS_M
from shared.bus.wire_log import read_wire_log
from shared.codec import Refusal, decode, parse_key
from shared.exercise import REHEARSAL_INCIDENT, REHEARSAL_START_NS
from shared.messages import ProximityEvent
from shared.process import ExitCode
from shared.simulation.scenario import Scenario, load_scenario

SEED = 5
NONE = np.array([])
NO_PEAKS = PeakTrial(NONE, NONE, NONE, 1, 0, 0, NONE)


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("four_daps")


def test_the_log_is_all_that_it_says_in_the_order_of_time(
    scenario: Scenario, tmp_path: Path
) -> None:
    rehearse_dap(scenario, "dap2", SEED, tmp_path)
    frames = list(read_wire_log(tmp_path / "dap2.wire"))
    times_ns = [frame.time_ns for frame in frames]
    assert times_ns == sorted(times_ns)
    assert times_ns[0] > REHEARSAL_START_NS
    topics: Counter[str] = Counter()
    told = []
    for frame in frames:
        key = parse_key(frame.key)
        assert not isinstance(key, Refusal)
        message = decode(key, frame.payload)
        assert not isinstance(message, Refusal)
        assert (key.incident, key.role, key.node_id) == (REHEARSAL_INCIDENT, "dap", "dap2")
        assert message.sequence == topics[key.topic]
        topics[key.topic] += 1
        if isinstance(message, ProximityEvent):
            told.append((message.event_time_ns, message.responder_id, message.phase))
    assert topics["installation"] == 1
    assert set(topics) == {"installation", "truth", "rssi", "proximity", "peak"}
    observations = SimulatedScanner(scenario, "dap2", SEED).observations(REHEARSAL_START_NS)
    assert told == [event[:3] for event in detect(observations, ProximitySettings())]


def test_rehearsed_in_another_process_it_says_the_same(scenario: Scenario, tmp_path: Path) -> None:
    command = ["rehearse", "four_daps", "--seeds", "2-3", "--output", str(tmp_path / "logs")]
    ran = subprocess.run(
        [sys.executable, "-m", "dap_node", *command], capture_output=True, text=True, check=True
    )
    assert (ran.stdout, ran.stderr) == ("", "")
    logs = sorted(str(path.relative_to(tmp_path / "logs")) for path in tmp_path.glob("logs/*/*"))
    assert logs == [f"{seed}/dap{number}.wire" for seed in (2, 3) for number in (1, 2, 3, 4)]
    rehearse_dap(scenario, "dap2", 2, tmp_path)
    log = (tmp_path / "dap2.wire").read_bytes()
    assert (tmp_path / "logs/2/dap2.wire").read_bytes() == log
    assert (tmp_path / "logs/3/dap2.wire").read_bytes() != log


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["rehearse", "four_dap", "--output", "."], "four_daps"),
        (["rehearse", "four_daps", "--seeds", "9-0", "--output", "."], "as in 0-9"),
        (["evaluate", "course"], "no DAP to evaluate"),
        (["run", "--insecure", "--id", "dap2", "--source", "wlan0"], "or simulated:SCENARIO"),
        (["run", "--insecure", "--id", "dap/2", "--source", "simulated:four_daps"], "--id 'dap/2'"),
        (["run", "--insecure", "--id", "dap2", "--source", "simulated:four_daps",
          "--listen", "tcp/0.0.0.0:1"], "nothing is encrypted or authenticated"),
        (["run", "--id", "dap2", "--source", "simulated:four_daps"], "give --keys FOLDER"),
    ],
)  # fmt: skip
def test_mistakes_on_the_command_line_are_told(arguments: list[str], complaint: str) -> None:
    with capture_logs() as logs:
        code = app(arguments, exit_on_error=False, result_action="return_value")
    assert code == ExitCode.USAGE
    assert complaint in logs[-1]["event"]


def test_thresholds_come_from_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "dap.toml"
    file.write_text("[proximity]\nenter_dbm = -20.0\nleave_dbm = -25.0\n")
    command = ["evaluate", "stairwell", "--seeds", "0", "--config", str(file)]
    assert app(command, exit_on_error=False, result_action="return_value") == ExitCode.OK
    rows = [line.split("│") for line in capsys.readouterr().out.splitlines() if "│" in line]
    told = {row[1].strip(): row[2].strip() for row in rows}
    assert told["events told"] == "0"
    assert int(told["passes within 1.5 m"]) > 0
    file.write_text("[proximity]\nenter_db = -20.0")
    with capture_logs() as logs:
        code = app(command, exit_on_error=False, result_action="return_value")
    assert code == ExitCode.USAGE
    assert "did you mean 'enter_dbm'" in logs[-1]["event"]


def test_near_means_within_some_metres(scenario: Scenario) -> None:
    """Fusion takes it as at the DAP, with a standard deviation of 1.7 m in each direction."""
    trials = [
        trial
        for seed in range(2)
        for dap_id in scenario.daps
        for trial in try_dap(scenario, dap_id, seed, DapSettings(), PASS_M)
    ]
    told = score(trials)
    assert told.events > 100
    assert told.p50_m < 1.7
    assert told.p95_m < 1.7 * 2.45
    assert told.beyond_5_m < 0.05
    assert told.noticed > 0.7 * told.passes


def test_peaks_place_a_pass_closer_than_nearness_does(scenario: Scenario) -> None:
    trials = [
        trial.peaks
        for seed in range(2)
        for dap_id in scenario.daps
        for trial in try_dap(scenario, dap_id, seed, DapSettings(), PASS_M)
    ]
    told = score_peaks(trials)
    assert told.noticed >= 0.95 * told.passes
    assert told.in_passes <= 1.2 * told.noticed
    assert told.off_abs_p95_s < 1.0
    assert told.strong_false <= 0.05 * told.strong
    sigma_m = {one.from_dbm: one.sigma_m for one in told.bins}
    assert sigma_m[-44] < sigma_m[-48] < 1.0


def test_scores_add_up() -> None:
    told = score(
        [
            LinkTrial(np.array([1.0]), np.array([2.0, 3.0]), 2, 1, NO_PEAKS),
            LinkTrial(np.array([]), np.array([]), 1, 0, NO_PEAKS),
            LinkTrial(np.array([3.0]), np.array([6.0]), 1, 1, NO_PEAKS),
        ]
    )
    assert (told.stays, told.events, told.passes, told.noticed) == (2, 5, 4, 2)
    assert (told.entered_p50_m, told.p50_m) == (2.0, 3.0)
    assert (told.beyond_3_m, told.beyond_5_m) == (0.2, 0.2)


def test_without_an_event_there_is_no_distance() -> None:
    told = score([LinkTrial(np.array([]), np.array([]), 1, 0, NO_PEAKS)])
    assert (told.events, told.passes) == (0, 1)
    assert np.isnan(told.p50_m)


def test_readings_are_left_out_of_the_log_where_nobody_wants_them(
    scenario: Scenario, tmp_path: Path
) -> None:
    rehearse_dap(scenario, "dap2", SEED, tmp_path / "all")
    rehearse_dap(scenario, "dap2", SEED, tmp_path / "few", sends_rssi=False)
    everything, few = (
        [(frame.time_ns, frame.key, frame.payload) for frame in read_wire_log(path / "dap2.wire")]
        for path in (tmp_path / "all", tmp_path / "few")
    )
    assert few == [frame for frame in everything if not frame[1].endswith("/rssi")]
    assert len(few) < len(everything)
