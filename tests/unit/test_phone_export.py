"""What is read of a phone's export, and what is said of a broken one."""

from __future__ import annotations

import csv
import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from edge_agent.gnss import SpeedReading
from edge_agent.mounts.chest import ChestMount
from edge_agent.sources.opening import open_source
from edge_agent.sources.phone_export import read_phone_export
from edge_agent.sources.recording import SourceError
from edge_agent.sources.trials import find_trials
from shared.maths.rotations import from_rotation_vector
from shared.messages import ImuSample
from tests.bouncing_phone import Phone

BEGIN_NS = 1_698_501_144_401_773_000
METADATA = [
    ["version", "device name", "platform", "standardisation"],
    ["3", "phone", "android", "false"],
]


def write(folder: Path, name: str, rows: Iterable[Iterable[object]]) -> None:
    with (folder / name).open("w", newline="") as file:
        csv.writer(file).writerows(rows)


def sensor(rows: Iterable[tuple[int, tuple[float, ...]]]) -> list[list[object]]:
    """Return a sensor's rows as the app writes them: z first."""
    told: list[list[object]] = [["time", "seconds_elapsed", "z", "y", "x"]]
    return told + [[time_ns, (time_ns - BEGIN_NS) / 1e9, *values[::-1]] for time_ns, values in rows]


def samples() -> list[ImuSample]:
    upright = from_rotation_vector((-1.5707963, 0.0, 0.0))
    return list(Phone(steps=20, sensor_from_level=upright, turn_rad_s=0.1).samples(BEGIN_NS))


@pytest.fixture
def android(tmp_path: Path) -> Path:
    """A folder of a walk's export, the gyroscope on a clock of its own."""
    folder = tmp_path / "export"
    folder.mkdir()
    walk = samples()
    write(folder, "metadata.csv", METADATA)
    write(folder, "TotalAcceleration.csv", sensor((one.time_ns, one.force_m_s2) for one in walk))
    gyro = ((one.time_ns + 3_000_000, one.rate_rad_s) for one in walk)
    write(folder, "Gyroscope.csv", sensor(gyro))
    fields = ((one.time_ns, (20.0, 0.0, -40.0)) for one in walk[::5])
    write(folder, "Magnetometer.csv", sensor(fields))
    pressures: list[list[object]] = [["time", "seconds_elapsed", "relativeAltitude", "pressure"]]
    pressures += [[one.time_ns, 0, 0, 1013.25] for one in walk[::100]]
    write(folder, "Barometer.csv", pressures)
    return folder


def test_sensors_are_put_on_one_clock_in_si(android: Path) -> None:
    recording, walk = read_phone_export(android), samples()
    assert recording.time_ns.tolist() == [one.time_ns for one in walk]
    assert recording.force_m_s2 == pytest.approx(np.array([one.force_m_s2 for one in walk]))
    assert np.nanmax(np.abs(recording.rate_rad_s)) == pytest.approx(0.1)
    assert recording.field_ut is not None
    assert recording.field_ut[7].tolist() == [20.0, 0.0, -40.0]
    assert recording.pressure_pa is not None
    assert np.nanmean(recording.pressure_pa) == pytest.approx(101_325.0)
    assert np.count_nonzero(np.isfinite(recording.pressure_pa)) == len(walk[::100])


def test_a_walk_is_followed_from_a_zip_as_from_a_folder(android: Path, tmp_path: Path) -> None:
    packed = tmp_path / "export.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        for file in sorted(android.iterdir()):
            archive.write(file, f"walk/{file.name}")
    ways = []
    for name in (f"phone:{android}", f"phone:{packed}"):
        mount, source = ChestMount(), open_source(name, "r1", 0, "chest")
        told = [mount.step(one) for one in source.readings if isinstance(one, ImuSample)]
        ways.append([one for one in told if one is not None] + mount.finish())
    assert ways[0] == ways[1]
    assert sum(one.steps for one in ways[0]) == 20


def test_an_export_is_one_walk_to_score(android: Path) -> None:
    (trial,) = find_trials(str(android), 0, "chest")
    data = trial.load()
    assert (trial.name, len(data.samples)) == ("export", len(samples()))
    assert data.truth is None


def test_a_vehicles_phone_tells_the_speed_that_satellites_have(android: Path) -> None:
    rows = [["time", "seconds_elapsed", "speedAccuracy", "speed"]]
    told = ((1, 0.1, 8.0), (2, -1.0, 8.5), (3, 0.5, -1.0), (4, 9.0, 9.0))
    rows += [[str(BEGIN_NS + s * 10**9), str(s), str(sd), str(speed)] for s, sd, speed in told]
    write(android, "Location.csv", rows)
    readings = list(open_source(f"phone:{android}", "r1", 0, "vehicle").readings)
    speeds = [one for one in readings if isinstance(one, SpeedReading)]
    assert [one[1:] for one in speeds] == [(8.0, 0.3), (8.5, 1.0)]
    assert [one.time_ns for one in readings] == sorted(one.time_ns for one in readings)
    assert not any(
        isinstance(one, SpeedReading)
        for one in open_source(f"phone:{android}", "r1", 0, "chest").readings
    )


