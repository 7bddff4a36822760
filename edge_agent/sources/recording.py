"""A recording as a source of samples, and what is said of one that cannot be used."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.messages import ImuSample, Vector3

Array: TypeAlias = NDArray[np.float64]

MICROTESLA_PER_GAUSS = 100.0

LEAST_GRAVITY_M_S2, MOST_GRAVITY_M_S2 = 3.0, 100.0
"""The median of forces is in between, in m/s²: a runner's boot reads 22, and whatever is told in g
or mg is not."""

FASTEST_RAD_S = 40.0
"""2300 °/s, beyond the range of the sensors in use: nobody turns so fast a tenth of the time."""

LONGEST_PERIOD_S, SHORTEST_PERIOD_S = 0.2, 0.0002
"""Between samples: nothing is told of who wears a slower sensor, and no inertial one is faster."""

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


def refuse_other_units(
    path: Path, force_m_s2: Array, rate_rad_s: Array | None, names: tuple[str, str]
) -> None:
    """Refuse forces that are not mostly some gravity, and rates that nothing worn turns at.

    ``names`` are what the file calls its accelerometer and its gyroscope.
    """
    force, rate = names
    with np.errstate(over="ignore"):
        size_m_s2 = np.linalg.norm(force_m_s2[np.isfinite(force_m_s2).all(axis=1)], axis=1)
    median_m_s2 = float(np.median(size_m_s2)) if size_m_s2.size else math.nan
    if not LEAST_GRAVITY_M_S2 <= median_m_s2 <= MOST_GRAVITY_M_S2:
        raise SourceError(
            f"{path}: {force} mostly reads {median_m_s2:.3g}, which is no gravity in m/s²: give "
            "specific force, gravity in it, in that unit"
        )
    if rate_rad_s is not None:
        refuse_other_rates(path, rate_rad_s, rate)


def refuse_other_rates(path: Path, rate_rad_s: Array, name: str) -> None:
    """Refuse rates (n, 3), called ``name`` in the file, that nothing worn turns at, or none."""
    rates = np.abs(rate_rad_s[np.isfinite(rate_rad_s).all(axis=1)])
    if not rates.size:
        raise SourceError(f"{path}: {name} holds no reading; leave it out, or export it again")
    if float(np.percentile(rates.max(axis=1), 90.0)) > FASTEST_RAD_S:
        raise SourceError(f"{path}: {name} turns faster than anything worn: is it in °/s?")


def refuse_no_pace(path: Path, name: str, time_s: Array) -> None:
    """Refuse times (n,) in another unit, and those that lost what is behind the point.

    ``name`` is what the file calls them.
    """
    apart_s = np.abs(np.diff(time_s))
    if not apart_s.any():
        raise SourceError(
            f"{path}: {name} is {time_s[0]:g} in all {len(time_s)} samples: the recorder's clock "
            "stood still; give the sensor's own times"
        )
    # Samples may come in bursts of one stamp, and pauses may be long.
    usual_s, mean_s = float(np.median(apart_s[apart_s > 0.0])), float(apart_s.mean())
    if min(usual_s, mean_s) > LONGEST_PERIOD_S or max(usual_s, mean_s) < SHORTEST_PERIOD_S:
        raise SourceError(
            f"{path}: {name} advances by {usual_s:.3g} s a sample, which is no inertial sensor's: "
            "give times in seconds, in 64 bits, 25 a second or more"
        )


def at_times(time_s: Array, own_s: Array, readings: Array, within_s: float = math.inf) -> Array:
    """Return a sensor's ``readings`` (k, c), read at ``own_s`` (k,), at ``time_s`` (n,): (n, c).

    They are NaN where none was read ``within_s``.
    """
    found = np.column_stack([np.interp(time_s, own_s, column) for column in readings.T])
    after = np.searchsorted(own_s, time_s).clip(1, len(own_s) - 1)
    away_s = np.minimum(np.abs(own_s[after] - time_s), np.abs(time_s - own_s[after - 1]))
    found[away_s > within_s] = np.nan
    return found


def _field(row: list[float]) -> Vector3 | None:
    """Return a row of fields, if it has a reading."""
    x, y, z = row
    return (x, y, z) if math.isfinite(x + y + z) else None


def _reading(number: float) -> float | None:
    """Return one number of a column, if it is a reading."""
    return number if math.isfinite(number) else None
