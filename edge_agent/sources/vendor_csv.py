"""CSV files as sensor makers' programs export them, told by their headers.

A header names a sensor, an axis and, mostly, a unit: ``Gyroscope X (deg/s)`` (x-io), ``Acc_X``
(Xsens), ``acc_x_m_s2``. Columns that are none of these are passed over. Where the header is silent
about the unit, the values tell it: gravity and the earth's field have one size, and no boot turns
at 40 rad/s.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import structlog

from edge_agent.sources.recording import (
    LARGEST_TIME_S,
    MICROTESLA_PER_GAUSS,
    Array,
    Recording,
    SourceError,
    refuse_no_pace,
    refuse_other_rates,
)
from edge_agent.sources.text_table import cells_of, delimiter_of, number_in, read_lines
from edge_agent.sources.time_stamps import repaired
from shared.units import NS_PER_S

STANDARD_GRAVITY_M_S2 = 9.80665
FASTEST_BOOT_RAD_S = 40.0
"""2300 °/s: beyond the range of the sensors worn on boots."""

RATES_HZ = (20.0, 1999.0)
"""What an inertial sensor samples at."""

EARTH_FIELD_UT = (15.0, 80.0)
AIR_PRESSURE_PA = (3e4, 1.2e5)
"""From the highest mountains to the deepest mines: in hPa or kPa, it is another number."""

HEADER_WITHIN_LINES = 30

_SENSOR_NAMES = {
    "force": ("accelerometer", "acceleration", "accel", "acc", "force"),
    "rate": ("gyroscope", "gyro", "gyr", "angular rate", "angular velocity", "rate"),
    "field": ("magnetometer", "magnetic field", "mag", "field"),
    "pressure": ("barometer", "barometric pressure", "air pressure", "pressure", "baro"),
    "temperature": ("temperature", "temp"),
    "time": ("sampletimefine", "timestamp", "time", "t"),
}
_UNITS: Mapping[str, Mapping[str, float]] = {
    "force": {"m/s2": 1.0, "g": STANDARD_GRAVITY_M_S2, "mg": STANDARD_GRAVITY_M_S2 / 1e3},
    "rate": {"rad/s": 1.0, "deg/s": np.pi / 180.0, "dps": np.pi / 180.0, "mdps": np.pi / 180e3},
    "field": {
        "ut": 1.0,
        "gauss": MICROTESLA_PER_GAUSS,
        "g": MICROTESLA_PER_GAUSS,
        "mgauss": MICROTESLA_PER_GAUSS / 1e3,
        "mg": MICROTESLA_PER_GAUSS / 1e3,
        "nt": 1e-3,
        "t": 1e6,
    },
    "pressure": {"pa": 1.0, "hpa": 100.0, "mbar": 100.0, "kpa": 1e3, "bar": 1e5},
    "temperature": {"degc": 1.0, "c": 1.0},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
}
_SCALARS = ("time", "pressure", "temperature")
_SAMPLE_TIME_FINE_S = (1e-4, 1e-6)
"""Ticks of Xsens' two kinds of counter: 10 kHz in the MT family, 1 MHz in the DOT."""

_EXPECTED = (
    "a time ('Time (s)', 'Timestamp (us)', 'SampleTimeFine' …) and x, y, z of an accelerometer "
    "('Accelerometer X (g)', 'Acc_X' …) and of a gyroscope ('Gyroscope X (deg/s)', 'Gyr_X' …)"
)

_log = structlog.stdlib.get_logger(__name__)


class _Column(NamedTuple):
    """Where a reading stands in a row, what its header says, and the unit if that is in it."""

    place: int
    header: str
    unit: str | None


class _Table(NamedTuple):
    """The columns by what they are (``time``, ``force x`` …), and all numbers (n, columns)."""

    columns: dict[str, _Column]
    values: Array

    def axes(self, sensor: str) -> Array:
        """Return the readings (n, 3) of a sensor, in the file's unit."""
        return self.values[:, [self.columns[f"{sensor} {axis}"].place for axis in "xyz"]]

    def scale(self, sensor: str) -> float | None:
        """Return the SI value of the file's unit for a sensor; ``None`` if no header tells it."""
        units = [column.unit for column in _columns_of(sensor, self.columns)]
        return next((_UNITS[sensor][unit] for unit in units if unit is not None), None)


def read_vendor_csv(path: Path) -> Recording:
    """Return the recording in ``path``.

    Rows sent twice are dropped and bursts of one stamp spread (see ``time_stamps``). Raises
    ``SourceError`` for a file that is not such a table: naming the columns found and those
    needed, or the line that is malformed.
    """
    table = _read(path)
    force_m_s2 = _force_m_s2(path, table)
    rate_rad_s = _rate_rad_s(path, table)
    field_ut, pressure_pa = _field_ut(table), _pressure_pa(table)
    rows, time_s = repaired(_time_s(path, table), np.hstack((force_m_s2, rate_rad_s)))
    return Recording(
        np.round(time_s * NS_PER_S).astype(np.int64),
        force_m_s2[rows],
        rate_rad_s[rows],
        None if field_ut is None else field_ut[rows],
        None if pressure_pa is None else pressure_pa[rows],
        table.values[rows, table.columns["temperature"].place]
        if "temperature" in table.columns
        else None,
    )


