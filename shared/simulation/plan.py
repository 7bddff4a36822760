"""A building: floors, walls with doors, rooms and stairs, and what a straight line meets in it.

Plan files give points as ``[north, east]`` in metres from the incident's origin; heights are
metres above it, upwards.
"""

from __future__ import annotations

import math
from functools import cache, cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from shared.config import ConfigError, load_toml

PLANS = Path(__file__).parent / "plans"
CHORD_M = 2.0
"""A bent wall is straight over this much."""
SLAB_TOLERANCE_M = 0.5
"""A point up to this far below a floor still counts as on it: feet on the last steps."""

Array: TypeAlias = NDArray[np.float64]
Length: TypeAlias = Annotated[float, Meta(gt=0.0, le=1000.0)]
Point: TypeAlias = tuple[
    Annotated[float, Meta(ge=-1e4, le=1e4)], Annotated[float, Meta(ge=-1e4, le=1e4)]
]
Attenuation: TypeAlias = Literal["light", "brick", "concrete"]
"""What a wall does to radio: plasterboard, masonry, load-bearing concrete."""


class Floor(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A level to stand on."""

    name: str
    height_m: float


class Door(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A gap in a wall, centred ``at_m`` from the wall's start."""

    at_m: Length
    width_m: Length = 0.9


class Wall(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A wall of one floor, from slab to slab, but for its doors.

    It is straight, or turns evenly by ``bend_deg`` from its start to its end, clockwise.
    """

    floor: str
    start_m: Point
    end_m: Point
    attenuation: Attenuation = "light"
    doors: tuple[Door, ...] = ()
    bend_deg: Annotated[float, Meta(gt=-360.0, lt=360.0)] = 0.0

    def __post_init__(self) -> None:
        """Refuse a door that is not in the wall."""
        for door in self.doors:
            if door.at_m > self.length_m:
                raise ValueError(
                    f"doors: at_m = {door.at_m:g} is beyond the wall, which is"
                    f" {self.length_m:.2f} m long"
                )

    @property
    def length_m(self) -> float:
        """Length along the wall."""
        chord_m = float(np.hypot(*np.subtract(self.end_m, self.start_m)))
        half_rad = 0.5 * math.radians(self.bend_deg)
        return chord_m * half_rad / math.sin(half_rad) if half_rad else chord_m

    def at(self, along_m: float) -> Array:
        """Return the point (2,) of the wall ``along_m`` from its start."""
        start, chord = np.array(self.start_m), np.subtract(self.end_m, self.start_m)
        share = along_m / self.length_m
        bend_rad = math.radians(self.bend_deg)
        if not bend_rad:
            return np.asarray(start + chord * along_m / self.length_m)
        toward_rad = math.atan2(chord[1], chord[0]) - 0.5 * bend_rad * (1.0 - share)
        away_m = self.length_m * math.sin(0.5 * bend_rad * share) / (0.5 * bend_rad)
        return np.asarray(start + away_m * np.array([math.cos(toward_rad), math.sin(toward_rad)]))


class Room(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A named area, its corners in order around it."""

    name: str
    floor: str
    corners_m: Annotated[tuple[Point, ...], Meta(min_length=3)]


class Stairs(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A straight flight. ``foot_m`` is the floor before the first riser, ``head_m`` past the last.

    There are ``steps`` risers; the run from foot to head is ``steps`` treads long.
    """

    name: str
    lower_floor: str
    upper_floor: str
    foot_m: Point
    head_m: Point
    steps: Annotated[int, Meta(ge=2, le=60)]

    @property
    def tread_m(self) -> float:
        """Depth of a step."""
        return float(np.hypot(*np.subtract(self.head_m, self.foot_m)) / self.steps)


class Way(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The middle of a corridor, point by point. Ways meet where one has a point on the other."""

    floor: str
    through_m: Annotated[tuple[Point, ...], Meta(min_length=2)]


class Site(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A place where somebody who comes by would set down a DAP."""

    floor: str
    place_m: Point


class Plan(msgspec.Struct, frozen=True, forbid_unknown_fields=True, dict=True):
    """A building. Floors are listed from the lowest up."""

    description: str
    floors: Annotated[tuple[Floor, ...], Meta(min_length=1)]
    walls: tuple[Wall, ...] = ()
    rooms: tuple[Room, ...] = ()
    stairs: tuple[Stairs, ...] = ()
    ways: tuple[Way, ...] = ()
    sites: tuple[Site, ...] = ()

    def __post_init__(self) -> None:
        """Refuse floors out of order and whatever stands on a floor that is not there."""
        heights = [floor.height_m for floor in self.floors]
        if heights != sorted(set(heights)):
            raise ValueError("floors: heights must rise from one floor to the next")
        names = {floor.name for floor in self.floors}
        used = [wall.floor for wall in self.walls] + [room.floor for room in self.rooms]
        used += [way.floor for way in self.ways] + [site.floor for site in self.sites]
        used += [
            name for flight in self.stairs for name in (flight.lower_floor, flight.upper_floor)
        ]
        for name in used:
            if name not in names:
                raise ValueError(f"floor {name!r} is used and not listed under floors")

    def floor_height_m(self, name: str) -> float:
        """Height of the floor called ``name`` above the origin."""
        return self.floors[self._floor_index(name)].height_m

    def flight(self, name: str) -> Stairs:
        """Return the stairs called ``name``; ``ValueError`` if there are none."""
        for stairs in self.stairs:
            if stairs.name == name:
                return stairs
        raise ValueError(f"no stairs {name!r}; there are {[s.name for s in self.stairs]}")

    def floors_of(self, position_m: Array) -> NDArray[np.intp]:
        """Index of the floor that each position (n, 3, NED) stands on; the lowest if below all."""
        heights = np.array([floor.height_m for floor in self.floors])
        found = np.searchsorted(heights, SLAB_TOLERANCE_M - position_m[:, 2], side="right") - 1
        return np.maximum(found, 0)

    def floors_crossed(self, from_m: Array, to_m: Array) -> NDArray[np.intp]:
        """Count the floors between ``from_m`` and ``to_m`` (both (n, 3), NED)."""
        return np.abs(np.subtract(self.floors_of(to_m), self.floors_of(from_m)))

    def walls_crossed(
        self, from_m: Array, to_m: Array, attenuation: Attenuation | None = None
    ) -> NDArray[np.intp]:
        """Count the walls that each straight line from ``from_m`` to ``to_m`` meets.

        Both are (n, 3) NED. A wall is met where the line, at its height there, is on the wall's
        own floor; with ``attenuation``, only walls of that class are counted.
        """
        starts, ends, floors, classes = self._solid_walls
        if attenuation is not None:
            chosen = classes == attenuation
            starts, ends, floors = starts[chosen], ends[chosen], floors[chosen]
        along = (to_m - from_m)[:, None, :]
        wall = (ends - starts)[None]
        gap = starts[None] - from_m[:, None, :2]
        with np.errstate(divide="ignore", invalid="ignore"):
            determinant = _cross(along[..., :2], wall)
            on_line = _cross(gap, wall) / determinant
            on_wall = _cross(gap, along[..., :2]) / determinant
        met = (on_line > 0.0) & (on_line < 1.0) & (on_wall >= 0.0) & (on_wall <= 1.0)
        line, hit = np.nonzero(met)
        where_m = from_m[line] + (to_m - from_m)[line] * on_line[line, hit][:, None]
        same_floor = self.floors_of(where_m) == floors[hit]
        return np.bincount(line[same_floor], minlength=len(from_m))

    def doors_m(self, floor: str) -> Array:
        """Middles (d, 2) of all doors on ``floor``."""
        middles = [
            wall.at(door.at_m) for wall in self.walls if wall.floor == floor for door in wall.doors
        ]
        return np.array(middles).reshape(-1, 2)

    @property
    def wall_pieces_m(self) -> Array:
        """Both ends (w, 2, 2: north, east) of each stretch of wall between doors, to be drawn."""
        starts, ends, _, _ = self._solid_walls
        return np.stack([starts, ends], axis=1)

    @cached_property
    def _solid_walls(self) -> tuple[Array, Array, NDArray[np.intp], NDArray[np.str_]]:
        """Wall pieces between doors: starts (w, 2), ends (w, 2), floor indices and classes (w,)."""
        pieces = [(piece, wall) for wall in self.walls for piece in _pieces(wall)]
        return (
            np.array([piece[0] for piece, _ in pieces]).reshape(-1, 2),
            np.array([piece[1] for piece, _ in pieces]).reshape(-1, 2),
            np.array([self._floor_index(wall.floor) for _, wall in pieces], dtype=np.intp),
            np.array([wall.attenuation for _, wall in pieces], dtype=np.str_),
        )

    def _floor_index(self, name: str) -> int:
        return [floor.name for floor in self.floors].index(name)


def load_plan(name_or_path: str) -> Plan:
    """Return the packaged plan of that name, or the one in the TOML file at that path.

    Raises ``shared.config.ConfigError`` if there is none or it cannot be used.
    """
    return _load(packaged_or_path(name_or_path, PLANS))


def packaged_or_path(name_or_path: str, folder: Path) -> Path:
    """Return the path of ``folder``'s file called so, without its suffix; else the path itself.

    Raises ``ConfigError``, naming what is packaged, for a bare name that is not.
    """
    packaged = {path.stem: path for path in folder.glob("*.toml")}
    if name_or_path not in packaged and Path(name_or_path).suffix != ".toml":
        known = ", ".join(sorted(packaged))
        raise ConfigError(
            f"{name_or_path or repr('')}: not packaged; use {known}, or the path of a TOML file"
        )
    return packaged.get(name_or_path, Path(name_or_path))


@cache
def _load(path: Path) -> Plan:
    return load_toml(path, Plan)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _pieces(wall: Wall) -> list[tuple[Array, Array]]:
    """Return the start and end of each straight stretch of ``wall`` between its doors."""
    doors = sorted(wall.doors, key=lambda door: door.at_m)
    edges = [0.0]
    for door in doors:
        edges += [door.at_m - door.width_m / 2.0, door.at_m + door.width_m / 2.0]
    edges.append(wall.length_m)
    pieces = []
    for start_m, end_m in zip(edges[::2], edges[1::2], strict=True):
        if end_m > start_m:
            count = math.ceil((end_m - start_m) / CHORD_M) if wall.bend_deg else 1
            points = [wall.at(along_m) for along_m in np.linspace(start_m, end_m, count + 1)]
            pieces += list(pairwise(points))
    return pieces
