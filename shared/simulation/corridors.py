"""Which way one walks in a building: its corridors as a graph, with their doors and stairs."""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.maths.polygons import inside_polygon
from shared.simulation.plan import Plan, Point, Room, Stairs

Array: TypeAlias = NDArray[np.float64]

ON_LINE_M = 0.02
DOOR_IN_WALL_M = 0.3
"""A room's outline may run so far from the middle of the wall that its door is in."""
DOOR_TO_WAY_M = 8.0


class Place(NamedTuple):
    """A point of the graph: north and east in metres, on a floor."""

    floor: str
    north_m: float
    east_m: float

    @property
    def point_m(self) -> Point:
        """North and east."""
        return self.north_m, self.east_m


class Entrance(NamedTuple):
    """How one gets into a room: from ``place`` on a way through the middle of a door."""

    room: Room
    place: Place
    door_m: Point


class Corridors:
    """The ways, flights of stairs and room doors of a building."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._segments = [
            (way.floor, np.array(start), np.array(end))
            for way in plan.ways
            for start, end in pairwise(way.through_m)
            if start != end
        ]
        self.entrances = list(self._find_entrances())
        self._next: defaultdict[Place, dict[Place, str | None]] = defaultdict(dict)
        self._join_ways()
        self._join_stairs()

    def nearest(self, floor: str, point_m: Point) -> Place:
        """Return the place of the graph on ``floor`` that is nearest to ``point_m``.

        Raises ``ValueError`` if no way is on that floor.
        """
        there = [place for place in self._next if place.floor == floor]
        if not there:
            raise ValueError(f"floor {floor!r} has no ways to walk on; list some in the plan")
        return min(there, key=lambda place: float(np.hypot(*np.subtract(place[1:], point_m))))

    def turns(self, floor: str) -> list[Place]:
        """Return where ways of ``floor`` end, cross or turn, in the order of the plan."""
        points = [
            Place(floor, *_rounded(point))
            for way in self._plan.ways
            if way.floor == floor
            for point in way.through_m
        ]
        return list(dict.fromkeys(points))

    def path(self, start: Place, end: Place) -> list[tuple[Place, str | None]]:
        """Return the shortest path, each place with the stairs that lead to it, if stairs do.

        ``start`` is left out. Dijkstra's algorithm; among equals the first in order of places.
        Raises ``ValueError`` if there is none.
        """
        reached: dict[Place, Place] = {}
        length_m = {start: 0.0}
        open_places = [(0.0, start)]
        while open_places:
            way_m, here = heapq.heappop(open_places)
            if here == end:
                return self._steps_to(end, start, reached)
            if way_m > length_m[here]:
                continue
            for there in self._next[here]:
                further_m = way_m + float(np.hypot(*np.subtract(there[1:], here[1:])))
                if further_m < length_m.get(there, np.inf):
                    length_m[there], reached[there] = further_m, here
                    heapq.heappush(open_places, (further_m, there))
        raise ValueError(f"no way leads from {start} to {end}; join the plan's ways and stairs")

    def _steps_to(
        self, end: Place, start: Place, reached: dict[Place, Place]
    ) -> list[tuple[Place, str | None]]:
        steps = []
        while end != start:
            before = reached[end]
            steps.append((end, self._next[before][end]))
            end = before
        return steps[::-1]

    def _find_entrances(self) -> Iterator[Entrance]:
        for room in self._plan.rooms:
            for door_m in self._plan.doors_m(room.floor):
                if outline_distance_m(room, door_m) < DOOR_IN_WALL_M:
                    foot_m = self._foot(room, door_m)
                    if foot_m is not None:
                        place = Place(room.floor, *_rounded(foot_m))
                        yield Entrance(room, place, (float(door_m[0]), float(door_m[1])))

    def _foot(self, room: Room, door_m: Array) -> Array | None:
        """Return the nearest point of a way that one sees from the door, outside the room."""
        feet = [_nearest_on(door_m, a, b) for floor, a, b in self._segments if floor == room.floor]
        for foot_m in sorted(feet, key=lambda foot: float(np.hypot(*(foot - door_m)))):
            if np.hypot(*(foot_m - door_m)) > DOOR_TO_WAY_M or inside(room, foot_m):
                return None
            height_m = self._plan.floor_height_m(room.floor)
            both = np.column_stack([np.array([door_m, foot_m]), np.full(2, -height_m - 1.0)])
            if not self._plan.walls_crossed(both[:1], both[1:])[0]:
                return foot_m
        return None

    def _join_ways(self) -> None:
        """Join what lies on each stretch of a way, one to the next along it."""
        places = [entrance.place for entrance in self.entrances]
        for floor, start_m, end_m in self._segments:
            places += [Place(floor, *_rounded(start_m)), Place(floor, *_rounded(end_m))]
        for flight in self._plan.stairs:
            places += _ends(flight)
        for floor, start_m, end_m in self._segments:
            along = {
                place: float(np.hypot(*np.subtract(place.point_m, start_m)))
                for place in places
                if place.floor == floor and _away_m(place.point_m, start_m, end_m) < ON_LINE_M
            }
            for one, other in pairwise(sorted(along, key=along.__getitem__)):
                self._next[one][other] = self._next[other][one] = None

    def _join_stairs(self) -> None:
        for flight in self._plan.stairs:
            foot, head = _ends(flight)
            self._next[foot][head] = self._next[head][foot] = flight.name


def inside(room: Room, point_m: Array) -> bool:
    """Say whether ``point_m`` (2,) is inside the room's outline."""
    return bool(inside_polygon([point_m], room.corners_m)[0])


def outline_distance_m(room: Room, point_m: Array) -> float:
    """Return how far ``point_m`` (2,) is from the room's outline."""
    corners = np.array(room.corners_m)
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    return min(_away_m(point_m, start_m, end_m) for start_m, end_m in sides)


def _ends(flight: Stairs) -> tuple[Place, Place]:
    """Return the foot and the head of a flight."""
    return (
        Place(flight.lower_floor, *_rounded(flight.foot_m)),
        Place(flight.upper_floor, *_rounded(flight.head_m)),
    )


def _away_m(point_m: Array | Point, start_m: Array, end_m: Array) -> float:
    return float(np.hypot(*(_nearest_on(point_m, start_m, end_m) - point_m)))


def _nearest_on(point_m: Array | Point, start_m: Array, end_m: Array) -> Array:
    along = end_m - start_m
    share = np.dot(np.subtract(point_m, start_m), along) / np.dot(along, along)
    return np.asarray(start_m + np.clip(share, 0.0, 1.0) * along)


def _rounded(point_m: Array | Point) -> Point:
    return round(float(point_m[0]), 3), round(float(point_m[1]), 3)
