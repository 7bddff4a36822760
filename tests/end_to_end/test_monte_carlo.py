"""Many runs at the level of strides: the card that is promised, whoever does the work."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest

from command_post.commands import offline
from command_post.commands.offline import montecarlo
from command_post.evaluation.pooled import PooledScore, pool
from command_post.fusion.settings import FusionSettings
from command_post.incident import IncidentSettings
from command_post.rehearsing.monte_carlo import Exercise, Run, run_many
from command_post.rehearsing.rehearsal import Agents
from shared.exercise import REHEARSAL_INCIDENT
from shared.process import ExitCode
from shared.simulation.scenario import SCENARIOS

STRIDES = Agents(None, raw=False, odometry="strides")


def card(runs: list[list[Run]]) -> PooledScore:
    return pool({"corridor": [run.errors for chunk in runs for run in chunk]})


def test_nothing_depends_on_who_does_the_work() -> None:
    fusion = FusionSettings(method="published", particles=200)
    exercise = Exercise(
        "corridor", IncidentSettings(incident=REHEARSAL_INCIDENT, fusion=fusion), STRIDES
    )
    alone = list(run_many(exercise, 4, 7, workers=1))
    assert [len(chunk) for chunk in alone] == [2, 2]
    shared = list(run_many(exercise, 2, 7, workers=2))
    assert [len(chunk) for chunk in shared] == [1, 1]
    assert card(shared) == card(alone[:1])
    handled_ms = np.concatenate([run.handled_ms for run in alone[0]])
    assert (handled_ms > 0.0).all()


def test_the_command_gives_the_card_that_is_promised(tmp_path: Path) -> None:
    ran = subprocess.run(
        [sys.executable, "-m", "command_post", "montecarlo", "--scenario", "corridor",
         "--runs", "2", "--odometry", "strides", "--workers", "1", "--json",
         "--picture", str(tmp_path / "x.png")],
        capture_output=True, check=True,
    )  # fmt: skip
    told = msgspec.json.decode(ran.stdout)["scenarios"]["corridor"]
    assert told["runs"] == 2
    assert told["latency_ms"]["p99"] >= told["latency_ms"]["p50"] > 0.0
    for way in ("live", "after"):
        for errors in ("abs", "team", "pair", "dap"):
            radii = told[way][errors]
            assert 0.0 < radii["ce50_m"] <= radii["ce95_m"] < 5.0
            low, high = told[way]["intervals"][errors]["ce95_m"]
            assert low <= high
        assert told[way]["fail_pct"] == 0.0
        assert told[way]["wrong_floor_pct"] == 0.0
        assert 0.0 <= told[way]["coverage95_pct"] <= 100.0
    assert told["pdr"]["dap"] is None
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")


def test_two_scenarios_of_one_name_are_refused(tmp_path: Path) -> None:
    other = tmp_path / "corridor.toml"
    other.write_bytes((SCENARIOS / "corridor.toml").read_bytes())
    assert montecarlo(scenario=["corridor", str(other)], runs=1) == ExitCode.USAGE


def test_a_picture_that_cannot_be_drawn_costs_no_score(
    tmp_path: Path, capsysbinary: pytest.CaptureFixture[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError("no space left")

    picture = tmp_path / "x.png"
    monkeypatch.setattr(offline, "_draw", full)
    code = montecarlo(
        scenario=["corridor"], runs=1, odometry="strides", workers=10**6, picture=picture, json=True
    )
    assert code == ExitCode.FAILURE
    assert b'"corridor": {' in capsysbinary.readouterr().out
