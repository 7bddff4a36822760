"""What readings say of range, and how recordings on a grid are read."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from dap_node.measured import offset_db, read_measured
from dap_node.radio_survey import RangedReadings, survey, together
from dap_node.wifi_grid import WifiGridError, read_wifi_grid, walk_over

HEADER = "X,Y,AP1 RTT(mm),AP2 RTT(mm),AP1 RSS(dBm),AP2 RSS(dBm),LOS APs"


def made_up(
    fading_db: float, shadowing_db: float, exponent: float = 2.0, fade_db_m: float = 0.0
) -> RangedReadings:
    """Return 20 readings at each of 300 spots, 1 to 20 m away."""
    chance = np.random.default_rng(7)
    range_m = np.repeat(chance.uniform(1.0, 20.0, 300), 20)
    level_dbm = -40.0 - 10.0 * exponent * np.log10(range_m)
    place_db = np.repeat(chance.normal(0.0, shadowing_db, 300), 20)
    noise_db = (fading_db + fade_db_m * range_m) * chance.normal(size=6000)
    return RangedReadings(level_dbm + place_db + noise_db, range_m, np.repeat(np.arange(300), 20))


def test_path_loss_and_both_spreads_are_found_again() -> None:
    told = survey(made_up(2.0, 4.0), np.random.default_rng(0))
    assert told.fit.exponent == pytest.approx(2.0, abs=0.2)
    low, high = told.fit.exponent_interval
    assert low < 2.0 < high
    assert 0.1 < high - low < 0.8
    assert told.fit.sigma_db == pytest.approx(np.hypot(2.0, 4.0), abs=0.4)
    assert told.same_place_db == pytest.approx(2.0, abs=0.1)
    assert told.across_places_db == pytest.approx(4.0, abs=0.4)
    assert abs(told.variance_correlation) < 0.15
    assert sum(one.readings for one in told.bins) == told.readings == 6000


def test_variance_that_rises_with_range_is_seen() -> None:
    told = survey(made_up(0.5, 1.0, fade_db_m=0.3), np.random.default_rng(0))
    assert told.variance_correlation > 0.9
    variances_db2 = [one.variance_db2 for one in told.bins]
    assert variances_db2[-1] > 10.0 * variances_db2[1]


def test_recordings_together_share_no_spot() -> None:
    one = made_up(2.0, 4.0)
    assert len(np.unique(together([one, one]).spot)) == 600


def test_readings_at_one_range_are_refused() -> None:
    one = made_up(2.0, 4.0)
    with pytest.raises(ValueError, match="at one range"):
        survey(one._replace(range_m=np.full(6000, 3.0)), np.random.default_rng(0))


def grid_csv(path: Path, *more: str) -> Path:
    """Write three points, two scans each; AP 2 is missed once, and has no range at the last."""
    rows = [
        "0,0,900,5000,-50,-200,1", "0,0,1100,5200,-52,-66,1 2",
        "0,2,2000,4000,-55,-64,1", "0,2,2200,4000,-55,-62,1",
        "2,2,-300,100000,-45,-60,1", "2,2,-100,100000,-45,-60,1",
    ]  # fmt: skip
    text = "\n".join([HEADER, *rows, *more])
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


@pytest.mark.parametrize("name", ["room.csv", "room.csv.gz"])
def test_a_grid_is_read(tmp_path: Path, name: str) -> None:
    grid = read_wifi_grid(grid_csv(tmp_path / name))
    assert grid.place_m.tolist() == [[0.0, 0.0], [0.0, 2.0], [2.0, 2.0]]
    assert grid.range_m[:, 0].tolist() == pytest.approx([1.0, 2.1, 0.3])
    assert np.isnan(grid.range_m[2, 1])
    assert np.isnan(grid.rssi_dbm[0, 1])
    recording = read_measured(tmp_path / name)
    assert recording.name == "room"
    assert len(recording.readings.rssi_dbm) == 6 + 3
    assert [len(link.time_s) for link in recording.links] == [6, 3]
    assert offset_db([recording]) > 0.0


def test_a_walk_over_a_grid_stays_a_second_at_each_point(tmp_path: Path) -> None:
    walk = walk_over(read_wifi_grid(grid_csv(tmp_path / "room.csv")), 0)
    assert walk.time_s.tolist() == pytest.approx([0.0, 0.2, 3.0, 3.2, 6.0, 6.2])
    assert walk.truth_s.tolist() == pytest.approx([0.0, 1.0, 3.0, 4.0, 6.0, 7.0])


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "its columns are none"),
        (b"a,b\n1,2", "its columns are a, b"),
        (b"\xff\xfe\x00", "not text"),
        (HEADER.encode() + b"\n1,2,3\n", "a row is not whole"),
        (HEADER.encode() + b"\n1,2,3,4,5,x,1\n", "a row is not whole"),
        (HEADER.encode() + b"\n1,2,3,4,5,nan,1\n1,2,3,4,5,6,1", "not all numbers"),
    ],
)
def test_what_is_no_grid_is_refused(tmp_path: Path, content: bytes, complaint: str) -> None:
    (tmp_path / "room.csv").write_bytes(content)
    with pytest.raises(WifiGridError, match=complaint):
        read_wifi_grid(tmp_path / "room.csv")


def test_a_broken_archive_is_refused(tmp_path: Path) -> None:
    (tmp_path / "room.csv.gz").write_bytes(gzip.compress(b"X,Y")[:-4])
    with pytest.raises(WifiGridError, match="cannot be read"):
        read_wifi_grid(tmp_path / "room.csv.gz")
    with pytest.raises(WifiGridError, match="no such file"):
        read_wifi_grid(tmp_path / "other.csv")
