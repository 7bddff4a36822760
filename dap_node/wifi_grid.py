"""Recordings of Wi-Fi access points from the points of a grid: signal strength and range (docs).

A row is one scan: where it was taken, and of each access point the round-trip range (mm) and the
signal strength (dBm). Where the access points stand is not said, so that ranges are the measured
ones, the median of each point.
"""

from __future__ import annotations

import csv
import gzip
import io
import re
import zlib
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

MISSING_RSSI_DBM = -200.0
MISSING_RANGE_MM = 100_000.0
LARGEST_BYTES = 64 * 2**20
NEAREST_M = 0.3
"""Round-trip ranges go below nothing near by: they count as this at least."""

WALK_M_S = 1.0
SCANS_PER_S = 5
FIRST_COLUMNS = ("X", "Y")
_ACCESS_POINT = re.compile(r"AP(\d+) (RTT\(mm\)|RSS\(dBm\))")


class WifiGridError(ValueError):
    """A file is no such recording. The text names it, what is wrong, and what to do."""


class WifiGrid(NamedTuple):
    """One room: ``n`` scans at ``p`` points of ``a`` access points.

    ``point`` (n,) are rows of ``place_m`` (p, 2), in the order of the file; ``range_m`` (p, a) is
    NaN where a point has none, ``rssi_dbm`` (n, a) where an access point was not heard.
    """

    point: NDArray[np.int64]
    place_m: Array
    range_m: Array
    rssi_dbm: Array


class GridWalk(NamedTuple):
    """A walk over the points as one receiver hears it: times (s), readings, and ranges there."""

    time_s: Array
    rssi_dbm: Array
    truth_s: Array
    range_m: Array


def read_wifi_grid(path: Path) -> WifiGrid:
    """Return the recording at ``path``, CSV or CSV in gzip; raise ``WifiGridError``."""
    rows = list(csv.reader(io.StringIO(_text(path))))
    columns = _columns(path, rows[0] if rows else [])
    try:
        values = np.array([[float(row[at]) for at in columns] for row in rows[1:] if row])
    except (ValueError, IndexError) as error:
        raise WifiGridError(f"{path}: a row is not whole ({error}); export it again") from None
    if len(values) < 2 or not np.isfinite(values).all():
        raise WifiGridError(f"{path}: too few scans, or not all numbers; export it again")
    count = (len(columns) - 2) // 2
    place_m, first, point = np.unique(values[:, :2], axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    point = rank[point.ravel()]
    range_mm, rssi_dbm = values[:, 2 : 2 + count], values[:, 2 + count :]
    range_m = np.where(range_mm >= MISSING_RANGE_MM, np.nan, range_mm / 1000.0)
    return WifiGrid(
        point,
        place_m[order],
        np.array(
            [[_median_m(column) for column in range_m[point == at].T] for at in range(len(order))]
        ),
        np.where(rssi_dbm <= MISSING_RSSI_DBM, np.nan, rssi_dbm),
    )


def walk_over(grid: WifiGrid, access_point: int) -> GridWalk:
    """Return a walk from point to point in the order of the file, to and fro along the columns.

    At each point it stays for a second and takes the point's first five scans; between points it
    goes at a metre a second, unheard. Points without a range to the access point are left out.
    """
    known = np.flatnonzero(~np.isnan(grid.range_m[:, access_point]))
    # Columns alternate in direction, as somebody walks who covers a floor.
    _, column = np.unique(grid.place_m[known, 0], return_inverse=True)
    along = np.where(column.ravel() % 2 == 0, 1.0, -1.0) * grid.place_m[known, 1]
    known = known[np.lexsort((along, grid.place_m[known, 0]))]
    steps_m = np.linalg.norm(np.diff(grid.place_m[known], axis=0), axis=1)
    arrive_s = np.concatenate([[0.0], np.cumsum(1.0 + steps_m / WALK_M_S)])
    time_s, rssi_dbm = [], []
    for at, from_s in zip(known.tolist(), arrive_s.tolist(), strict=True):
        scans = grid.rssi_dbm[grid.point == at, access_point][:SCANS_PER_S]
        heard = ~np.isnan(scans)
        time_s.append(from_s + np.flatnonzero(heard) / SCANS_PER_S)
        rssi_dbm.append(scans[heard])
    truth_s = np.repeat(arrive_s, 2) + np.tile([0.0, 1.0], len(arrive_s))
    return GridWalk(
        np.concatenate(time_s),
        np.concatenate(rssi_dbm),
        truth_s,
        np.repeat(grid.range_m[known, access_point], 2),
    )


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES + 1)
        if path.suffix == ".gz":
            with gzip.open(io.BytesIO(data)) as unpacked:
                data = unpacked.read(LARGEST_BYTES + 1)
        if len(data) > LARGEST_BYTES:
            raise WifiGridError(f"{path}: larger than {LARGEST_BYTES >> 20} MB; split it")
        return data.decode("utf-8-sig")
    except FileNotFoundError:
        raise WifiGridError(f"{path}: no such file") from None
    except UnicodeDecodeError:
        raise WifiGridError(f"{path}: not text; give a CSV file") from None
    except (OSError, EOFError, zlib.error) as error:
        raise WifiGridError(f"{path}: cannot be read ({error}); copy it again") from None


def _columns(path: Path, header: list[str]) -> list[int]:
    """Return where X, Y, the ranges and the signal strengths stand, in this order."""
    found: dict[str, dict[int, int]] = {"RTT(mm)": {}, "RSS(dBm)": {}}
    for at, name in enumerate(header):
        if (match := _ACCESS_POINT.fullmatch(name.strip())) is not None:
            found[match[2]][int(match[1])] = at
    ranges, strengths = found.values()
    if tuple(header[:2]) != FIRST_COLUMNS or not ranges or ranges.keys() != strengths.keys():
        raise WifiGridError(
            f"{path}: its columns are {', '.join(header[:4]) or 'none'} ...; a Wi-Fi grid has X, "
            "Y, and of each access point 'AP1 RTT(mm)' and 'AP1 RSS(dBm)'"
        )
    return [
        0,
        1,
        *(ranges[one] for one in sorted(ranges)),
        *(strengths[one] for one in sorted(ranges)),
    ]


def _median_m(range_m: Array) -> float:
    measured = range_m[~np.isnan(range_m)]
    return max(NEAREST_M, float(np.median(measured))) if len(measured) else float("nan")
