"""A phone's own recording: the export of the app 'Sensor Logger', a folder or .zip of CSV files.

One file a sensor, each on its own time stamps: ``TotalAcceleration.csv`` (Android) or
``Accelerometer.csv`` and ``Gravity.csv``, ``Gyroscope.csv``, ``Magnetometer.csv``,
``Barometer.csv``, ``Location.csv``; and ``metadata.csv``, which says what phone it was: iOS tells
forces by the opposite sign.
"""

from __future__ import annotations

import csv
import io
import math
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
import structlog

from edge_agent.gnss import SpeedReading, speed_reading
from edge_agent.sources.phone_stream import SHORTEST_PERIOD_NS, SILENT_NS
from edge_agent.sources.recording import (
    Array,
    Recording,
    SourceError,
    at_times,
    refuse_other_units,
)
from edge_agent.sources.text_table import decoded, delimiter_of, number_in
from shared.units import NS_PER_S

Export: TypeAlias = Path | zipfile.Path

PASCAL_PER_HPA = 100.0
XYZ = ("x", "y", "z")
LATEST_ROW_NS = NS_PER_S
"""A row that is written later than this after its time was not late: the clock was set back."""

LATEST_NS = 2**62

METADATA = "metadata.csv"
EXPECTED = (
    "Accelerometer and Gravity (on Android TotalAcceleration), and Gyroscope; "
    "switch them on in the app and export as Zip"
)

_log = structlog.stdlib.get_logger(__name__)


class _Sensor(NamedTuple):
    """One file: ``time_ns`` (k,), rising, and ``readings`` (k, columns)."""

    time_ns: np.ndarray[tuple[int], np.dtype[np.int64]]
    readings: Array


class _Table(NamedTuple):
    """The cells of a file, what parts them, and whether its last row was ended."""

    rows: list[list[str]]
    delimiter: str
    ended: bool


def read_phone_export(path: Path, *, needs_gyro: bool = True) -> Recording:
    """Return the recording of a folder or .zip as the app exports it.

    Samples are those of the accelerometer; other sensors are interpolated at them, the barometer's
    readings set down at the nearest. Axes are the phone's: right, up along the screen, out of it.
    Raises ``SourceError`` for what is no such export, or has no gyroscope though ``needs_gyro``.
    """
    export = _opened(path)
    force = _force(path, export)
    time_s = (force.time_ns - force.time_ns[0]) / NS_PER_S
    period_ns = float(np.median(np.diff(force.time_ns)))
    if period_ns < SHORTEST_PERIOD_NS:
        raise SourceError(
            f"{path}: forces are {period_ns:.0f} ns apart, which no phone "
            "reads: times are to be nanoseconds, as the app writes them; export it again"
        )

    def at_force(sensor: _Sensor, within_s: float = math.inf) -> Array:
        own_s = (sensor.time_ns - force.time_ns[0]) / NS_PER_S
        return at_times(time_s, own_s, sensor.readings, within_s)

    gyro = _sensor(path, export, "Gyroscope", XYZ)
    rate_rad_s = None if gyro is None else at_force(gyro, SILENT_NS / NS_PER_S)
    if rate_rad_s is None and needs_gyro:
        raise SourceError(f"{path}: no Gyroscope.csv in it; the app must record {EXPECTED}")
    refuse_other_units(path, force.readings, rate_rad_s, ("the accelerometer", "Gyroscope.csv"))
    _tell_silence(path, time_s, rate_rad_s)
    field = _sensor(path, export, "Magnetometer", XYZ)
    pressure = _sensor(path, export, "Barometer", ("pressure",))
    return Recording(
        force.time_ns,
        force.readings,
        np.full((len(time_s), 3), np.nan) if rate_rad_s is None else rate_rad_s,
        None if field is None else at_force(field),
        None if pressure is None else _set_down(pressure, force.time_ns),
    )


