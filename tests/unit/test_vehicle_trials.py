"""Drives that are not as the one recorded: shorter, their speed known in part, or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from edge_agent.sources.recording import SourceError
from edge_agent.sources.trials import find_trials
from edge_agent.sources.vehicle_trials import MOUNTINGS, Lying, lyings_of, pieces_of


def drive(folder: Path, lasts_s: float, speed_s: float | None) -> Path:
    """Write a drive of ``lasts_s`` at rest, whose speed is known for ``speed_s`` but for gaps."""
    time_s = 100.0 + np.arange(0.0, lasts_s, 0.02)
    arrays: dict[str, Any] = {
        "t_s": time_s,
        "acc_m_s2": np.tile([0.0, 0.0, -9.81], (len(time_s), 1)),
        "gyr_rad_s": np.zeros((len(time_s), 3)),
    }
    if speed_s is not None:
        arrays["truth_t_s"] = 100.0 + np.arange(0.0, speed_s, 0.5)
        arrays["truth_speed_m_s"] = np.zeros(len(arrays["truth_t_s"]))
        arrays["truth_speed_m_s"][3] = np.nan
    path = folder / f"drive_{lasts_s}_{speed_s}.npz"
    np.savez(path, **arrays)
    return path


def fixed_alone(trials: list[Lying]) -> bool:
    return [one.lie for one in trials] == [None]


def test_who_drives_too_shortly_to_slip_is_scored_as_recorded(tmp_path: Path) -> None:
    assert fixed_alone(lyings_of(drive(tmp_path, 12.0, 12.0)))
    assert len(lyings_of(drive(tmp_path, 30.0, 30.0))) == 1 + MOUNTINGS


def test_the_drive_lasts_as_long_as_its_speed_is_known(tmp_path: Path) -> None:
    (piece,) = pieces_of(drive(tmp_path, 30.0, 10.0))
    lasted_s = np.ptp(piece.samples.time_ns) / 1e9
    assert lasted_s == pytest.approx(9.6, abs=0.05)
    assert np.isfinite(piece.speed.speed_m_s).all()


def test_without_a_speed_there_is_no_drive_and_it_is_said_where(tmp_path: Path) -> None:
    path = drive(tmp_path, 30.0, None)
    (trial,) = find_trials(str(path), 0, "vehicle")
    with pytest.raises(SourceError, match="no speed of a vehicle in it") as refused:
        trial.load()
    assert str(path) in str(refused.value)


def test_rates_in_degrees_are_refused(tmp_path: Path) -> None:
    path = drive(tmp_path, 12.0, 12.0)
    with np.load(path) as arrays:
        told = {**arrays, "gyr_rad_s": np.full((len(arrays["t_s"]), 3), 1.2)}
    np.savez(path, **told)
    with pytest.raises(SourceError, match="is it in °/s"):
        pieces_of(path)
