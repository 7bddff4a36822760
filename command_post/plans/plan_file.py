"""A building's plan from a GeoJSON file (RFC 7946): its walls, in the incident's frame.

The file is a FeatureCollection of LineString, MultiLineString, Polygon and MultiPolygon features;
each line of each is a wall, doors are gaps in it; properties are passed over. Where its
coordinates lie, a member of the collection says: ``"clew:frame": "local"`` for [east, north] in
metres of the incident's frame, or ``"clew:origin": [longitude, latitude]`` of that frame's origin
for GeoJSON's own degrees.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import msgspec
from msgspec import Meta

from command_post.fusion.settings import FusionSettings
from command_post.fusion.walls import Wall, axis_of
from shared.config import ConfigError

MOST_BYTES = 1 << 26
MOST_WALLS = 50_000
FARTHEST_M = 20_000.0
LEAST_M = 0.01

SEMI_MAJOR_M = 6_378_137.0
ECCENTRICITY2 = 0.006_694_379_990_14
"""Of the ellipsoid WGS 84."""

Position: TypeAlias = Annotated[list[float], Meta(min_length=2, max_length=3)]
Line: TypeAlias = Annotated[list[Position], Meta(min_length=2)]
Placed: TypeAlias = Callable[[float, float], tuple[float, float]]


class _LineString(msgspec.Struct, tag_field="type", tag="LineString"):
    coordinates: Line


class _MultiLineString(msgspec.Struct, tag_field="type", tag="MultiLineString"):
    coordinates: list[Line]


class _Polygon(msgspec.Struct, tag_field="type", tag="Polygon"):
    coordinates: list[Line]


class _MultiPolygon(msgspec.Struct, tag_field="type", tag="MultiPolygon"):
    coordinates: list[list[Line]]


class _Feature(msgspec.Struct, tag_field="type", tag="Feature"):
    geometry: _LineString | _MultiLineString | _Polygon | _MultiPolygon


class _Collection(msgspec.Struct, tag_field="type", tag="FeatureCollection"):
    features: list[_Feature]
    frame: Literal["local"] | None = msgspec.field(default=None, name="clew:frame")
    origin: Annotated[list[float], Meta(min_length=2, max_length=2)] | None = msgspec.field(
        default=None, name="clew:origin"
    )


def load_walls(path: Path) -> tuple[Wall, ...]:
    """Return the walls in the GeoJSON file at ``path``.

    Raises ``ConfigError`` when the file cannot be read, is no such plan, or lies nowhere.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise ConfigError(f"{path}: larger than {MOST_BYTES >> 20} MiB; give the walls alone")
        content = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror}); give another") from None
    return parse_walls(content, str(path))


def with_plan(settings: FusionSettings, path: Path | None) -> FusionSettings:
    """Return settings that know which way the walls of the plan at ``path``, if any, run.

    A recording keeps that with all settings. Raises ``ConfigError`` as ``load_walls``, and where
    walls run along no axis.
    """
    if path is None:
        return settings
    axis_rad = axis_of(load_walls(path))
    if axis_rad is None:
        raise ConfigError(f"{path}: its walls run along no axis, and nothing else is used of them")
    team = msgspec.structs.replace(settings.team, planned_axis_rad=axis_rad)
    return msgspec.structs.replace(settings, team=team)


def with_usable_plan(
    settings: FusionSettings, path: Path | None
) -> tuple[FusionSettings, str | None]:
    """Return settings as ``with_plan``, or as they are and why the plan is refused.

    For a post: that it hears an incident must not hang on a drawing.
    """
    try:
        return with_plan(settings, path), None
    except ConfigError as error:
        return settings, f"going on without a plan: {error}"


def parse_walls(content: bytes, origin: str) -> tuple[Wall, ...]:
    """Return the walls in a GeoJSON text; errors are as in ``load_walls`` and name ``origin``."""
    try:
        told = msgspec.json.decode(content, type=_Collection)
    except msgspec.MsgspecError as error:
        raise ConfigError(
            f"{origin}: no plan: {error}; give a FeatureCollection of lines and polygons"
        ) from None
    placed = _placing(told, origin)
    walls = []
    for feature in told.features:
        for line in _lines(feature.geometry.coordinates):
            points = [placed(each[0], each[1]) for each in line]
            walls += [Wall(*one, *other) for one, other in pairwise(points)]
    walls = [wall for wall in walls if wall.length_m >= LEAST_M]
    if not walls or len(walls) > MOST_WALLS:
        raise ConfigError(f"{origin}: {len(walls)} walls; a plan has 1 to {MOST_WALLS}")
    farthest_m = max(max(map(abs, msgspec.structs.astuple(wall))) for wall in walls)
    if farthest_m > FARTHEST_M:
        raise ConfigError(
            f"{origin}: reaches {farthest_m / 1e3:.3g} km from the incident's origin; "
            'correct "clew:origin", or its coordinates'
        )
    return tuple(walls)


def geojson_of(walls: tuple[Wall, ...]) -> bytes:
    """Return walls as a GeoJSON text that ``parse_walls`` reads, in the incident's own frame."""
    features = [
        {
            "type": "Feature",
            "properties": {},
            "geometry": {
                "type": "LineString",
                "coordinates": [
                    [wall.from_east_m, wall.from_north_m],
                    [wall.to_east_m, wall.to_north_m],
                ],
            },
        }
        for wall in walls
    ]
    told = {"type": "FeatureCollection", "clew:frame": "local", "features": features}
    return msgspec.json.encode(told)


def _lines(coordinates: list[Any]) -> Iterator[Line]:
    """Yield the lines of a geometry, however deep its coordinates are nested."""
    if coordinates and coordinates[0] and isinstance(coordinates[0][0], float):
        yield coordinates
    else:
        for each in coordinates:
            yield from _lines(each)


def _placing(told: _Collection, origin: str) -> Placed:
    """Return what makes north and east (m) of a file's coordinates."""
    if told.frame == "local" and told.origin is None:
        return lambda east_m, north_m: (north_m, east_m)
    if told.frame is not None or told.origin is None:
        raise ConfigError(
            f'{origin}: lies nowhere; say "clew:frame": "local" for metres east and north, or '
            '"clew:origin": [longitude, latitude] of the incident, and not both'
        )
    longitude_deg, latitude_deg = told.origin
    if not (abs(longitude_deg) <= 180.0 and abs(latitude_deg) < 89.0):
        raise ConfigError(f'{origin}: "clew:origin": give [longitude, latitude] in degrees')
    # Radii of curvature along the meridian and across it: over a few hundred metres the ellipsoid
    # is as flat as a plan.
    squeezed = 1.0 - ECCENTRICITY2 * math.sin(math.radians(latitude_deg)) ** 2
    north_m_rad = SEMI_MAJOR_M * (1.0 - ECCENTRICITY2) / squeezed**1.5
    east_m_rad = SEMI_MAJOR_M / math.sqrt(squeezed) * math.cos(math.radians(latitude_deg))
    return lambda lon_deg, lat_deg: (
        math.radians(lat_deg - latitude_deg) * north_m_rad,
        math.radians(lon_deg - longitude_deg) * east_m_rad,
    )