def test_an_iphone_reads_forces_downwards(android: Path) -> None:
    forward = read_phone_export(android)
    walk = samples()
    gravity = np.array(walk[0].force_m_s2)
    write(android, "metadata.csv", [METADATA[0], ["3", "phone", "ios", "false"]])
    (android / "TotalAcceleration.csv").unlink()
    moved = ((one.time_ns, tuple(gravity - np.array(one.force_m_s2))) for one in walk)
    write(android, "Accelerometer.csv", sensor(moved))
    write(android, "Gravity.csv", sensor((one.time_ns, tuple(-gravity)) for one in walk))
    assert read_phone_export(android).force_m_s2 == pytest.approx(forward.force_m_s2, abs=1e-9)
    write(android, "metadata.csv", [METADATA[0], ["3", "phone", "ios", "true"]])
    assert read_phone_export(android).force_m_s2 == pytest.approx(-forward.force_m_s2, abs=1e-9)


def test_a_chest_may_do_without_a_gyroscope(android: Path) -> None:
    (android / "Gyroscope.csv").unlink()
    with pytest.raises(SourceError, match=r"no Gyroscope\.csv"):
        read_phone_export(android)
    assert np.isnan(read_phone_export(android, needs_gyro=False).rate_rad_s).all()


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("metadata.csv", "", "no metadata.csv that says"),
        ("TotalAcceleration.csv", "", "no Accelerometer.csv"),
        ("TotalAcceleration.csv", "time,x,y\n1,2,3\n", "has no column z"),
        ("Gyroscope.csv", "time,x,y,z\n1,2,3,4\nx,2,3,4\n", "row 3: time 'x' is no whole number"),
        ("Gyroscope.csv", "time,x,y,z\n1.7E+18,2,3,4\n", "'1.7E.18' is no whole number"),
        ("Gyroscope.csv", "time,x,y,z\n1,2,3,4\n2,2\n", "Gyroscope.csv, row 3: only 2 cells"),
        ("Gyroscope.csv", "time,x,y,z\n5000000000,1,1,1\n9,1,1,1\n", "back in time by 5.0 s"),
        ("Gyroscope.csv", f'time,x,y,z\n1,1,1,"{"1" * 200_000}', "cannot be read .*field limit"),
        ("Gyroscope.csv", "time,x,y,z\n1,0,0,0\n2,0,0,0\n", "Gyroscope.csv holds no reading"),
        (
            "TotalAcceleration.csv",
            "time,x,y,z\n" + "".join(f"{k}0000000,0.1,0.1,1\n" for k in range(9)),
            "mostly reads 1.01, which is no gravity",
        ),
        (
            "TotalAcceleration.csv",
            "time,x,y,z\n" + "".join(f"{10 * k},0.1,0.1,9.8\n" for k in range(9)),
            "10 ns apart",
        ),
    ],
)
def test_what_is_broken_is_told(android: Path, name: str, text: str, told: str) -> None:
    (android / name).write_text(text)
    with pytest.raises(SourceError, match=told):
        read_phone_export(android)


def test_rates_in_degrees_are_told(android: Path) -> None:
    write(android, "Gyroscope.csv", sensor((one.time_ns, (60.0, 0.0, 0.0)) for one in samples()))
    with pytest.raises(SourceError, match="is it in °/s"):
        read_phone_export(android)


def test_a_spreadsheet_may_have_written_it_its_own_way(android: Path) -> None:
    as_exported = read_phone_export(android)
    for name in ("TotalAcceleration.csv", "Gyroscope.csv"):
        text = (android / name).read_text().replace(",", ";").replace(".", ",")
        (android / name).write_text(text, encoding="utf-16")
    written = read_phone_export(android)
    assert np.array_equal(written.force_m_s2, as_exported.force_m_s2)
    assert np.array_equal(written.rate_rad_s, as_exported.rate_rad_s)


def test_a_last_row_that_is_cut_off_is_left_out(android: Path) -> None:
    file = android / "TotalAcceleration.csv"
    file.write_bytes(file.read_bytes()[:-30])
    assert len(read_phone_export(android)) == len(samples()) - 1


def test_nobody_knows_how_a_phone_turned_while_its_gyroscope_was_silent(android: Path) -> None:
    walk = samples()
    heard = [one for one in walk if not 4 * 10**9 <= one.time_ns - BEGIN_NS < 7 * 10**9]
    write(android, "Gyroscope.csv", sensor((one.time_ns, one.rate_rad_s) for one in heard))
    recording = read_phone_export(android)
    silent = np.isnan(recording.rate_rad_s).any(axis=1)
    assert np.count_nonzero(silent) == pytest.approx(250, abs=2)
    mount = ChestMount()
    told = mount.steps(recording) + mount.finish()
    assert sum(one.steps for one in told) == 20
    during = [BEGIN_NS + 4.4e9 < one.start_time_ns < BEGIN_NS + 6e9 for one in told]
    turn_rad2 = np.array([one.covariance[-1] for one in told])
    assert turn_rad2[during].min() > 10.0 * np.median(turn_rad2)


@pytest.mark.parametrize("torn_at", [800, 3000])
def test_a_zip_that_is_torn_inside_is_told(android: Path, tmp_path: Path, torn_at: int) -> None:
    packed = tmp_path / "export.zip"
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(android.iterdir()):
            archive.write(file, f"walk/{file.name}")
        archive.writestr("__MACOSX/walk/._Gyroscope.csv", b"")
    assert len(read_phone_export(packed)) == len(samples())
    torn = bytearray(packed.read_bytes())
    torn[torn_at : torn_at + 40] = bytes(40)
    packed.write_bytes(torn)
    with pytest.raises(SourceError, match="cannot be read"):
        read_phone_export(packed)


def test_what_is_no_export_is_told(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="no such folder"):
        read_phone_export(tmp_path / "none.zip")
    (tmp_path / "torn.zip").write_bytes(b"torn")
    with pytest.raises(SourceError, match=r"no whole \.zip"):
        read_phone_export(tmp_path / "torn.zip")
