"""The same building, or the same routes, lying another way round in the incident's frame."""

from __future__ import annotations

import math
from typing import TypeVar

import msgspec

Settings = TypeVar("Settings")


def turned(settings: Settings, kind: type[Settings], turn_deg: float) -> Settings:
    """Return ``settings``, structs of points, turned clockwise about the incident's origin.

    Whatever stands under a key that ends with ``_m`` and is a list, is a point (north, east and
    perhaps down) or a list of points.
    """
    return msgspec.convert(_turned(msgspec.to_builtins(settings), "", math.radians(turn_deg)), kind)


def _turned(value: object, key: str, turn_rad: float) -> object:
    if isinstance(value, dict):
        return {name: _turned(each, str(name), turn_rad) for name, each in value.items()}
    if not isinstance(value, list | tuple):
        return value
    if key.endswith("_m") and value and isinstance(value[0], float | int):
        north_m, east_m, *down_m = value
        cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
        return [north_m * cosine - east_m * sine, east_m * cosine + north_m * sine, *down_m]
    return [_turned(each, key, turn_rad) for each in value]
