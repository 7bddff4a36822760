"""Everybody's tracks as a table (CSV, RFC 4180)."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence

from command_post.confidence import radii95_m
from command_post.exports.material import Material, Stance, geodetic, iso
from shared.geodesy import Origin

COLUMNS = (
    "time", "responder", "track", "north_m", "east_m", "down_m", "floor", "sd_north_m", "sd_east_m",
    "covariance_ne_m2", "sd_down_m", "radius95_m", "heading_deg", "heading_sd_deg", "status",
    "reason",
)  # fmt: skip
ON_EARTH = ("latitude_deg", "longitude_deg", "height_m")


def csv_of(material: Material, origin: Origin | None) -> bytes:
    """Return tracks as a table: a row for each moment of each, in UTC.

    ``track`` is ``live`` or ``afterwards``. With an ``origin`` it says where on the Earth as well;
    headings are then from true north.
    """
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow([*COLUMNS, *(() if origin is None else ON_EARTH)])
    bearing_deg = 0.0 if origin is None else origin.bearing_deg
    stances = material.stances
    rows = (_row(each, material, bearing_deg) for each in stances)
    for row, place in zip(rows, _places(stances, origin), strict=True):
        writer.writerow([*row, *place])
    return text.getvalue().encode()


def _places(stances: Sequence[Stance], origin: Origin | None) -> Iterator[list[str]]:
    if origin is None:
        yield from ([] for _ in stances)
        return
    for latitude, longitude, height in geodetic(stances, origin).tolist():
        yield [f"{latitude:.8f}", f"{longitude:.8f}", f"{height:.2f}"]


def _row(stance: Stance, material: Material, bearing_deg: float) -> list[str]:
    nn, ne, ee = stance.covariance_m2
    heading = stance.heading_rad
    return [
        iso(stance.time_ns), stance.responder_id, stance.kind,
        *(f"{each:.3f}" for each in stance.place_m), str(material.level(stance.floor_down_m)),
        f"{math.sqrt(max(nn, 0.0)):.3f}", f"{math.sqrt(max(ee, 0.0)):.3f}", f"{ne:.4f}",
        _known(stance.down_sd_m, 3), f"{radii95_m(stance.covariance_m2)[0]:.3f}",
        "" if heading is None else f"{(math.degrees(heading) + bearing_deg) % 360.0:.1f}",
        "" if stance.heading_sd_rad is None else f"{math.degrees(stance.heading_sd_rad):.1f}",
        stance.status, _harmless(stance.reason),
    ]  # fmt: skip


def _known(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _harmless(words: str) -> str:
    """Return words that no spreadsheet takes for a formula."""
    return f"'{words}" if words.startswith(("=", "+", "-", "@")) else words
