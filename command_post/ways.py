"""Ways out, and to who is down, along what crews have walked (pure).

Nobody has a plan: where somebody went, somebody can go. Places that were held to be reached are
joined as the track map joins them; a place that an estimate leapt to, as a DAP corrected it, is not
joined to the one before. The shortest way is by time: stairs take longer than a corridor.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterable, Sequence
from typing import Literal, TypeAlias

import msgspec

from command_post.floors import APART_M
from command_post.fusion.track_map import JOIN_DOWN_M, SPACING_M, STEEP, Places
from shared.maths.angles import wrap_rad
from shared.messages import NodeId

Point: TypeAlias = tuple[float, float, float]
"""North, east and down, m."""

Turn: TypeAlias = Literal["on", "left", "right", "around", "upstairs", "downstairs"]

LEAP_M = 3.0
"""Further than a stride: an estimate that was corrected, no way that anybody went."""

REACH_M = 6.0
"""Somebody is at most so far from where somebody walked."""

WALK_M_S = 1.0
CRAWL_M_S = 0.35
STAIRS_SLOWER = 2.0
STRAIGHT_M = 1.0
"""A way that bends by less is straight."""

LANDING_M = 4.0
"""So long a level stretch between two flights the same way is their landing."""

TURNS_RAD = math.radians(35.0)
AROUND_RAD = math.radians(135.0)


class Leg(msgspec.Struct, frozen=True):
    """A stretch of a way: turn so, then go so far."""

    turn: Turn
    length_m: float


class Way(msgspec.Struct, frozen=True):
    """From ``places_m``'s first to its last; how long it takes walking, and crawling."""

    places_m: tuple[Point, ...]
    length_m: float
    walk_s: float
    crawl_s: float
    legs: tuple[Leg, ...]


class WalkedGround:
    """The graph of what was walked so far; grows place by place as estimates come."""

    def __init__(self) -> None:
        # A post that nobody asks for ways is back the sooner for not loading it.
        import networkx as nx  # noqa: PLC0415

        self._places = Places()
        self._graph = nx.Graph()
        self._search = nx.single_source_dijkstra
        self._last: dict[NodeId, tuple[int, Point]] = {}
        self._entrances: list[int] = []

    def walk(self, responder_id: NodeId, time_s: float, place_m: Point) -> None:
        """Take in that somebody is at ``place_m``, where they came from where they were last."""
        before = self._last.get(responder_id)
        steps = [place_m] if before is None else _between(before[1], place_m)
        number = -1 if before is None else before[0]
        for step in steps:
            reached = self._places.at(step)
            if reached == number:
                continue
            self._places.made[reached].visit(step, responder_id, time_s)
            self._graph.add_node(reached)
            if number >= 0 and math.dist(before[1] if before else step, place_m) <= LEAP_M:
                self._graph.add_edge(number, reached)
            number = reached
        if before is None:
            self._entrances.append(number)
        self._last[responder_id] = (number, place_m)

    def way_out(self, place_m: Point, heading_rad: float | None = None) -> Way | None:
        """Return the quickest way from ``place_m`` to where somebody came in, if there is one."""
        return self._way(place_m, self._entrances, heading_rad)

    def quickest(
        self, goal_m: Point, rescuers: Iterable[tuple[NodeId, Point, float | None]]
    ) -> tuple[NodeId, Way] | None:
        """Return who of ``rescuers`` (id, place, heading) is soonest at ``goal_m``, and their way.

        A way takes as long in either direction: all are found in one search, from its end.
        """
        goal = self._nearest(goal_m)
        if goal is None:
            return None
        seconds, paths = self._search(self._graph, goal, weight=self._seconds)
        found = []
        for name, place_m, heading_rad in rescuers:
            start = self._nearest(place_m)
            if start is not None and start in seconds:
                walk_s = seconds[start] + _walk_s(place_m, self._places.made[start].place_m)
                found.append((walk_s, name, start, place_m, heading_rad))
        if not found:
            return None
        _, name, start, place_m, heading_rad = min(found, key=lambda each: each[0])
        return name, self._along(place_m, reversed(paths[start]), heading_rad)

    def _way(self, place_m: Point, goals: Collection[int], heading_rad: float | None) -> Way | None:
        start = self._nearest(place_m)
        if start is None:
            return None
        seconds, paths = self._search(self._graph, start, weight=self._seconds)
        reached = [goal for goal in goals if goal in seconds]
        if not reached:
            return None
        goal = min(reached, key=lambda each: seconds[each])
        return self._along(place_m, paths[goal], heading_rad)

    def _along(self, place_m: Point, path: Iterable[int], heading_rad: float | None) -> Way:
        return _told([place_m, *(self._places.made[each].place_m for each in path)], heading_rad)

    def _nearest(self, place_m: Point) -> int | None:
        """Return the walked place nearest to one, of the same storey if there is such."""

        def off_m(number: int) -> float:
            there_m = self._places.made[number].place_m
            apart_m = math.hypot(there_m[0] - place_m[0], there_m[1] - place_m[1])
            storeys = abs(there_m[2] - place_m[2]) / JOIN_DOWN_M
            return apart_m + (REACH_M if storeys > 1.0 else 0.0) * storeys

        if not self._graph:
            return None
        best: int = min(self._graph, key=off_m)
        return best if off_m(best) <= REACH_M else None

    def _seconds(self, one: int, other: int, _edge: object) -> float:
        a, b = self._places.made[one].place_m, self._places.made[other].place_m
        return _walk_s(a, b)


