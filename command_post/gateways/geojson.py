"""The incident as GeoJSON (RFC 7946), for any map (pure)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

from command_post.roster import DapRow
from command_post.ways import Point
from command_post.web.board import TrackView
from shared.geodesy import Origin

Feature: TypeAlias = dict[str, Any]
_CORNERS = 36


class Scene(NamedTuple):
    """Who and what is where now, and the ways that were gone, by responder."""

    tracks: list[TrackView]
    ways: dict[str, list[Point]]
    daps: tuple[DapRow, ...]


def feature_collection(scene: Scene, origin: Origin) -> Feature:
    """Return a scene as one feature collection.

    Responders and access points are points, the region that holds a responder with 95 % a polygon
    (``of`` names them), the way they came a line.
    """
    features = [
        *(feature for track in scene.tracks for feature in _of_track(track, origin)),
        *(_way(name, way, origin) for name, way in sorted(scene.ways.items()) if len(way) > 1),
        *(_dap(row, origin) for row in scene.daps if row.position is not None),
    ]
    return {"type": "FeatureCollection", "features": features}


def _of_track(track: TrackView, origin: Origin) -> Iterator[Feature]:
    place = (track.north_m, track.east_m, track.down_m)
    told = {
        "kind": "responder", "id": track.responder_id, "time_ns": track.time_ns,
        "status": track.status, "reason": track.reason, "radius95_m": track.axes95_m[0],
        "heading_deg": (math.degrees(track.heading_rad) + origin.bearing_deg) % 360.0,
        "heading_sd_deg": math.degrees(track.heading_sd_rad),
        "floor_down_m": track.floor_down_m, "floor_probability": track.floor_probability,
    }  # fmt: skip
    yield _feature({"type": "Point", "coordinates": _position(origin, place)}, told)
    rings = [
        [_position(origin, (north_m, east_m, track.down_m)) for north_m, east_m in _closed(outline)]
        for outline in _outlines(track)
    ]
    polygons = {"type": "MultiPolygon", "coordinates": [[ring] for ring in rings]}
    yield _feature(polygons, {"kind": "region95", "of": track.responder_id})


def _way(name: str, way: list[Point], origin: Origin) -> Feature:
    line = {"type": "LineString", "coordinates": [_position(origin, place) for place in way]}
    return _feature(line, {"kind": "way", "of": name})


def _dap(row: DapRow, origin: Origin) -> Feature:
    place = row.position
    if place is None:
        raise ValueError(f"{row.dap_id} stands nowhere yet")
    told = {"kind": "access_point", "id": row.dap_id, "status": row.status, "reason": row.reason}
    at = _position(origin, (place.north_m, place.east_m, place.down_m))
    return _feature({"type": "Point", "coordinates": at}, told)


def _feature(geometry: Feature, properties: Feature) -> Feature:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _position(origin: Origin, place: Point) -> list[float]:
    told = origin.geodetic(*place)
    return [round(told.longitude_deg, 8), round(told.latitude_deg, 8), round(told.height_m, 2)]


def _outlines(track: TrackView) -> list[list[tuple[float, float]]]:
    """Return the region's outlines (north, east); an ellipse's is anticlockwise from above."""
    if track.regions_m:
        return [list(outline) for outline in track.regions_m]
    longer_m, shorter_m = track.axes95_m
    cos, sin = math.cos(track.bearing_rad), math.sin(track.bearing_rad)
    turns = [-2.0 * math.pi * number / _CORNERS for number in range(_CORNERS)]
    return [
        [
            (
                track.north_m + longer_m * math.cos(turn) * cos - shorter_m * math.sin(turn) * sin,
                track.east_m + longer_m * math.cos(turn) * sin + shorter_m * math.sin(turn) * cos,
            )
            for turn in turns
        ]
    ]


def _closed(outline: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return [*outline, outline[0]]
