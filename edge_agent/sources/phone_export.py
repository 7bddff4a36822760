"""A phone's own recording: the export of the app 'Sensor Logger', a folder or .zip of CSV files.

One file a sensor, each on its own time stamps: ``TotalAcceleration.csv`` (Android) or
``Accelerometer.csv`` and ``Gravity.csv``, ``Gyroscope.csv``, ``Magnetometer.csv``,
``Barometer.csv``, ``Location.csv``; and ``metadata.csv``, which says what phone it was: iOS tells
forces by the opposite sign.
"""

from __future__ import annotations

import csv
import io
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from edge_agent.gnss import SpeedReading, speed_reading
from edge_agent.sources.recording import Array, Recording, SourceError, at_times
from shared.units import NS_PER_S

Export: TypeAlias = Path | zipfile.Path

PASCAL_PER_HPA = 100.0
XYZ = ("x", "y", "z")
METADATA = "metadata.csv"
EXPECTED = (
    "Accelerometer and Gravity (on Android TotalAcceleration), and Gyroscope; "
    "switch them on in the app and export as Zip"
)


class _Sensor(NamedTuple):
    """One file: ``time_ns`` (k,), rising, and ``readings`` (k, columns)."""

    time_ns: np.ndarray[tuple[int], np.dtype[np.int64]]
    readings: Array


def read_phone_export(path: Path, *, needs_gyro: bool = True) -> Recording:
    """Return the recording of a folder or .zip as the app exports it.

    Samples are those of the accelerometer; other sensors are interpolated at them, the barometer's
    readings set down at the nearest. Axes are the phone's: right, up along the screen, out of it.
    Raises ``SourceError`` for what is no such export, or has no gyroscope though ``needs_gyro``.
    """
    export = _opened(path)
    force = _force(path, export)
    time_s = (force.time_ns - force.time_ns[0]) / NS_PER_S
    rate = _sensor(path, export, "Gyroscope", XYZ)
    if rate is None and needs_gyro:
        raise SourceError(f"{path}: no Gyroscope.csv in it; the app must record {EXPECTED}")
    field = _sensor(path, export, "Magnetometer", XYZ)
    pressure = _sensor(path, export, "Barometer", ("pressure",))

    def at_force(sensor: _Sensor) -> Array:
        return at_times(time_s, (sensor.time_ns - force.time_ns[0]) / NS_PER_S, sensor.readings)

    return Recording(
        force.time_ns,
        force.readings,
        np.full((len(time_s), 3), np.nan) if rate is None else at_force(rate),
        None if field is None else at_force(field),
        None if pressure is None else _set_down(pressure, force.time_ns),
    )


def read_phone_speeds(path: Path) -> list[SpeedReading]:
    """Return the speeds that the phone had of satellites, by time: none without ``Location.csv``.

    Raises ``SourceError`` as :func:`read_phone_export` does.
    """
    told = _sensor(path, _opened(path), "Location", ("speed", "speedaccuracy"))
    if told is None:
        return []
    speeds = (
        speed_reading(time_ns, speed_m_s, sd_m_s)
        for time_ns, (speed_m_s, sd_m_s) in zip(
            told.time_ns.tolist(), told.readings.tolist(), strict=True
        )
    )
    return [one for one in speeds if one is not None]


def _opened(path: Path) -> Export:
    """Return the folder that the files are in, which a .zip may have inside."""
    if path.is_dir():
        return path
    try:
        root = zipfile.Path(zipfile.ZipFile(path))
    except FileNotFoundError:
        raise SourceError(f"{path}: no such folder or .zip; give the app's export") from None
    except (zipfile.BadZipFile, OSError) as error:
        raise SourceError(f"{path}: not a folder, and no whole .zip ({error})") from None
    inside = [entry for entry in root.iterdir() if entry.is_dir()]
    return inside[0] if len(inside) == 1 and not (root / METADATA).exists() else root


def _force(path: Path, export: Export) -> _Sensor:
    """Return specific force: what pushes the phone, the ground's push upwards included."""
    sign = _force_sign(path, export)
    total = _sensor(path, export, "TotalAcceleration", XYZ)
    if total is not None:
        return total._replace(readings=sign * total.readings)
    moved = _sensor(path, export, "Accelerometer", XYZ)
    gravity = _sensor(path, export, "Gravity", XYZ)
    if moved is None or gravity is None:
        missing = "Accelerometer.csv" if moved is None else "Gravity.csv"
        raise SourceError(f"{path}: no {missing} in it; the app must record {EXPECTED}")
    begin_ns = moved.time_ns[0]
    time_s, gravity_s = ((one.time_ns - begin_ns) / NS_PER_S for one in (moved, gravity))
    both = moved.readings + at_times(time_s, gravity_s, gravity.readings)
    return moved._replace(readings=sign * both)


def _force_sign(path: Path, export: Export) -> float:
    """Return −1 for a phone that reads gravity downwards: iOS, unless told to conform."""
    rows = _rows(path, export, METADATA)
    if len(rows) < 2:
        raise SourceError(
            f"{path}: no {METADATA} that says what phone it was, which tells the sign of forces; "
            "export it again as Zip"
        )
    told = {name.strip().lower(): value for name, value in zip(rows[0], rows[1], strict=False)}
    conforms = told.get("standardisation", "false").strip().lower() == "true"
    return -1.0 if told.get("platform", "").strip().lower() == "ios" and not conforms else 1.0


def _sensor(path: Path, export: Export, name: str, columns: Sequence[str]) -> _Sensor | None:
    """Return a sensor's file in the order of time; ``None`` if it was not recorded."""
    rows = _rows(path, export, f"{name}.csv")
    if not rows:
        return None
    header = [cell.strip().lower() for cell in rows[0]]
    missing = [column for column in ("time", *columns) if column not in header]
    if missing:
        raise SourceError(f"{path}: {name}.csv has no column {', '.join(missing)}")
    time_at, *value_at = (header.index(column) for column in ("time", *columns))
    try:
        time_ns = np.array([int(row[time_at]) for row in rows[1:]], dtype=np.int64)
        readings = np.array([[float(row[at]) for at in value_at] for row in rows[1:]])
    except (ValueError, IndexError, OverflowError) as error:
        raise SourceError(f"{path}: {name}.csv: {error}; correct or remove the row") from None
    if len(time_ns) < 2:
        return None
    order = np.argsort(time_ns, kind="stable")
    return _Sensor(time_ns[order], readings[order])


def _rows(path: Path, export: Export, name: str) -> list[list[str]]:
    """Return the cells of a file; none if it is not there."""
    file = export / name
    if not file.is_file():
        return []
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError, zipfile.BadZipFile) as error:
        raise SourceError(f"{path}: {name} cannot be read ({error}); export it again") from None
    return [row for row in csv.reader(io.StringIO(text)) if row]


def _set_down(pressure: _Sensor, time_ns: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Array:
    """Return pressure (n,) at the samples next after its readings, NaN at the others."""
    found = np.full(len(time_ns), np.nan)
    rows = np.searchsorted(time_ns, pressure.time_ns)
    inside = rows < len(time_ns)
    found[rows[inside]] = PASCAL_PER_HPA * pressure.readings[inside, 0]
    return found