def _read(path: Path) -> _Table:
    lines, last_is_whole = read_lines(path)
    at, delimiter = _find_header(path, lines)
    header = cells_of(lines[at], delimiter)
    columns = _columns(path, header)
    rows = []
    for number, line in enumerate(lines[at + 1 :], at + 2):
        if not line.strip():
            continue
        try:
            rows.append(_numbers(line, delimiter, header, columns))
        except ValueError as error:
            if number == len(lines) and not last_is_whole:
                _log.warning(f"{path}: the last line is cut off and left out", line=number)
                break
            raise SourceError(
                f"{path}, line {number}: {error}; correct or remove the line"
            ) from None
    if len(rows) < 2:
        raise SourceError(f"{path}: {len(rows)} rows below the header; record longer")
    return _Table(columns, np.array(rows))


def _find_header(path: Path, lines: list[str]) -> tuple[int, str]:
    """Return the header's place and its delimiter; exports may begin with remarks."""
    for at, line in enumerate(lines[:HEADER_WITHIN_LINES]):
        delimiter = delimiter_of(line)
        meanings = [_meaning(cell) for cell in cells_of(line, delimiter)]
        if any(meaning is not None and meaning[0] != "time" for meaning in meanings):
            return at, delimiter
    found = repr(lines[0][:200]) if lines else "nothing"
    raise SourceError(
        f"{path}: no header with inertial columns; found {found}, need {_EXPECTED}; "
        "a phone's export is phone:FOLDER"
    )


def _meaning(header: str) -> tuple[str, str | None] | None:
    """Return what a header names (``time``, ``force x`` …) and its unit; ``None`` if neither."""
    name, _, bracketed = header.lower().partition("(" if "(" in header else "[")
    words = re.split(r"[\s_.-]+", name.strip())
    unit = re.sub(r"[)\]\s^]", "", bracketed)
    for sensor, names in _SENSOR_NAMES.items():
        for count in range(len(words), 0, -1):
            if " ".join(words[:count]) in names:
                return _with_axis(sensor, words[count:], unit)
    return None


def _with_axis(sensor: str, words: list[str], unit: str) -> tuple[str, str | None] | None:
    """Return what a header means whose words after the sensor's name are ``words``."""
    if sensor not in _SCALARS:
        if not words or words[0] not in {"x", "y", "z"}:
            return None
        sensor, words = f"{sensor} {words[0]}", words[1:]
    unit = unit or "/".join(words)
    for written, meant in (("²", "2"), ("°", "deg"), ("µ", "u"), ("μ", "u"), ("sec", "s")):
        unit = unit.replace(written, meant)
    return sensor, unit or None


def _columns(path: Path, header: list[str]) -> dict[str, _Column]:
    columns: dict[str, _Column] = {}
    for place, text in enumerate(header):
        meaning = _meaning(text)
        if meaning is None or meaning[0] in columns:
            continue
        what, unit = meaning
        known = _UNITS[what.partition(" ")[0]]
        if what in ("pressure", "temperature") and unit is not None and unit not in known:
            continue  # An altitude, or another figure made of it; degrees of another kind.
        if unit is not None and unit not in known:
            raise SourceError(
                f"{path}: column {text!r}: unknown unit; write one of {', '.join(known)}"
            )
        columns[what] = _Column(place, text, unit)
    needed = ["time", *(f"{sensor} {axis}" for sensor in ("force", "rate") for axis in "xyz")]
    if missing := [what for what in needed if what not in columns]:
        raise SourceError(
            f"{path}: no column for {', '.join(missing)}; found {', '.join(header)}; "
            f"need {_EXPECTED}"
        )
    _refuse_mixed_units(path, columns)
    return columns


def _columns_of(sensor: str, columns: Mapping[str, _Column]) -> list[_Column]:
    return [column for what, column in columns.items() if what.partition(" ")[0] == sensor]


def _refuse_mixed_units(path: Path, columns: Mapping[str, _Column]) -> None:
    for sensor in _UNITS:
        told = [each for each in _columns_of(sensor, columns) if each.unit is not None]
        if len({_UNITS[sensor][each.unit] for each in told if each.unit is not None}) > 1:
            headers = ", ".join(each.header for each in told)
            raise SourceError(
                f"{path}: {headers}: one sensor in different units; correct the header, "
                "or export it in one"
            )


def _numbers(
    line: str, delimiter: str, header: list[str], columns: dict[str, _Column]
) -> list[float]:
    """Return a row as numbers, NaN in columns that are not wanted or have no reading.

    Raises ``ValueError`` for a row that is none.
    """
    cells = cells_of(line, delimiter)
    if len(cells) != len(header):
        raise ValueError(f"{len(cells)} cells where the header has {len(header)}")
    row = [math.nan] * len(cells)
    for what, column in columns.items():
        cell = cells[column.place]
        if not cell and what.startswith(("field", "pressure", "temperature")):
            continue
        try:
            row[column.place] = number_in(cell, delimiter)
        except ValueError:
            raise ValueError(f"{column.header} is {cell!r}, not a number") from None
    return row


