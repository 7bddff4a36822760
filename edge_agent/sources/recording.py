"""A recording as a source of samples, and what is said of one that cannot be used."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.messages import ImuSample, Vector3

Array: TypeAlias = NDArray[np.float64]

MICROTESLA_PER_GAUSS = 100.0

LARGEST_TIME_S = 9e9
"""Nanoseconds of more do not fit into 64 bits."""


class SourceError(ValueError):
    """A recording cannot be used. The text names the file, what is wrong, and what to do."""


@dataclass(frozen=True)
class Recording:
    """``n`` samples in the order of the file, as arrays in SI; iterates as ``ImuSample``.

    ``time_ns`` (n,), ``force_m_s2``, ``rate_rad_s`` and ``field_ut`` (n, 3), the last ``None``
    without a magnetometer; all in the sensor's own axes. ``pressure_pa`` (n,) is ``None`` without
    a barometer, ``temperature_c`` (n,) without a thermometer in the sensor. All three may be slower
    than the rest, and read NaN in between.
    """

    time_ns: NDArray[np.int64]
    force_m_s2: Array
    rate_rad_s: Array
    field_ut: Array | None = None
    pressure_pa: Array | None = None
    temperature_c: Array | None = None

    def __len__(self) -> int:
        return len(self.time_ns)

    def __iter__(self) -> Iterator[ImuSample]:
        readings = zip(
            self.time_ns.tolist(),
            map(tuple, self.force_m_s2.tolist()),
            map(tuple, self.rate_rad_s.tolist()),
            self._fields(),
            self._readings(self.pressure_pa),
            self._readings(self.temperature_c),
            strict=True,
        )
        return (ImuSample(*reading) for reading in readings)

    def rows(self, rows: slice | NDArray[np.intp]) -> Recording:
        """Return the recording of these rows alone."""
        return self._by_column(lambda column: column[rows])

    def in_rows(self) -> Recording:
        """Return the recording with the readings of each sample side by side in memory."""
        return self._by_column(np.ascontiguousarray)

    def _by_column(self, change: Callable[[NDArray[Any]], NDArray[Any]]) -> Recording:
        columns = {field.name: getattr(self, field.name) for field in fields(self)}
        changed = {name: change(old) for name, old in columns.items() if old is not None}
        return replace(self, **changed)

    def sample(self, row: int) -> ImuSample:
        """Return the sample at ``row``, counted from 0."""
        fx, fy, fz = self.force_m_s2[row].tolist()
        wx, wy, wz = self.rate_rad_s[row].tolist()
        return ImuSample(
            int(self.time_ns[row]),
            (fx, fy, fz),
            (wx, wy, wz),
            None if self.field_ut is None else _field(self.field_ut[row].tolist()),
            None if self.pressure_pa is None else _reading(float(self.pressure_pa[row])),
            None if self.temperature_c is None else _reading(float(self.temperature_c[row])),
        )

    def _fields(self) -> Iterable[Vector3 | None]:
        """Return the field at each sample that has one."""
        if self.field_ut is None:
            return itertools.repeat(None, len(self))
        return map(_field, self.field_ut.tolist())

    def _readings(self, column: Array | None) -> Iterable[float | None]:
        """Return what ``column`` (n,) has at each sample that has a reading."""
        if column is None:
            return itertools.repeat(None, len(self))
        return map(_reading, column.tolist())


def at_times(time_s: Array, own_s: Array, readings: Array) -> Array:
    """Return a sensor's ``readings`` (k, c), read at ``own_s`` (k,), at ``time_s`` (n,): (n, c)."""
    columns = [np.interp(time_s, own_s, column) for column in readings.T]
    return np.column_stack(columns)


def _field(row: list[float]) -> Vector3 | None:
    """Return a row of fields, if it has a reading."""
    x, y, z = row
    return (x, y, z) if math.isfinite(x + y + z) else None


def _reading(number: float) -> float | None:
    """Return one number of a column, if it is a reading."""
    return number if math.isfinite(number) else None
