"""Recordings with a sensor on each foot: one foot's way is the other's truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from edge_agent.evaluation.course_truth import Waypoints, out_along, stances_between
from edge_agent.evaluation.errors import absolute_error_m
from edge_agent.evaluation.estimate import estimated_path
from edge_agent.mounts.boot_eskf import EskfBootMount
from edge_agent.mounts.interface import Increment
from edge_agent.sources.feet_trials import foot_beside, trunk_between
from edge_agent.sources.recording import SourceError
from edge_agent.sources.trials import find_trials
from shared.units import NS_PER_S


def strides(ends_m: list[tuple[float, float]]) -> list[Increment]:
    moved_m = np.diff([(0.0, 0.0), *ends_m], axis=0).tolist()
    return [
        Increment(
            k * NS_PER_S, k * NS_PER_S + NS_PER_S // 2, (n, e, 0.0), 0.0, 0.0, (0.0,) * 10, ()
        )
        for k, (n, e) in enumerate(moved_m)
    ]


def recorded(lost: int = 0, count: int = 2000) -> dict[str, Any]:
    still = np.tile([0.0, 0.0, -9.8], (count, 1))
    trunk = {"t_s": np.arange(count) / 100.0, "acc_m_s2": still, "gyr_rad_s": 0.0 * still}
    feet = {
        f"{side}_foot_{name}": array[lost:]
        for side in ("left", "right")
        for name, array in (("acc_m_s2", still), ("gyr_rad_s", 0.0 * still))
    }
    marks = {
        f"truth_{side}_steps": np.array([[500, 540], [640, 680]]) for side in ("left", "right")
    }
    return {**trunk, **feet, **marks}


def test_a_boot_that_goes_out_and_back_is_told_along_its_line() -> None:
    way = out_along(strides([(0.0, 1.0), (0.1, 2.0), (0.0, 0.5), (0.0, 0.0)]))
    assert way.time_s.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5]
    assert way.position_m[:, 0] == pytest.approx([0, 1, 1, 2, 2, 0.5, 0.5, 0], abs=0.02)
    assert not way.position_m[:, 1].any()
    assert way.at(np.array([-1.0, 0.25, 0.75, 9.0]))[:, 0] == pytest.approx(
        [0, 0.5, 1, 0], abs=0.01
    )


def test_a_foot_stands_midway_between_its_flights() -> None:
    stood_s = stances_between(np.array([[1.0, 1.4], [2.0, 2.4], [3.0, 3.4]]))
    assert stood_s == pytest.approx([1.0, 1.7, 2.7, 3.4])


def test_each_foot_is_a_boot_of_its_own(tmp_path: Path) -> None:
    np.savez(tmp_path / "walk.npz", **recorded())
    np.savez(tmp_path / "other.npz", **{k: v for k, v in recorded().items() if "foot" not in k})
    boots = [trial.name for trial in find_trials(str(tmp_path), 0, "boot")]
    assert boots == ["other", "walk/left", "walk/right"]
    waists = [trial.name for trial in find_trials(str(tmp_path), 0, "waist", by_feet=True)]
    assert waists == ["other", "walk"]


def test_feet_of_which_samples_are_lost_nobody_knows_when_are_left_out(tmp_path: Path) -> None:
    np.savez(tmp_path / "walk.npz", **recorded(lost=50))
    with pytest.raises(SourceError, match="recording there"):
        find_trials(str(tmp_path), 0, "boot")
    assert len(find_trials(str(tmp_path), 0, "waist")) == 1


def test_feet_that_never_stride_are_no_truth(tmp_path: Path) -> None:
    np.savez(tmp_path / "walk.npz", **recorded())
    with pytest.raises(SourceError, match="no stride"):
        foot_beside(tmp_path / "walk.npz", "left")


def test_feet_tell_the_same_way_and_so_the_trunk_between_them(data_dir: Path) -> None:
    recording = data_dir / "waist_20m" / "12-2.npz"
    if not recording.is_file():
        pytest.skip("no waist_20m among the real recordings")
    ways: list[Waypoints] = []
    for side in ("left", "right"):
        samples, beside = foot_beside(recording, side)
        mount = EskfBootMount()
        own = estimated_path(mount.steps(samples) + mount.finish())
        assert absolute_error_m(own.at(beside.time_s)[:, :2], beside.position_m) < 0.5
        ways.append(beside)
    _, between = trunk_between(recording)
    farthest_m = [way.position_m[:, 0].max() for way in (*ways, between)]
    assert farthest_m == pytest.approx([10.4] * 3, abs=0.5)
    assert np.ptp(farthest_m) < 0.5
