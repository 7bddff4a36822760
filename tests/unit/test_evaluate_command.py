"""``edge-agent evaluate`` from its command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from edge_agent.__main__ import main
from edge_agent.commands import trial_scoring
from edge_agent.evaluation.degradation import DEGRADATIONS, degradations
from edge_agent.evaluation.score_card import failed_trial, score_trial
from edge_agent.evaluation.scorers import SCORERS
from edge_agent.mounts.boot import BootMount
from edge_agent.sources import npz_set
from shared.npz_file import load_npz
from shared.process import ExitCode
from tests.bouncing_phone import Phone
from tests.synthetic_boot import SyntheticWalk


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of one good recording, with truth."""
    found = tmp_path / "drill"
    found.mkdir()
    walk = SyntheticWalk(strides=8, turn_rad=0.2)
    samples = list(walk.samples(100.0))
    places: NDArray[np.float64] = np.array(walk.stance_places_m)
    np.savez(
        found / "good.npz",
        t_s=[sample.time_ns / 1e9 for sample in samples],
        acc_m_s2=[sample.force_m_s2 for sample in samples],
        gyr_rad_s=[sample.rate_rad_s for sample in samples],
        truth_stride_index=np.rint(np.array(walk.stance_times_s) * 100.0).astype(np.int64),
        truth_stride_xy_m=places[:, :2] * [1.0, -1.0],
    )
    return found


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr("sys.argv", ["edge-agent", "evaluate", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert isinstance(ended.value.code, int)
    return ended.value.code


def card(capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_json_has_trials_and_sets(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, folder, "--json") == ExitCode.OK
    found = card(capsys)
    (trial,) = found["trials"]
    assert (trial["name"], trial["set"], trial["n_strides"]) == ("good", "drill", 8)
    assert abs(trial["distance_error_pct"]) < 0.2
    assert trial["failure"] is None
    assert found["sets"]["drill"]["n"] == 1
    assert abs(found["sets"]["drill"]["ate_pct"]["median"]) < 0.1
    assert trial["coverage95_pct"] == 100.0
    assert trial["samples_per_s"] > 0.0
    assert "degraded" not in found


def test_degraded_trials_are_scored_set_by_set(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, folder, "--degrade", "--json", "--method", "linear") == ExitCode.OK
    found = card(capsys)
    assert list(found["degraded"]) == list(DEGRADATIONS)
    assert len(found["trials"]) == 1
    medians = {
        name: sets["drill"]["distance_error_pct"]["median"]
        for name, sets in found["degraded"].items()
    }
    # Linear calibration takes 1 % more force for 1 % more distance.
    assert medians["accelerometer +1 %"] == pytest.approx(1.0, abs=0.2)
    assert medians["clock +0.5 %"] == pytest.approx(1.0, abs=0.2)
    assert medians["±8 g"] < 0.2
    assert run(monkeypatch, folder, "--degrade", "--json", "--method", "linear") == ExitCode.OK
    again = card(capsys)["degraded"]["5 % lost at random"]["drill"]
    assert again["ate_pct"] == found["degraded"]["5 % lost at random"]["drill"]["ate_pct"]


def test_a_phones_faults_are_others_than_a_boots(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    phone = list(Phone(steps=12, rate_hz=50.0).samples())
    np.savez(
        folder / "good.npz",
        t_s=np.array([one.time_ns for one in phone]) / 1e9,
        acc_m_s2=np.array([one.force_m_s2 for one in phone]),
        gyr_rad_s=np.array([one.rate_rad_s for one in phone]),
        truth_steps=np.clip([2.0 * one.time_ns / 1e9 - 4.0 for one in phone], 0.0, 12.0),
    )
    options = ("--mount", "chest", "--method", "robust", "--degrade", "--json")
    assert run(monkeypatch, folder, *options) == ExitCode.OK
    found = card(capsys)
    assert list(found["degraded"]) == list(degradations("chest"))
    steps = {name: sets["drill"] for name, sets in found["degraded"].items()}
    assert steps["25 Hz, averaged"]["steps_error_pct"]["median"] == 0.0
    assert steps["forces in g"]["failed"] == 1


def test_the_degraded_table_names_every_degradation(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "torn.npz").write_bytes(b"torn")
    assert run(monkeypatch, folder, "--degrade", "--method", "linear") == ExitCode.FAILURE
    out = capsys.readouterr().out
    table = out[out.index("Degraded, medians (boot, linear)") :]
    for name in ("as recorded", *DEGRADATIONS):
        assert name in table
    assert "(1 failed)" in table


def test_times_that_cannot_be_resampled_fail_the_degradation_alone(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with np.load(folder / "good.npz") as stored:
        arrays = dict(stored)
    arrays["t_s"][5] = arrays["t_s"][4]
    np.savez(folder / "good.npz", **arrays)
    assert run(monkeypatch, folder, "--degrade", "--json", "--method", "linear") == ExitCode.OK
    found = card(capsys)
    assert found["trials"][0]["failure"] is None
    failed = {name: sets["drill"]["failed"] for name, sets in found["degraded"].items()}
    assert failed == {name: int("Hz" in name) for name in DEGRADATIONS}


def test_a_picture_a_trial_is_drawn(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "torn.npz").write_bytes(b"torn")
    pictures = tmp_path / "new" / "pictures"
    assert run(monkeypatch, folder, "--plot", pictures) == ExitCode.FAILURE
    assert [file.name for file in pictures.iterdir()] == ["drill_good.png"]


def test_a_folder_for_pictures_that_is_a_file_is_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run(monkeypatch, folder, "--plot", folder / "good.npz") == ExitCode.USAGE


def test_tables_are_for_people(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, folder / "good.npz", "--mount", "boot", "--method", "linear") == 0
    out = capsys.readouterr().out
    assert "good" in out
    assert "distance %" in out
    assert "…" not in out


def test_a_file_that_cannot_be_used_is_listed_and_counted(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "torn.npz").write_bytes((folder / "good.npz").read_bytes()[:3000])
    assert run(monkeypatch, folder, "--json") == ExitCode.FAILURE
    found = card(capsys)
    assert [trial["name"] for trial in found["trials"]] == ["good", "torn"]
    assert "torn.npz: not a whole .npz file" in found["trials"][1]["failure"]
    assert (found["sets"]["drill"]["n"], found["sets"]["drill"]["failed"]) == (2, 1)


def test_a_trial_that_breaks_the_mount_is_listed_and_counted(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def step(*_: object) -> None:
        raise ZeroDivisionError("of all things")

    monkeypatch.setattr(BootMount, "step", step)
    assert run(monkeypatch, folder, "--json", "--method", "linear") == ExitCode.FAILURE
    assert card(capsys)["trials"][0]["failure"] == "ZeroDivisionError: of all things"


@pytest.mark.parametrize("broken", ["score_trial", "load_npz", "failed_trial"])
def test_whatever_breaks_one_trial_the_others_are_scored(
    broken: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "bad.npz").write_bytes((folder / "good.npz").read_bytes())
    whole = load_npz if broken == "load_npz" else score_trial

    def breaks(named: Any, *arguments: Any) -> Any:
        if Path(named).stem == "bad":
            raise ZeroDivisionError("of all things")
        return whole(named, *arguments)

    def breaks_with_truth(name: str, group: str, truth: object, failure: str) -> object:
        if truth is not None:
            raise ZeroDivisionError("of all things")
        return failed_trial(name, group, None, failure)

    if broken == "load_npz":
        monkeypatch.setattr(npz_set, broken, breaks)
    else:
        monkeypatch.setitem(SCORERS, "boot", breaks)
    if broken == "failed_trial":
        monkeypatch.setattr(trial_scoring, broken, breaks_with_truth)
    assert run(monkeypatch, folder, "--json", "--method", "linear") == ExitCode.FAILURE
    bad, good = card(capsys)["trials"]
    assert bad["failure"] == "ZeroDivisionError: of all things"
    assert good["failure"] is None


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param([], id="nothing named"),
        pytest.param(["/does/not/exist"], id="no such file"),
        pytest.param(["simulated:no_such_scenario"], id="no such scenario"),
        pytest.param([".", "--method", "guess"], id="no such method"),
        pytest.param([".", "--colour"], id="no such option"),
    ],
)
def test_a_wrong_command_line_exits_with_2(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(monkeypatch, *arguments) == ExitCode.USAGE


def test_an_empty_folder_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run(monkeypatch, tmp_path) == ExitCode.USAGE


def test_a_building_can_hold_the_heading(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, folder, "--dominant-direction") == ExitCode.OK
    assert "dominant direction" in capsys.readouterr().out


def test_a_method_that_knows_no_building_says_so(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = (folder, "--method", "linear", "--dominant-direction")
    assert run(monkeypatch, *arguments) == ExitCode.USAGE
