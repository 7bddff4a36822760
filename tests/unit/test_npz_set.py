"""The .npz sets: what is read from them, and what is said of broken ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from edge_agent.evaluation.course_truth import Waypoints
from edge_agent.evaluation.truth import Truth
from edge_agent.sources.npz_set import read_npz_set
from edge_agent.sources.recording import SourceError


def arrays(count: int = 200) -> dict[str, Any]:
    return {
        "t_s": 5.0 + np.arange(count) / 100.0,
        "acc_m_s2": np.tile([0.0, 0.5, -9.8], (count, 1)),
        "gyr_rad_s": np.tile([0.1, 0.2, 0.3], (count, 1)),
    }


@pytest.fixture
def npz(tmp_path: Path) -> Path:
    return tmp_path / "trial.npz"


def test_samples_are_in_si(npz: Path) -> None:
    np.savez(npz, **arrays(), mag_gauss=np.tile([0.2, 0.0, 0.4], (200, 1)))
    recording, truth = read_npz_set(npz)
    first, second, *_ = recording
    assert first.time_ns == 5_000_000_000
    assert second.time_ns == 5_010_000_000
    assert first.force_m_s2 == (0.0, 0.5, -9.8)
    assert first.rate_rad_s == (0.1, 0.2, 0.3)
    assert first.field_ut == pytest.approx((20.0, 0.0, 40.0))
    assert len(recording) == 200
    assert truth is None


def test_ruler_measured_stances_are_told_north_and_east(npz: Path) -> None:
    index, places = np.array([10, 60, 150]), np.array([[0.0, 0.0], [1.0, 0.5], [2.0, 0.5]])
    np.savez(npz, **arrays(), truth_stride_index=index, truth_stride_xy_m=places)
    truth = read_npz_set(npz).truth
    assert isinstance(truth, Truth)
    assert truth.time_s == pytest.approx([5.1, 5.6, 6.5])
    # x and y of a frame with z up are north and west.
    assert truth.position_m.tolist() == [[0.0, 0.0], [1.0, -0.5], [2.0, -0.5]]
    assert truth.height is None


def test_motion_capture_is_searched_for_stances(npz: Path) -> None:
    parts = arrays()
    still = np.repeat([[0.0, 0.0, 0.1], [1.0, 0.0, 0.1], [2.0, 0.0, 0.5]], 40, axis=0)
    ramp = np.linspace(0.0, 1.0, 40)[:, None]
    path = np.vstack(
        (still[:40], [0, 0, 0.1] + ramp * [1, 0, 0], still[40:80], [1, 0, 0.1] + ramp * [1, 0, 0.4],
         still[80:])
    )  # fmt: skip
    np.savez(npz, **parts, truth_xyz_m=path)
    truth = read_npz_set(npz).truth
    assert isinstance(truth, Truth)
    assert truth.position_m[:, 0] == pytest.approx([0.0, 1.0, 2.0])
    assert truth.time_s == pytest.approx([5.2, 6.0, 6.8], abs=0.03)
    assert truth.height is not None
    assert truth.height.down_m[[0, -1]].tolist() == [-0.1, -0.5]


BROKEN: dict[str, tuple[dict[str, Any], str]] = {
    "no gyroscope": ({"gyr_rad_s": None}, "no array gyr_rad_s; it has acc_m_s2, t_s"),
    "one sample": ({"t_s": np.array([1.0])}, "two samples or more"),
    "no times": ({"t_s": np.full(200, np.nan)}, "no seconds"),
    "other length": ({"acc_m_s2": np.zeros((199, 3))}, "acc_m_s2 has shape (199, 3)"),
    "flat": ({"gyr_rad_s": np.zeros(600)}, "gyr_rad_s has shape (600,)"),
    "in g": ({"acc_m_s2": np.tile([0.0, 0.0, -1.0], (200, 1))}, "acc_m_s2 mostly reads 1,"),
    "in degrees": ({"gyr_rad_s": np.full((200, 3), 90.0)}, "is it in °/s?"),
    "silent gyroscope": ({"gyr_rad_s": np.full((200, 3), np.nan)}, "gyr_rad_s holds no reading"),
    "silent car": (
        {"truth_t_s": np.arange(3.0), "truth_speed_m_s": np.full(3, np.nan)},
        "truth_speed_m_s holds no speed",
    ),
    "truth beyond the end": (
        {"truth_stride_index": np.array([0, 200]), "truth_stride_xy_m": np.zeros((2, 2))},
        "outside t_s",
    ),
    "truth in a square": (
        {"truth_stride_index": np.array([[0], [9]]), "truth_stride_xy_m": np.zeros((2, 2))},
        "truth_stride_index has shape (2, 1)",
    ),
    "truth at no sample": (
        {"truth_stride_index": np.array([0, np.nan]), "truth_stride_xy_m": np.zeros((2, 2))},
        "truth_stride_index holds what is no whole number",
    ),
    "truth that goes back": (
        {"truth_stride_index": np.array([9, 0]), "truth_stride_xy_m": np.zeros((2, 2))},
        "truth_stride_index does not rise",
    ),
    "truth nowhere": (
        {"truth_stride_index": np.array([0, 9]), "truth_stride_xy_m": np.full((2, 2), np.nan)},
        "truth_stride_xy_m: not all finite",
    ),
    "truth at no time": (
        {"truth_t_s": np.array(1.0), "truth_heel_xyz_m": np.zeros((1, 3))},
        "truth_t_s has shape ()",
    ),
    "truth at a square of times": (
        {"truth_t_s": np.zeros((9, 2)), "truth_heel_xyz_m": np.zeros((9, 3))},
        "truth_t_s has shape (9, 2)",
    ),
    "truth is no number": ({"truth_xyz_m": np.full((200, 3), np.nan)}, "truth_xyz_m: not all"),
    "a clock that stands": ({"t_s": np.full(200, 5.0)}, "clock stood still"),
    "times in ms": ({"t_s": 5e3 + 10.0 * np.arange(200)}, "advances by 10 s a sample"),
    "times in minutes": ({"t_s": np.arange(200) / 6e3 / 60.0}, "no inertial sensor's"),
    "times in 32 bits": (
        {"t_s": (1.6e9 + np.arange(200) / 1.0).astype(np.float32)},
        "in 64 bits",
    ),
    "way-points of another day": (
        {"truth_waypoint_t_xy": np.array([[9e4, 0.0, 0.0], [9.1e4, 1.0, 0.0]])},
        "of another time than the samples",
    ),
    "short truth": (
        {"truth_t_s": np.arange(3.0), "truth_heel_xyz_m": np.zeros((3, 3))},
        "truth_heel_xyz_m",
    ),
}


@pytest.mark.parametrize("what", BROKEN)
def test_what_is_wrong_is_said_with_the_file(npz: Path, what: str) -> None:
    changes, said = BROKEN[what]
    parts = {name: array for name, array in (arrays() | changes).items() if array is not None}
    np.savez(npz, **parts)
    with pytest.raises(SourceError) as refused:
        read_npz_set(npz)
    assert str(npz) in str(refused.value)
    assert said in str(refused.value)


def test_stamps_of_bursts_are_spread(npz: Path) -> None:
    told = arrays()
    chance = np.random.default_rng(0)
    told["acc_m_s2"] = told["acc_m_s2"] + chance.normal(0.0, 0.1, (200, 3))
    even_s = told["t_s"].copy()
    told["t_s"] = even_s[4::5].repeat(5)
    np.savez(npz, **told)
    recording = read_npz_set(npz).recording
    assert len(recording) == 200
    apart_s = np.diff(recording.time_ns) / 1e9
    assert apart_s == pytest.approx(np.diff(even_s).mean(), rel=0.03)


def test_way_points_after_the_end_of_a_recording_are_left_out(npz: Path) -> None:
    places = np.array([[5.0, 0.0, 0.0], [6.0, 1.0, 0.0], [60.0, 9.0, 0.0]])
    np.savez(npz, **arrays(), truth_waypoint_t_xy=places)
    truth = read_npz_set(npz).truth
    assert isinstance(truth, Waypoints)
    assert truth.time_s.tolist() == [5.0, 6.0]


def test_bursts_with_pauses_between_them_are_no_slow_sensor(npz: Path) -> None:
    told = arrays()
    told["t_s"] = np.repeat([5.0, 5.5, 6.0, 6.5], 50)
    np.savez(npz, **told)
    assert len(read_npz_set(npz).recording) > 0


@pytest.mark.parametrize("kept", [0, 10, 1000, -30])
def test_a_file_cut_off_is_refused(npz: Path, kept: int) -> None:
    np.savez(npz, **arrays())
    npz.write_bytes(npz.read_bytes()[:kept])
    with pytest.raises(SourceError, match=r"not a whole \.npz file"):
        read_npz_set(npz)


def test_other_files_are_refused(tmp_path: Path) -> None:
    lone = tmp_path / "lone.npz"
    with lone.open("wb") as file:
        np.save(file, np.zeros(3))
    with pytest.raises(SourceError, match=r"not a whole \.npz file"):
        read_npz_set(lone)
    with pytest.raises(SourceError, match="no such file"):
        read_npz_set(tmp_path / "absent.npz")


def test_a_barometer_may_be_slower_than_the_rest(npz: Path) -> None:
    pressure_pa = np.full(200, np.nan)
    pressure_pa[::10] = 101_300.0
    np.savez(npz, **arrays(), pressure_pa=pressure_pa)
    samples = list(read_npz_set(npz).recording)
    assert [s.pressure_pa for s in samples[:11]] == [101_300.0, *[None] * 9, 101_300.0]
    np.savez(npz, **arrays(), pressure_pa=pressure_pa[:-1])
    with pytest.raises(SourceError, match="pressure_pa has shape"):
        read_npz_set(npz)
