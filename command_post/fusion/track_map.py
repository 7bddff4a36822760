"""The map that crews make by walking: where ways are, how often they were gone, and when last.

Places that were reached are joined into nodes a metre or so apart, storey by storey; from node to
node goes an edge for each pair that somebody went between. Ways out and to each other are found on
it later, without any plan of the building. Pure: smoothed tracks in, a graph out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Literal, TypeAlias

import msgspec
import numpy as np

from command_post.fusion.interface import SmoothedTrack

if TYPE_CHECKING:
    import networkx as nx

JOIN_M = 1.2
"""Places nearer than this, on one storey, are one."""

JOIN_DOWN_M = 1.0
SPACING_M = 0.6
"""Long strides are walked through in steps of this, so that no node is jumped."""

STEEP = 0.25
"""A way that rises more than this share of its length is a stair or a ladder, on foot a lift."""

LARGEST_ROOM_SHARE = 0.5

PlaceKind: TypeAlias = Literal["way", "stairs", "room"]


class MapNode(msgspec.Struct, frozen=True):
    """A place: north, east, down (m), what it belongs to, visits, and the last of them (s)."""

    number: int
    north_m: float
    east_m: float
    down_m: float
    kind: PlaceKind
    visits: int
    last_s: float
    responders: tuple[str, ...]


class MapEdge(msgspec.Struct, frozen=True):
    """A way that was gone between two nodes, in either direction."""

    one: int
    other: int
    length_m: float
    passes: int
    last_s: float


class TrackMap(msgspec.Struct, frozen=True):
    """The walked graph of all crews."""

    nodes: tuple[MapNode, ...]
    edges: tuple[MapEdge, ...]

    def graph(self) -> nx.Graph:
        """Return it as a graph whose nodes are numbers and whose edges weigh their length in m."""
        # Ways that are asked for while an exercise lasts use none of it.
        import networkx as nx  # noqa: PLC0415

        graph = nx.Graph()
        graph.add_nodes_from(node.number for node in self.nodes)
        graph.add_weighted_edges_from(
            [(edge.one, edge.other, edge.length_m) for edge in self.edges], weight="length_m"
        )
        return graph


class Place:
    """A node in the making."""

    def __init__(self, place_m: tuple[float, float, float]) -> None:
        self.place_m = place_m
        self.visits = 0
        self.last_s = -math.inf
        self.responders: set[str] = set()

    def visit(self, place_m: tuple[float, float, float], responder_id: str, time_s: float) -> None:
        """Somebody came by; the node stands at the mean of where they did."""
        self.visits += 1
        share = 1.0 / self.visits
        self.place_m = (
            self.place_m[0] + share * (place_m[0] - self.place_m[0]),
            self.place_m[1] + share * (place_m[1] - self.place_m[1]),
            self.place_m[2] + share * (place_m[2] - self.place_m[2]),
        )
        self.last_s = max(self.last_s, time_s)
        self.responders.add(responder_id)


class Places:
    """All nodes in the making, found by the cell of a grid that they began in."""

    def __init__(self) -> None:
        self.made: list[Place] = []
        self._cells: dict[tuple[int, int, int], list[int]] = {}

    def at(self, place_m: tuple[float, float, float]) -> int:
        """Return the number of the nearest node close enough, made anew if there is none."""
        cell = self._cell(place_m)
        best, best_m = -1, JOIN_M
        for number in self._around(cell):
            there_m = self.made[number].place_m
            apart_m = math.hypot(there_m[0] - place_m[0], there_m[1] - place_m[1])
            if apart_m < best_m and abs(there_m[2] - place_m[2]) < JOIN_DOWN_M:
                best, best_m = number, apart_m
        if best < 0:
            best = len(self.made)
            self.made.append(Place(place_m))
            self._cells.setdefault(cell, []).append(best)
        return best

    def _around(self, cell: tuple[int, int, int]) -> Iterator[int]:
        for north in range(-1, 2):
            for east in range(-1, 2):
                for down in range(-1, 2):
                    near = (cell[0] + north, cell[1] + east, cell[2] + down)
                    yield from self._cells.get(near, ())

    @staticmethod
    def _cell(place_m: tuple[float, float, float]) -> tuple[int, int, int]:
        # Nodes wander to the mean of their visits: cells are wide enough that one stays next door.
        return (
            math.floor(place_m[0] / (2.0 * JOIN_M)),
            math.floor(place_m[1] / (2.0 * JOIN_M)),
            math.floor(place_m[2] / (2.0 * JOIN_DOWN_M)),
        )


def map_of(tracks: Mapping[str, SmoothedTrack]) -> TrackMap:
    """Return the walked graph of ``tracks`` by responder; the same for any order of them."""
    places = Places()
    edges: dict[tuple[int, int], list[float]] = {}
    for responder_id in sorted(tracks):
        before: int | None = None
        for time_s, place_m in _walked(tracks[responder_id]):
            number = places.at(place_m)
            if number == before:
                continue
            places.made[number].visit(place_m, responder_id, time_s)
            if before is not None:
                edges.setdefault((min(before, number), max(before, number)), []).append(time_s)
            before = number
    ways = tuple(
        MapEdge(one, other, _apart_m(places.made[one], places.made[other]), len(times), max(times))
        for (one, other), times in sorted(edges.items())
    )
    kinds = _kinds(places.made, ways)
    nodes = tuple(
        MapNode(
            number, *place.place_m, kinds[number], place.visits, place.last_s,
            tuple(sorted(place.responders)),
        )
        for number, place in enumerate(places.made)
    )  # fmt: skip
    return TrackMap(nodes, ways)


def _walked(track: SmoothedTrack) -> Iterator[tuple[float, tuple[float, float, float]]]:
    """Yield times and places along a track, none further apart than ``SPACING_M``."""
    step_m = np.diff(track.position_m, axis=0)
    for index, (north, east, down) in enumerate(step_m.tolist()):
        count = max(1, math.ceil(math.sqrt(north * north + east * east) / SPACING_M))
        start_m, start_s = track.position_m[index].tolist(), float(track.time_s[index])
        lasted_s = float(track.time_s[index + 1]) - start_s
        for each in range(1, count + 1):
            share = each / count
            yield (
                start_s + share * lasted_s,
                (
                    start_m[0] + share * north,
                    start_m[1] + share * east,
                    start_m[2] + share * down,
                ),
            )


def _apart_m(one: Place, other: Place) -> float:
    return math.dist(one.place_m, other.place_m)


def _kinds(places: list[Place], ways: Iterable[MapEdge]) -> list[PlaceKind]:
    """Tell stairs by their slope; and rooms, which can be left by one doorway only."""
    import networkx as nx  # noqa: PLC0415

    kinds: list[PlaceKind] = ["way"] * len(places)
    graph = nx.Graph()
    graph.add_nodes_from(range(len(places)))
    for way in ways:
        graph.add_edge(way.one, way.other)
        rise_m = abs(places[way.one].place_m[2] - places[way.other].place_m[2])
        if rise_m > STEEP * way.length_m:
            kinds[way.one] = kinds[way.other] = "stairs"
    doorways = set(nx.articulation_points(graph))
    for block in nx.biconnected_components(graph):
        inside = block - doorways
        # Walked all round, and joined to the rest at one point: a room, if it is not the house.
        is_leaf = len(block & doorways) == 1 and len(block) > 3
        if is_leaf and len(block) <= LARGEST_ROOM_SHARE * len(places):
            for number in inside:
                if kinds[number] == "way":
                    kinds[number] = "room"
    return kinds