def _between(start_m: Point, end_m: Point) -> list[Point]:
    """Return places from behind ``start_m`` to ``end_m``, none jumped over."""
    count = max(1, math.ceil(math.dist(start_m, end_m) / SPACING_M))
    if math.dist(start_m, end_m) > LEAP_M:
        return [end_m]
    return [
        (
            start_m[0] + (end_m[0] - start_m[0]) * step / count,
            start_m[1] + (end_m[1] - start_m[1]) * step / count,
            start_m[2] + (end_m[2] - start_m[2]) * step / count,
        )
        for step in range(1, count + 1)
    ]


def _is_steep(a: Point, b: Point) -> bool:
    return abs(a[2] - b[2]) > STEEP * math.dist(a, b)


def _walk_s(a: Point, b: Point) -> float:
    return math.dist(a, b) / WALK_M_S * (STAIRS_SLOWER if _is_steep(a, b) else 1.0)


def _told(places_m: Sequence[Point], heading_rad: float | None) -> Way:
    pairs = list(itertools.pairwise(places_m))
    walk_s = sum(_walk_s(a, b) for a, b in pairs)
    return Way(
        places_m=tuple(places_m),
        length_m=sum(math.dist(a, b) for a, b in pairs),
        walk_s=walk_s,
        crawl_s=walk_s * WALK_M_S / CRAWL_M_S,
        legs=tuple(_legs(_levelled(places_m), heading_rad)),
    )


def _corners(places_m: Sequence[Point], first: int, last: int) -> list[int]:
    """Return which places of a way are its corners (Ramer, Douglas and Peucker), level or not."""
    if last - first < 2:
        return [first, last]
    start, end = places_m[first], places_m[last]
    offs_m = [_off_line_m(place, start, end) for place in places_m[first + 1 : last]]
    most_m = max(offs_m)
    if most_m <= STRAIGHT_M:
        return [first, last]
    corner = first + 1 + offs_m.index(most_m)
    return _corners(places_m, first, corner)[:-1] + _corners(places_m, corner, last)


def _off_line_m(place: Point, start: Point, end: Point) -> float:
    length_m = math.dist(start, end)
    if length_m == 0.0:
        return math.dist(place, start)
    along = sum((p - s) * (e - s) for p, s, e in zip(place, start, end, strict=True)) / length_m**2
    along = min(max(along, 0.0), 1.0)
    foot = [s + along * (e - s) for s, e in zip(start, end, strict=True)]
    return math.dist(place, foot)


def _climbs(places_m: Sequence[Point], corners: Sequence[int]) -> list[tuple[int, int]]:
    """Return from where to where a way goes up or down to another storey, landings included.

    Tracks of one storey are held to be at heights that differ: a step between two is no stair.
    """
    runs: list[tuple[int, int]] = []
    for a, b in itertools.pairwise(corners):
        if not _is_steep(places_m[a], places_m[b]):
            continue
        if runs and _goes_on(places_m, runs[-1], (a, b)):
            runs[-1] = (runs[-1][0], b)
        else:
            runs.append((a, b))
    return [(a, b) for a, b in runs if abs(places_m[b][2] - places_m[a][2]) > APART_M]


def _goes_on(places_m: Sequence[Point], run: tuple[int, int], piece: tuple[int, int]) -> bool:
    """Whether a steep piece goes the same way as the run before it, and soon after it."""
    (a, b), (c, d) = run, piece
    rises = (places_m[b][2] - places_m[a][2]) * (places_m[d][2] - places_m[c][2]) > 0.0
    between = itertools.pairwise(places_m[b : c + 1])
    return rises and sum(math.dist(one, other) for one, other in between) <= LANDING_M


def _levelled(places_m: Sequence[Point]) -> list[Point]:
    """Return a way that changes its height on stairs alone."""
    climbs = _climbs(places_m, _corners(places_m, 0, len(places_m) - 1))
    on_stairs = {number for a, b in climbs for number in range(a + 1, b + 1)}
    down_m = places_m[0][2]
    level_m = []
    for number, (north_m, east_m, _) in enumerate(places_m):
        if number in on_stairs:
            down_m += places_m[number][2] - places_m[number - 1][2]
        level_m.append((north_m, east_m, down_m))
    return level_m


def _legs(places_m: Sequence[Point], heading_rad: float | None) -> list[Leg]:
    """Return the legs of a way that is levelled; a stair with its landings is one."""
    corners = _corners(places_m, 0, len(places_m) - 1)
    climbs = dict(_climbs(places_m, corners))
    legs: list[Leg] = []
    facing_rad, at = heading_rad, 0
    while at < len(corners) - 1:
        first = corners[at]
        last = climbs.get(first, corners[at + 1])
        stops = corners[at : corners.index(last) + 1]
        a, b = places_m[stops[-2]], places_m[last]
        bearing_rad = math.atan2(b[1] - a[1], b[0] - a[0])
        length_m = sum(math.dist(places_m[i], places_m[j]) for i, j in itertools.pairwise(stops))
        if first in climbs:
            rises = places_m[last][2] < places_m[first][2]
            legs.append(Leg("upstairs" if rises else "downstairs", length_m))
        else:
            turn = _turn(facing_rad, bearing_rad)
            if turn == "on" and legs and legs[-1].turn not in ("upstairs", "downstairs"):
                legs[-1] = Leg(legs[-1].turn, legs[-1].length_m + length_m)
            else:
                legs.append(Leg(turn, length_m))
        facing_rad, at = bearing_rad, at + len(stops) - 1
    return legs


def _turn(facing_rad: float | None, bearing_rad: float) -> Turn:
    turned_rad = 0.0 if facing_rad is None else wrap_rad(bearing_rad - facing_rad)
    if abs(turned_rad) >= AROUND_RAD:
        return "around"
    if abs(turned_rad) <= TURNS_RAD:
        return "on"
    return "right" if turned_rad > 0.0 else "left"