def _tell_silence(path: Path, time_s: Array, rate_rad_s: Array | None) -> None:
    """Say where the way will not be known for want of rates (n, 3)."""
    if rate_rad_s is None:
        _log.warning(f"{path}: no gyroscope in it: steps are counted, and lead anywhere")
        return
    silent = np.isnan(rate_rad_s).any(axis=1)
    if silent.any():
        _log.warning(
            f"{path}: the gyroscope tells nothing of some samples: nobody knows how it turned",
            samples=int(np.count_nonzero(silent)),
            of=len(time_s),
            first_s=round(float(time_s[silent][0]), 3),
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
        raise SourceError(
            f"{path}: not a folder, and no whole .zip ({error}); give the app's export whole"
        ) from None
    inside = [one for one in root.iterdir() if one.is_dir() and one.name != "__MACOSX"]
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
    rows = _table(path, export, METADATA).rows
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
    table = _table(path, export, f"{name}.csv")
    rows = table.rows
    if not rows:
        return None
    header = [cell.strip().lower() for cell in rows[0]]
    missing = [column for column in ("time", *columns) if column not in header]
    if missing:
        raise SourceError(
            f"{path}: {name}.csv has no column {', '.join(missing)}; it has "
            f"{', '.join(rows[0])[:200]}: export it again as the app writes it"
        )
    time_at, *value_at = (header.index(column) for column in ("time", *columns))
    time_ns, readings = [], []
    for number, row in enumerate(rows[1:], 2):
        try:
            told = [number_in(row[at], table.delimiter) for at in value_at]
            time_ns.append(_whole(row[time_at]))
        except (ValueError, IndexError) as error:
            if number == len(rows) and not table.ended:
                _log.warning(f"{path}: the last row of {name}.csv is cut off and left out")
                break
            why = f"only {len(row)} cells" if isinstance(error, IndexError) else str(error)
            raise SourceError(
                f"{path}: {name}.csv, row {number}: {why}; export it again, or remove the row"
            ) from None
        readings.append(told)
    if len(time_ns) < 2:
        return None
    return _in_order(path, name, np.array(time_ns, dtype=np.int64), np.array(readings))


def _in_order(
    path: Path, name: str, time_ns: np.ndarray[tuple[int], np.dtype[np.int64]], readings: Array
) -> _Sensor:
    """Return a sensor's rows by time; refuse those of a clock that was set back."""
    back_ns = -int(np.diff(time_ns).min())
    if back_ns > LATEST_ROW_NS:
        raise SourceError(
            f"{path}: {name}.csv goes back in time by {back_ns / NS_PER_S:.1f} s: the phone's "
            "clock was set back, or there are two recordings in it; give each part by itself"
        )
    order = np.argsort(time_ns, kind="stable")
    return _Sensor(time_ns[order], readings[order])


def _whole(cell: str) -> int:
    """Return a time in nanoseconds; ``ValueError`` for one that a spreadsheet has rounded."""
    if not cell.strip().isdecimal() or int(cell) > LATEST_NS:
        raise ValueError(f"time {cell[:30]!r} is no whole number of nanoseconds since 1970")
    return int(cell)


def _table(path: Path, export: Export, name: str) -> _Table:
    """Return the cells of a file; no rows if it is not there."""
    file = export / name
    if not file.is_file():
        return _Table([], ",", ended=True)
    try:
        text = decoded(file.read_bytes())
        delimiter = delimiter_of(text.partition("\n")[0])
        rows = [row for row in csv.reader(io.StringIO(text), delimiter=delimiter) if row]
    except (OSError, zipfile.BadZipFile, zlib.error, csv.Error, RuntimeError) as error:
        # A RuntimeError is of a .zip that is encrypted, or packed in an unknown way.
        raise SourceError(f"{path}: {name} cannot be read ({error}); export it again") from None
    return _Table(rows, delimiter, ended=text.endswith(("\n", "\r")))


def _set_down(pressure: _Sensor, time_ns: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Array:
    """Return pressure (n,) at the samples next after its readings, NaN at the others."""
    found = np.full(len(time_ns), np.nan)
    rows = np.searchsorted(time_ns, pressure.time_ns)
    inside = rows < len(time_ns)
    found[rows[inside]] = PASCAL_PER_HPA * pressure.readings[inside, 0]
    return found
