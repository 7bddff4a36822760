"""Recordings of a beacon carried by receivers: how they are read, brought to scale and tried."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from structlog.testing import capture_logs

from dap_node.__main__ import app
from dap_node.evaluation import to_scale
from dap_node.measured import read_measured
from dap_node.radio_survey import fit_path_loss
from dap_node.scanners.observation import Scan
from dap_node.settings import DapSettings
from dap_node.walk_by import try_receivers
from shared.npz_file import NpzFileError
from shared.process import ExitCode
from shared.units import NS_PER_S
from shared.walk_by import calibration_db, read_walk_by

RECEIVERS_M = np.array([[0.0, 0.5, 1.0], [20.0, 0.5, 1.0]])


def passing(power_at_1_m_dbm: float = -60.0, exponent: float = 2.2) -> dict[str, Any]:
    """Return a walk past two receivers at 1 m/s, heard 5 times a second by each, out of order."""
    time_s = np.repeat(np.arange(-20.0, 40.0, 0.2), 2)
    receiver = np.tile([0, 1], len(time_s) // 2)
    beacon_m = np.column_stack([time_s, 0.0 * time_s, np.ones_like(time_s)])
    range_m = np.linalg.norm(beacon_m - RECEIVERS_M[receiver], axis=1)
    order = np.random.default_rng(0).permutation(len(time_s))
    arrays = {
        "t_s": 1.5e9 + time_s,
        "receiver": receiver.astype(np.int16),
        "rssi_dbm": power_at_1_m_dbm - 10.0 * exponent * np.log10(range_m),
        "truth_xyz_m": beacon_m,
    }
    shuffled = {name: array[order] for name, array in arrays.items()}
    return {**shuffled, "receiver_xyz_m": RECEIVERS_M}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    np.savez(tmp_path / "walk.npz", **passing())
    return tmp_path / "walk.npz"


def test_power_and_its_fall_are_found_again(path: Path) -> None:
    fit = fit_path_loss(read_measured(path).readings, np.random.default_rng(0))
    assert fit[:3] == pytest.approx((-60.0, 2.2, 0.0), abs=1e-5)
    assert calibration_db([read_walk_by(path)]) == pytest.approx(20.0)


def test_every_receiver_notices_its_pass(path: Path) -> None:
    trials = try_receivers(read_walk_by(path), DapSettings(offset_db=20.0), 1.5)
    assert [trial.passes for trial in trials] == [1, 1]
    assert [trial.noticed for trial in trials] == [1, 1]
    for trial in trials:
        assert trial.peaks.range_m == pytest.approx([0.5], abs=0.1)
        assert trial.peaks.off_s == pytest.approx([0.0], abs=0.2)


def test_recordings_are_evaluated_at_the_command_line(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["evaluate", str(path.parent), "--json"]
    assert app(command, exit_on_error=False, result_action="return_value") == ExitCode.OK
    told = msgspec.json.decode(capsys.readouterr().out)
    assert told["path_loss"]["exponent"] == pytest.approx(2.2)
    assert told["offset_db"] == pytest.approx(20.0)
    assert (told["peaks"]["passes"], told["peaks"]["noticed"]) == (2, 2)
    (kind,) = told["kinds"]
    assert kind["together"]["fit"]["exponent"] == pytest.approx(2.2)
    assert kind["comparison"]["configured"]["published"]["score"]["passes"] == 2
    assert told["failed"] == []


def test_what_cannot_be_read_is_told_and_the_rest_measured(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (path.parent / "broken.npz").write_bytes(b"PK")
    (path.parent / "empty.npz").write_bytes(b"")
    stood = RECEIVERS_M[passing()["receiver"]] + [3.0, 0.0, 0.0]
    np.savez(path.parent / "stood.npz", **passing() | {"truth_xyz_m": stood})
    few = {name: values[:4] for name, values in passing().items() if name != "receiver_xyz_m"}
    np.savez(path.parent / "few.npz", **few, receiver_xyz_m=RECEIVERS_M)
    (path.parent / "room.csv").write_text("a,b\n")
    picture = path.parent / "radio.png"
    command = ["evaluate", str(path.parent), "--plot", str(picture), "--within", "2"]
    with capture_logs() as logs:
        code = app(command, exit_on_error=False, result_action="return_value")
    assert code == ExitCode.FAILURE
    for (name, complaint), log in zip(
        {
            "broken.npz": "not a whole",
            "empty.npz": "not a whole",
            "few.npz": "too few readings",
            "room.csv": "its columns are a, b",
            "stood.npz": "all its readings are of one range",
        }.items(),
        logs,
        strict=True,
    ):
        assert f"{name}: {complaint}" in log["event"]
    printed = capsys.readouterr().out
    assert "passes within 2 m" in printed
    assert "threshold" in printed
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"receiver": None}, "no array receiver; it has"),
        ({"rssi_dbm": np.zeros(3)}, "rssi_dbm has shape"),
        ({"receiver": np.full(600, 7)}, "receiver points outside receiver_xyz_m"),
        ({"t_s": np.arange(600.0) * 1e6}, "t_s spans 599000000 s"),
        ({"t_s": np.zeros(600)}, "t_s spans 0 s"),
        ({"rssi_dbm": np.full(600, 1e9)}, "rssi_dbm holds what no radio reads"),
        ({"truth_xyz_m": np.full((600, 3), np.nan)}, "truth_xyz_m holds what is no number"),
        ({"receiver_xyz_m": np.float64(3.0)}, "receiver_xyz_m has shape"),
    ],
)
def test_what_is_no_walk_is_refused(
    tmp_path: Path, changes: dict[str, Any], complaint: str
) -> None:
    path = tmp_path / "walk.npz"
    arrays = {name: value for name, value in (passing() | changes).items() if value is not None}
    np.savez(path, **arrays)
    with pytest.raises(NpzFileError, match=complaint):
        read_walk_by(path)


@pytest.mark.parametrize(
    ("names", "complaint"),
    [
        ([], "give one scenario"),
        (["four_daps", "corridor"], "give one scenario"),
        (["walk.npz"], "walk.npz: no such file"),
        (["empty"], "empty: no .npz file in it"),
        (["corridor", "--plot", "radio.png"], "--plot draws recordings"),
        (["empty/room.csv"], "room.csv: no such file"),
    ],
)
def test_what_cannot_be_evaluated_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, names: list[str], complaint: str
) -> None:
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path)
    with capture_logs() as logs:
        code = app(["evaluate", *names], exit_on_error=False, result_action="return_value")
    assert code == ExitCode.USAGE
    assert complaint in logs[-1]["event"]


def test_a_walk_that_came_no_nearer_is_brought_to_scale_by_how_power_falls(path: Path) -> None:
    recording = read_walk_by(path)
    off = recording._replace(beacon_m=recording.beacon_m + np.array([0.0, 4.0, 0.0]))
    fallen = off._replace(rssi_dbm=-60.0 - 22.0 * np.log10(off.slant_m))
    assert off.slant_m.min() > 3.0
    assert calibration_db([fallen]) == pytest.approx(20.0, abs=0.1)


def test_radios_of_a_model_are_judged_by_its_offset() -> None:
    scans = [Scan(NS_PER_S, {"r1": -60.0, "r2": -60.0}), Scan(2 * NS_PER_S, {})]
    settings = DapSettings(offset_db=2.0, model_offset_db={"quiet": 7.0}, model_of={"r2": "quiet"})
    assert [scan.rssi_dbm for scan in to_scale(scans, settings)] == [
        {"r1": -58.0, "r2": -51.0}, {},
    ]  # fmt: skip


def test_the_beacon_of_recordings_may_be_of_a_model(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "dap.toml"
    config.write_text('[model_offset_db]\nquiet = 20.0\n[model_of]\nbeacon = "quiet"\n')
    command = ["evaluate", str(path), "--json", "--config", str(config)]
    assert app(command, exit_on_error=False, result_action="return_value") == ExitCode.OK
    told = msgspec.json.decode(capsys.readouterr().out)
    assert told["offset_db"] == 20.0
    assert (told["peaks"]["passes"], told["peaks"]["noticed"]) == (2, 2)


def test_without_a_reading_near_by_there_is_no_calibration(path: Path) -> None:
    recording = read_walk_by(path)
    with pytest.raises(ValueError, match="give --config"):
        calibration_db([recording._replace(beacon_m=recording.beacon_m + 50.0)])
