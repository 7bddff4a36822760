"""CSV exports, by makers' headers and units; and what is said of those that cannot be used."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from structlog.testing import capture_logs

from edge_agent.sources.recording import SourceError
from edge_agent.sources.vendor_csv import read_vendor_csv

G = 9.80665
X_IO = (
    "Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),"
    "Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g)"
)


@pytest.fixture
def csv(tmp_path: Path) -> Path:
    return tmp_path / "export.csv"


def write(path: Path, header: str, *rows: str) -> Path:
    path.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    return path


def test_x_io(csv: Path) -> None:
    write(csv, X_IO, "0,180,-90,0,0,0,-1", "0.01,0,0,360,0.5,0,-1")
    recording = read_vendor_csv(csv)
    assert recording.time_ns.tolist() == [0, 10_000_000]
    assert recording.rate_rad_s == pytest.approx(
        np.array([[math.pi, -math.pi / 2, 0.0], [0.0, 0.0, 2 * math.pi]])
    )
    assert recording.force_m_s2 == pytest.approx(np.array([[0, 0, -G], [0.5 * G, 0, -G]]))
    assert recording.field_ut is None


def test_x_imu3_with_its_other_columns(csv: Path) -> None:
    header = (
        "Timestamp (us),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),"
        "Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g),"
        "High-g accelerometer X (g),Magnetometer X (uT),Magnetometer Y (uT),Magnetometer Z (uT)"
    )
    write(csv, header, "5000000,0,0,0,0,0,1,9,20,,40", "5002500,0,0,0,0,0,1,9,20,5,40")
    recording = read_vendor_csv(csv)
    assert recording.time_ns.tolist() == [5_000_000_000, 5_002_500_000]
    assert [sample.field_ut for sample in recording] == [None, (20.0, 5.0, 40.0)]


def test_xsens_says_no_units_and_is_understood(csv: Path) -> None:
    header = "PacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\tFreeAcc_E"
    csv.write_text(
        "// Start Time: Unknown\n// Update Rate: 100.0Hz\n"
        + header
        + "\n1\t1000\t0\t0\t-9.8\t0.5\t0\t6\t0\n2\t1100\t0\t0\t-9.8\t0\t0\t0\t0\n"
    )
    recording = read_vendor_csv(csv)
    assert np.diff(recording.time_ns).tolist() == [10_000_000]
    assert recording.rate_rad_s[0].tolist() == [0.5, 0.0, 6.0]
    assert recording.force_m_s2[0].tolist() == [0.0, 0.0, -9.8]


def test_xsens_dot_counts_microseconds_and_degrees(csv: Path) -> None:
    header = "SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z"
    write(csv, header, "100000,0,0,9.8,300,0,0", "116667,0,0,9.8,0,0,0")
    recording = read_vendor_csv(csv)
    assert np.diff(recording.time_ns).tolist() == [16_667_000]
    assert recording.rate_rad_s[0, 0] == pytest.approx(math.radians(300.0))


UNITS = {
    # header of time, of force, of rate, of field; a row; what the first sample must be
    "underscores": ("t_s", "acc_{}_m_s2", "gyr_{}_rad_s", "mag_{}_ut", (1.0, 1.0, 1.0)),
    "milli": ("time (ms)", "acc {} (mg)", "gyro {} (mdps)", "mag {} (mG)", (1e3, 1e3, 1e3)),
    "phone": ("Time (s)", "Acceleration {} (m/s^2)", "Gyroscope {} (rad/s)", "", (1.0, 1.0, 1.0)),
    "nano": ("timestamp [ns]", "accel {} [m/s²]", "gyro {} [°/s]", "mag {} [nT]", (1e9, 1.0, 1.0)),
    "quoted": ('"Time (s)"', '"Acc {} (g)"', '"Gyr {} (dps)"', '"Mag {} (Gauss)"', (1.0, 1.0, 1.0)),
}


@pytest.mark.parametrize("maker", UNITS)
def test_units_are_read_from_the_header(csv: Path, maker: str) -> None:
    time, force, rate, field, (per_s, _, _) = UNITS[maker]
    names = [time, *(name.format(axis) for name in (force, rate, field) if name for axis in "xyz")]
    in_g, in_mg = "g)" in force and "mg" not in force, "mg" in force
    gravity = 1.0 if in_g else 1000.0 if in_mg else G
    degrees = 1000.0 if "mdps" in rate else 1.0
    north = 200.0 if "mG" in field else 20_000.0 if "nT" in field else 0.2 if "Ga" in field else 20
    rows = [
        ",".join(map(str, [k * 0.01 * per_s, 0, 0, -gravity, 30 * degrees, 0, 0, north, 0, 0]))
        for k in range(3)
    ]
    if not field:
        rows = [row.rsplit(",", 3)[0] for row in rows]
    recording = read_vendor_csv(write(csv, ",".join(names), *rows))
    assert recording.time_ns.tolist() == [0, 10_000_000, 20_000_000]
    assert recording.force_m_s2[0, 2] == pytest.approx(-G)
    expected = 30.0 if "rad" in rate else math.radians(30.0)
    assert recording.rate_rad_s[0, 0] == pytest.approx(expected)
    if field:
        assert recording.field_ut is not None
        assert recording.field_ut[0, 0] == pytest.approx(20.0)


def test_a_field_in_no_known_unit_is_left_out(csv: Path) -> None:
    header = X_IO + ",Mag_X,Mag_Y,Mag_Z"
    write(csv, header, "0,0,0,0,0,0,-1,1,0,0", "0.01,0,0,0,0,0,-1,1,0,0")
    assert read_vendor_csv(csv).field_ut is None


PRESSURES = {
    "Barometer (hPa)": "1013.25",
    "Pressure [mbar]": "1013.25",
    "pressure_pa": "101325",
    "baro_kPa": "101.325",
    "Barometric pressure (bar)": "1.01325",
    "Pressure": "1013.25",
    "Air pressure": "101.325",
}


@pytest.mark.parametrize("name", PRESSURES)
def test_the_pressure_of_the_air_in_its_unit(csv: Path, name: str) -> None:
    reading = PRESSURES[name]
    rest = "0,0,0,0,0,-1"
    write(csv, f"{X_IO},{name}", f"0,{rest},{reading}", f"0.01,{rest},", f"0.02,{rest},{reading}")
    pressures_pa = [sample.pressure_pa for sample in read_vendor_csv(csv)]
    assert pressures_pa == [pytest.approx(101_325.0), None, pytest.approx(101_325.0)]


@pytest.mark.parametrize("name", ["Pressure", "Pressure altitude (m)"])
def test_what_can_be_no_pressure_of_the_air_is_left_out(csv: Path, name: str) -> None:
    write(csv, f"{X_IO},{name}", "0,0,0,0,0,0,-1,12", "0.01,0,0,0,0,0,-1,12")
    assert read_vendor_csv(csv).pressure_pa is None


@pytest.mark.parametrize(
    "name", ["Temperature (°C)", "Temp (degC)", "temperature_c", "Temperature"]
)
def test_the_temperature_of_the_sensor(csv: Path, name: str) -> None:
    rest = "0,0,0,0,0,-1"
    write(csv, f"{X_IO},{name}", f"0,{rest},21.5", f"0.01,{rest},", f"0.02,{rest},-3")
    told = [sample.temperature_c for sample in read_vendor_csv(csv)]
    assert told == [21.5, None, -3.0]


def test_degrees_of_another_kind_are_left_out(csv: Path) -> None:
    write(csv, f"{X_IO},Temperature (°F)", "0,0,0,0,0,0,-1,70", "0.01,0,0,0,0,0,-1,70")
    assert read_vendor_csv(csv).temperature_c is None


def test_windows_code_page(csv: Path) -> None:
    header = X_IO.replace("deg/s", "°/s")
    csv.write_bytes(f"{header}\n0,180,0,0,0,0,-1\n0.01,0,0,0,0,0,-1\n".encode("cp1252"))
    assert read_vendor_csv(csv).rate_rad_s[0, 0] == pytest.approx(math.pi)


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_decimal_commas(csv: Path, delimiter: str) -> None:
    rows = ["0,00 180,0 -90 0 0 0 -1,0", "0,01 0 0 3,6e+2 0,5 0 -1,0"]
    write(csv, X_IO.replace(",", delimiter), *(row.replace(" ", delimiter) for row in rows))
    recording = read_vendor_csv(csv)
    assert recording.time_ns.tolist() == [0, 10_000_000]
    assert recording.rate_rad_s[1].tolist() == [0.0, 0.0, pytest.approx(2 * math.pi)]
    assert recording.force_m_s2[1].tolist() == pytest.approx([0.5 * G, 0.0, -G])


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig"])
def test_other_encodings(csv: Path, encoding: str) -> None:
    header = X_IO.replace("deg/s", "°/s")
    csv.write_bytes(f"{header}\n0,180,0,0,0,0,-1\n0.01,0,0,0,0,0,-1\n".encode(encoding))
    assert read_vendor_csv(csv).rate_rad_s[0, 0] == pytest.approx(math.pi)


@pytest.mark.parametrize("rest", ["0.02,0,0", "0.02,0,0,0,0,0,-", "0"])
def test_a_last_line_that_is_cut_off_is_left_out_and_told(csv: Path, rest: str) -> None:
    csv.write_text(f"{X_IO}\n0,0,0,0,0,0,-1\n0.01,0,0,0,0,0,-1\n{rest}")
    with capture_logs() as logs:
        assert read_vendor_csv(csv).time_ns.tolist() == [0, 10_000_000]
    assert f"{csv}: the last line is cut off" in logs[-1]["event"]
    csv.write_text(f"{X_IO}\n0,0,0,0,0,0,-1\n{rest}\n0.01,0,0,0,0,0,-1")
    with pytest.raises(SourceError, match="line 3"):
        read_vendor_csv(csv)


def test_one_unit_may_be_written_in_two_ways_or_once(csv: Path) -> None:
    header = X_IO.replace("Y (deg/s)", "Y (dps)").replace("X (deg/s)", "X")
    write(csv, header, "0,180,0,0,0,0,-1", "0.01,0,0,0,0,0,-1")
    assert read_vendor_csv(csv).rate_rad_s[0, 0] == pytest.approx(math.pi)


def test_rows_sent_twice_count_once(csv: Path) -> None:
    row = "0.01,0,0,0,0,0,-1"
    write(csv, X_IO, "0,0,0,0,0,0,-1", row, row, "0.02,0,0,1,0,0,-1")
    assert read_vendor_csv(csv).time_ns.tolist() == [0, 10_000_000, 20_000_000]


REST = "0,0,0,0,0,0,1\n0.01,0,0,0,0,0,1\n"
BROKEN = {
    "empty": ("", "no header with inertial columns; found nothing"),
    "no header": ("1,2,3\n4,5,6\n", "found '1,2,3'"),
    "no gyroscope": ("t,acc_x,acc_y,acc_z\n0,0,0,1\n", "no column for rate x, rate y, rate z"),
    "no time": (f"{X_IO.replace('Time (s)', 'Packet')}\n", "no column for time; found Packet, Gyr"),
    "no rows": (f"{X_IO}\n0,0,0,0,0,0,1\n", "1 rows below the header"),
    "short row": (f"{X_IO}\n{REST}0.02,0,0\n", "line 4: 3 cells where the header has 7"),
    "no number": (f"{X_IO}\n\n0,0,0,x,0,0,1\n", "line 3: Gyroscope Z (deg/s) is 'x'"),
    "no reading": (f"{X_IO}\n0,0,0,,0,0,1\n", "line 2: Gyroscope Z (deg/s) is ''"),
    "unknown unit": (f"{X_IO.replace('(g)', '(ft/s2)')}\n", "unknown unit; write one of m/s2, g"),
    "wrong unit": (f"{X_IO.replace('(g)', '(m/s2)')}\n{REST}", "mostly reads 1, which is not grav"),
    "no force is so large": (f"{X_IO}\n0,0,0,0,0,0,1e300\n1,0,0,0,0,0,1e300\n", "mostly reads inf"),
    "wrong unit of rates": (
        f"{X_IO.replace('(deg/s)', '(rad/s)')}\n0,90,0,0,0,0,1\n0.01,90,0,0,0,0,1\n",
        "turns faster than anything worn: is it in °/s?",
    ),
    "time stands": (
        f"{X_IO}\n1,0,0,0,0,0,1\n1,0,0,0,0,1,1\n",
        "Time (s) is 1 in all 2 rows: the recorder's clock stood still",
    ),
    "time goes back": (
        f"{X_IO}\n2,0,0,0,0,0,1\n1,0,0,0,0,1,1\n",
        "does not advance, from 2 in the first row to 1 in the last",
    ),
    "no date is so late": (f"{X_IO}\n0,0,0,0,0,0,1\n1e12,0,0,0,0,1,1\n", "reads 1e+12 s"),
    "units mixed": (
        f"{X_IO.replace('X (g)', 'X (m/s2)')}\n{REST}",
        "Accelerometer X (m/s2), Accelerometer Y (g), Accelerometer Z (g): one sensor in different",
    ),
    "no force": (
        f"{X_IO}\n0,0,0,0,nan,0,1\n0.01,0,0,0,nan,0,1\n",
        "Accelerometer X (g) has no reading in any row",
    ),
    "no rates": (
        f"{X_IO}\n0,nan,nan,nan,0,0,1\n0.01,nan,nan,nan,0,0,1\n",
        "Gyroscope X (deg/s) has no reading in any row",
    ),
    "time is no number": (f"{X_IO}\nnan,0,0,0,0,0,1\n{REST}", "is not finite"),
    "time in another unit": (
        f"{X_IO}\n0,0,0,0,0,0,1\n10,0,0,0,0,0,1\n20,0,0,0,0,0,1\n",
        "Time (s) advances by 10 s a sample, which is no inertial sensor's",
    ),
    "time in no unit": (f"{X_IO.replace(' (s)', '')}\n0,0,0,0,0,0,1\n1e5,0,0,0,0,0,1\n", "no unit"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_what_is_wrong_is_said_with_the_file(csv: Path, what: str) -> None:
    text, said = BROKEN[what]
    csv.write_text(text)
    with pytest.raises(SourceError) as refused:
        read_vendor_csv(csv)
    assert str(csv) in str(refused.value)
    assert said in str(refused.value)


def test_a_file_that_is_not_there(csv: Path) -> None:
    with pytest.raises(SourceError, match="cannot be read"):
        read_vendor_csv(csv)