def _time_s(path: Path, table: _Table) -> Array:
    header = table.columns["time"].header
    stamps = table.values[:, table.columns["time"].place]
    if not np.isfinite(stamps).all():
        raise SourceError(f"{path}: {header} is not finite in every row; export it again")
    if (stamps == stamps[0]).all():
        raise SourceError(
            f"{path}: {header} is {stamps[0]:g} in all {len(stamps)} rows: the recorder's clock "
            "stood still; export the sensor's own time stamps"
        )
    per_row = (stamps[-1] - stamps[0]) / (len(stamps) - 1)
    if per_row <= 0.0:
        raise SourceError(
            f"{path}: {header} does not advance, from {stamps[0]:g} in the first row to "
            f"{stamps[-1]:g} in the last; put the rows in order"
        )
    time_s: Array = stamps * _time_scale(path, table, header, per_row)
    if np.abs(time_s).max() > LARGEST_TIME_S:
        raise SourceError(
            f"{path}: {header} reads {np.abs(time_s).max():g} s, which is no time; correct its unit"
        )
    refuse_no_pace(path, header, time_s)
    return time_s


def _time_scale(path: Path, table: _Table, header: str, per_row: float) -> float:
    """Return the seconds that one of the time's unit is: as told, or as makes a likely rate."""
    told = table.scale("time")
    if told is not None:
        return told
    fine = header.lower().startswith("sampletimefine")
    for scale in _SAMPLE_TIME_FINE_S if fine else _UNITS["time"].values():
        if RATES_HZ[0] <= 1.0 / max(per_row * scale, 1e-12) <= RATES_HZ[1]:
            return scale
    raise SourceError(
        f"{path}: {header} advances by {per_row:g} a row, which in no unit is a "
        f"rate of {RATES_HZ[0]:g} to {RATES_HZ[1]:g} Hz; name its unit, as in 'Time (s)'"
    )


def _readings(path: Path, table: _Table, sensor: str) -> Array:
    """Return the readings (n, 3) of a sensor that must have some on each axis."""
    readings = table.axes(sensor)
    for axis, column in zip("xyz", np.isfinite(readings).T, strict=True):
        if not column.any():
            header = table.columns[f"{sensor} {axis}"].header
            raise SourceError(f"{path}: {header} has no reading in any row; export it again")
    return readings


def _force_m_s2(path: Path, table: _Table) -> Array:
    """Return specific force, which whatever its unit must have gravity in it."""
    readings = _readings(path, table, "force")
    with np.errstate(over="ignore"):
        median = float(np.nanmedian(np.linalg.norm(readings, axis=1)))
    told = table.scale("force")
    for scale in _UNITS["force"].values() if told is None else (told,):
        if 0.5 <= median * scale / STANDARD_GRAVITY_M_S2 <= 2.0:
            return readings * scale
    raise SourceError(
        f"{path}: the accelerometer mostly reads {median:g}, which is not gravity in "
        f"{table.columns['force x'].unit or 'any known unit'}; "
        "correct the unit, or the columns' names, in the header"
    )


def _rate_rad_s(path: Path, table: _Table) -> Array:
    readings = _readings(path, table, "rate")
    scale = table.scale("rate")
    if scale is None:
        degrees = np.nanmax(np.abs(readings)) > FASTEST_BOOT_RAD_S
        scale = _UNITS["rate"]["deg/s" if degrees else "rad/s"]
    rate_rad_s: Array = readings * scale
    refuse_other_rates(path, rate_rad_s, table.columns["rate x"].header)
    return rate_rad_s


def _field_ut(table: _Table) -> Array | None:
    """Return the magnetic field; ``None`` without one, or if its unit cannot be told."""
    if not all(f"field {axis}" in table.columns for axis in "xyz"):
        return None
    readings = table.axes("field")
    told = table.scale("field")
    if told is not None:
        return readings * told
    lengths = np.linalg.norm(readings, axis=1)
    if not np.isfinite(lengths).any():
        return None
    median = float(np.nanmedian(lengths))
    for unit in ("ut", "gauss", "mgauss", "nt"):
        scale = _UNITS["field"][unit]
        if EARTH_FIELD_UT[0] <= median * scale <= EARTH_FIELD_UT[1]:
            return readings * scale
    return None


def _pressure_pa(table: _Table) -> Array | None:
    """Return the air's pressure (n,); ``None`` without it, or if its unit cannot be told."""
    if "pressure" not in table.columns:
        return None
    readings = table.values[:, table.columns["pressure"].place]
    told = table.scale("pressure")
    if told is not None:
        return readings * told
    if not np.isfinite(readings).any():
        return None
    median = float(np.nanmedian(readings))
    for scale in _UNITS["pressure"].values():
        if AIR_PRESSURE_PA[0] <= median * scale <= AIR_PRESSURE_PA[1]:
            return readings * scale
    return None
