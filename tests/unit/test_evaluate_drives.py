"""``edge-agent evaluate`` of drives: what is drawn; and which of several mistakes is told."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from edge_agent.commands.trial_scoring import Setup, score_all
from edge_agent.evaluation.degradation import degradations
from edge_agent.mounts.methods import NOTHING_TOLD
from edge_agent.sources.trials import find_trials
from shared.process import ExitCode
from tests.drive import drive
from tests.unit.test_evaluate_command import run

VEHICLE = ("--mount", "vehicle", "--method", "robust")


def drill(folder: Path, lasts_s: float) -> Path:
    """Write the beginning of a drive, too short to slip in."""
    driven = drive(((0, 6), (4, 9), (7, 8)))
    time_s = driven.recording.time_ns / 1e9
    within = time_s < time_s[0] + lasts_s
    path = folder / "drill.npz"
    np.savez(
        path,
        t_s=time_s[within],
        acc_m_s2=driven.recording.force_m_s2[within],
        gyr_rad_s=driven.recording.rate_rad_s[within],
        truth_t_s=time_s[within][::10],
        truth_speed_m_s=driven.speed_m_s[within][::10],
    )
    return path


def test_a_degraded_drive_does_not_draw_over_the_one_recorded(tmp_path: Path) -> None:
    trials = find_trials(str(drill(tmp_path, 6.0)), 0, "vehicle")
    faults = degradations("vehicle")
    drawn = []
    for names in ([], ["20 % lost at random", "12 s lost midway"]):
        pictures = tmp_path / f"pictures{len(names)}"
        pictures.mkdir()
        tried = {name: faults[name] for name in names}
        scored = score_all(
            trials, Setup("vehicle", "robust", NOTHING_TOLD, None, 0, tried, pictures)
        )
        assert scored.code == ExitCode.OK
        (picture,) = pictures.iterdir()
        drawn.append(picture.read_bytes())
    assert drawn[0] == drawn[1]
    lost, cut = (scored.degraded[name].trials for name in names)
    assert [row.failure for row in (*lost, *cut)] == [
        None,
        "too short: none of its samples is left",
    ]


def test_a_drive_of_which_nothing_was_told_is_not_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path, pictures = drill(tmp_path, 0.8), tmp_path / "pictures"
    assert run(monkeypatch, path, *VEHICLE, "--plot", pictures, "--json") == ExitCode.OK
    (trial,) = json.loads(capsys.readouterr().out)["trials"]
    assert trial["failure"].startswith("nothing told of 0.8 s")
    assert list(pictures.iterdir()) == []


def test_of_several_mistakes_options_are_told_before_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    mistakes = [("--paced", "20"), ("--method", "robust"), (str(tmp_path / "none"),)]
    words = ["--paced: only of a chest or a waist", "--method robust: a boot is read by", "none"]
    for first, word in enumerate(words):
        arguments = [part for mistake in mistakes[first:] for part in mistake]
        assert run(monkeypatch, *arguments) == ExitCode.USAGE
        told = capsys.readouterr().err
        assert word in told
        assert not any(other in told for other in words[first + 1 : 2])
