"""Where a search leads: rooms drawn by chance, the corridors between them, the way round inside.

A route may have legs that say only what is to be done; here they become points to walk through.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.simulation.corridors import Corridors, Entrance, Place, inside, outline_distance_m
from shared.simulation.legs import Climb, Go, Leg, LevelGait, Move, PlainLeg, Ride, Search, Stand
from shared.simulation.plan import Plan, Point, Room
from shared.simulation.scenario import Responder

Array: TypeAlias = NDArray[np.float64]

ALONG_WALL_M = 0.8
"""How far from the wall somebody walks who follows it."""
MOST_DRAWS = 1000
SAME_CORNER_M = 1e-3
"""An outline that ends where it began, or rests at a corner, has one there."""
STRAIGHT_SINE = 1e-3


def plain_legs(plan: Plan, responder: Responder, chance: np.random.Generator) -> list[PlainLeg]:
    """Return the responder's legs, those drawn by chance spelled out.

    Raises ``ValueError`` where the building has no way, or no room, to go to.
    """
    planner = _Planner(plan, Place(responder.floor, *responder.start_m), chance)
    return [plain for leg in responder.route for plain in planner.plain(leg)]


def wall_round(room: Room, aside_m: float = ALONG_WALL_M) -> Array:
    """Return the corners (n, 2) of a way along the walls of a room, ``aside_m`` from them.

    It goes round as the room's outline does. Where that goes straight on there is no corner.
    """
    outline = np.array(room.corners_m)
    outline = outline[_apart_m(outline) > SAME_CORNER_M]
    corners = outline[np.abs(_turn_sines(outline)) > STRAIGHT_SINE]
    along = _directions(corners)
    before = np.roll(along, 1, axis=0)
    # Two sides moved inward by one unit meet in the corner moved so: towards both, against both.
    sine = _turn_sines(corners)
    turns = np.sign(np.sum(np.arctan2(sine, np.sum(before * along, axis=1))))
    return np.asarray(corners + aside_m * turns * (along - before) / sine[:, None])


def _apart_m(corners: Array) -> Array:
    """Return how far each corner (n, 2) is from the next."""
    return np.asarray(np.hypot(*(np.roll(corners, -1, axis=0) - corners).T))


def _directions(corners: Array) -> Array:
    """Return the direction (n, 2) from each corner to the next, of length 1."""
    return np.asarray((np.roll(corners, -1, axis=0) - corners) / _apart_m(corners)[:, None])


def _turn_sines(corners: Array) -> Array:
    """Return the sine (n,) of the turn that an outline makes at each of its corners."""
    along = _directions(corners)
    before = np.roll(along, 1, axis=0)
    return np.asarray(before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0])


@lru_cache(maxsize=8)
def corridors_of(plan: Plan) -> Corridors:
    """Return the corridors of ``plan``, worked out once."""
    return Corridors(plan)


class _Planner:
    """Spells legs out one after another, and keeps where they have led."""

    def __init__(self, plan: Plan, here: Place, chance: np.random.Generator) -> None:
        self._plan = plan
        self._here = here
        self._chance = chance

    def plain(self, leg: Leg) -> Iterator[PlainLeg]:
        """Yield what ``leg`` comes to."""
        match leg:
            case Search():
                yield from self._search(leg)
            case Go():
                floor = leg.floor or self._here.floor
                yield from self._walk(corridors_of(self._plan).nearest(floor, leg.to_m), leg.gait)
                yield self._move(leg.gait, leg.to_m)
            case Climb():
                self._climb(leg)
                yield leg
            case Move():
                self._here = self._here._replace(north_m=leg.to_m[-1][0], east_m=leg.to_m[-1][1])
                yield leg
            case Ride():
                self._here = self._here._replace(floor=leg.to_floor)
                yield leg
            case Stand():
                yield leg

    def _search(self, leg: Search) -> Iterator[PlainLeg]:
        corridors = corridors_of(self._plan)
        start = corridors.nearest(self._here.floor, self._here.point_m)
        for entrance in self._drawn_rooms(leg, corridors):
            yield from self._walk(entrance.place, leg.way_gait)
            yield from self._visit(leg, entrance)
            if self._chance.random() < leg.detours:
                turns = corridors.turns(self._here.floor)
                yield from self._walk(turns[self._chance.integers(len(turns))], leg.way_gait)
        if self._chance.random() < leg.returns:
            yield from self._walk(start, leg.way_gait)

    def _drawn_rooms(self, leg: Search, corridors: Corridors) -> list[Entrance]:
        """Draw rooms, each at most once, and one of the doors of each."""
        floors = leg.floors or tuple(floor.name for floor in self._plan.floors)
        doors: dict[tuple[str, str], list[Entrance]] = {}
        for entrance in corridors.entrances:
            room = entrance.room
            if room.floor in floors:
                # Floors may count their rooms alike.
                doors.setdefault((room.name, room.floor), []).append(entrance)
        if not doors:
            raise ValueError(f"no room with a door to a way on the floors {list(floors)}")
        names = sorted(doors)
        count = min(int(self._chance.integers(leg.rooms[0], leg.rooms[1] + 1)), len(names))
        chosen = [names[index] for index in self._chance.permutation(len(names))[:count]]
        return [doors[name][self._chance.integers(len(doors[name]))] for name in chosen]

    def _walk(self, end: Place, gait: LevelGait) -> Iterator[PlainLeg]:
        """Go by the corridors, and by the stairs between floors."""
        corridors = corridors_of(self._plan)
        start = corridors.nearest(self._here.floor, self._here.point_m)
        points = [start.point_m]
        for place, stairs in corridors.path(start, end):
            if stairs is None:
                points.append(place.point_m)
                continue
            yield self._move(gait, *points)
            yield Climb(stairs)
            points = []
            self._here = place
        if points:
            yield self._move(gait, *points)
        self._here = end

    def _visit(self, leg: Search, entrance: Entrance) -> Iterator[PlainLeg]:
        door_m = np.array(entrance.door_m)
        inward = door_m - entrance.place.point_m
        within = _point(door_m + ALONG_WALL_M * inward / np.hypot(*inward))
        yield self._move(leg.way_gait, entrance.door_m, within, exact=True)
        draw = self._wall_points if leg.pattern == "wall" else self._free_points
        yield self._move(leg.gait, *map(_point, draw(leg, entrance)))
        yield self._move(leg.gait, within, exact=True)
        stand_s = float(self._chance.uniform(*leg.stand_s))
        if stand_s > 0.0:
            yield Stand(stand_s)
        yield self._move(leg.way_gait, entrance.door_m, entrance.place.point_m, exact=True)

    def _wall_points(self, _leg: Search, entrance: Entrance) -> Array:
        """Round the room from the corner nearest the door, left or right."""
        corners = wall_round(entrance.room)
        first = int(np.argmin(np.hypot(*(corners - entrance.door_m).T)))
        turn = -1 if self._chance.random() < 0.5 else 1
        return np.asarray(corners[(first + turn * np.arange(len(corners))) % len(corners)])

    def _free_points(self, leg: Search, entrance: Entrance) -> Array:
        """Points anywhere in the room."""
        room = entrance.room
        low, high = np.min(room.corners_m, axis=0), np.max(room.corners_m, axis=0)
        wanted = int(self._chance.integers(leg.points[0], leg.points[1] + 1))
        points: list[Array] = []
        for _ in range(MOST_DRAWS):
            point_m = self._chance.uniform(low, high)
            if inside(room, point_m) and outline_distance_m(room, point_m) > ALONG_WALL_M:
                points.append(point_m)
            if len(points) == wanted:
                return np.array(points)
        raise ValueError(
            f"room {room.name!r} is too small to wander in; let it be searched by wall"
        )

    def _move(self, gait: LevelGait, *to_m: Point, exact: bool = False) -> Move:
        self._here = self._here._replace(north_m=to_m[-1][0], east_m=to_m[-1][1])
        return Move(gait, to_m, exact)

    def _climb(self, leg: Climb) -> None:
        flight = self._plan.flight(leg.stairs)
        foot = Place(flight.lower_floor, *flight.foot_m)
        head = Place(flight.upper_floor, *flight.head_m)
        self._here = head if self._here.floor == flight.lower_floor else foot


def _point(point_m: Array) -> Point:
    return float(point_m[0]), float(point_m[1])
