"""Messages that Foxglove and Lichtblick draw (pure), after the schemas that Foxglove publishes.

They are JSON with all fields there, as panels expect. Frames are right-handed with z up, turns are
quaternions. A reader knows what to draw by the schema's name: ``foxglove.`` and the type's.
"""

from __future__ import annotations

from functools import cache
from typing import Any, TypeAlias

import msgspec

LINE_LOOP = 1
COVARIANCE_KNOWN = 3
INFO, WARNING, ERROR, FATAL = 2, 3, 4, 5


class Time(msgspec.Struct, frozen=True):
    """Seconds since the epoch, and nanoseconds of the next."""

    sec: int
    nsec: int


class Vector3(msgspec.Struct, frozen=True):
    """A vector, a place or a size, m."""

    x: float
    y: float
    z: float


class Quaternion(msgspec.Struct, frozen=True):
    """A rotation."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0


class Color(msgspec.Struct, frozen=True):
    """Each from 0 to 1."""

    r: float
    g: float
    b: float
    a: float


class Pose(msgspec.Struct, frozen=True):
    """Where something is, and how it is turned."""

    position: Vector3
    orientation: Quaternion = Quaternion()


class ArrowPrimitive(msgspec.Struct, frozen=True):
    """An arrow along x of its pose; lengths and diameters in m."""

    pose: Pose
    shaft_length: float
    shaft_diameter: float
    head_length: float
    head_diameter: float
    color: Color


class CubePrimitive(msgspec.Struct, frozen=True):
    """A box around its pose."""

    pose: Pose
    size: Vector3
    color: Color


class SpherePrimitive(msgspec.Struct, frozen=True):
    """An ellipsoid around its pose; ``size`` are its diameters."""

    pose: Pose
    size: Vector3
    color: Color


class CylinderPrimitive(msgspec.Struct, frozen=True):
    """A disc around its pose, elliptic by ``size`` x and y, and as high as z."""

    pose: Pose
    size: Vector3
    bottom_scale: float
    top_scale: float
    color: Color


class LinePrimitive(msgspec.Struct, frozen=True):
    """A line through ``points``, which are relative to its pose."""

    type: int
    pose: Pose
    thickness: float
    scale_invariant: bool
    points: list[Vector3]
    color: Color
    colors: list[Color] = []
    indices: list[int] = []


class TextPrimitive(msgspec.Struct, frozen=True):
    """Words at a place, of ``font_size`` m."""

    pose: Pose
    billboard: bool
    font_size: float
    scale_invariant: bool
    color: Color
    text: str


class SceneEntity(msgspec.Struct, frozen=True, kw_only=True):
    """Something in the scene; it takes the place of what had its ``id`` on the same topic."""

    timestamp: Time
    frame_id: str
    id: str
    lifetime: Time = Time(0, 0)
    frame_locked: bool = False
    metadata: list[dict[str, str]] = []
    arrows: list[ArrowPrimitive] = []
    cubes: list[CubePrimitive] = []
    spheres: list[SpherePrimitive] = []
    cylinders: list[CylinderPrimitive] = []
    lines: list[LinePrimitive] = []
    triangles: list[dict[str, str]] = []
    texts: list[TextPrimitive] = []
    models: list[dict[str, str]] = []


class SceneEntityDeletion(msgspec.Struct, frozen=True):
    """What had ``id`` on the same topic is there no more."""

    timestamp: Time
    id: str
    type: int = 0


class SceneUpdate(msgspec.Struct, frozen=True):
    """What changes in a three-dimensional scene."""

    entities: list[SceneEntity]
    deletions: list[SceneEntityDeletion] = []


class FrameTransform(msgspec.Struct, frozen=True):
    """Where the frame of something is in another."""

    timestamp: Time
    parent_frame_id: str
    child_frame_id: str
    translation: Vector3
    rotation: Quaternion


class LocationFix(msgspec.Struct, frozen=True):
    """A place on the Earth: degrees, m above the ellipsoid; covariance east, north, up (m²)."""

    timestamp: Time
    frame_id: str
    latitude: float
    longitude: float
    altitude: float
    position_covariance: list[float]
    position_covariance_type: int
    color: Color


class GeoJSON(msgspec.Struct, frozen=True):
    """Features for a map, as the text of a GeoJSON document."""

    geojson: str


class Log(msgspec.Struct, frozen=True):
    """Somebody's words."""

    timestamp: Time
    level: int
    message: str
    name: str
    file: str = ""
    line: int = 0


Drawable: TypeAlias = SceneUpdate | FrameTransform | LocationFix | GeoJSON | Log


def schema_name(kind: type[Drawable]) -> str:
    """Return the name that readers know such messages by."""
    return f"foxglove.{kind.__name__}"


@cache
def drawable_schema(kind: type[Drawable]) -> bytes:
    """Return the JSON Schema of such messages, without references: not every reader follows one."""
    (root,), parts = msgspec.json.schema_components([kind], ref_template="{name}")
    return msgspec.json.encode(_inlined(root, parts))


def _inlined(node: Any, parts: dict[str, Any]) -> Any:
    if isinstance(node, list):
        return [_inlined(each, parts) for each in node]
    if not isinstance(node, dict):
        return node
    if "$ref" in node:
        return _inlined(parts[node["$ref"]], parts)
    return {name: _inlined(each, parts) for name, each in node.items() if name != "default"}
