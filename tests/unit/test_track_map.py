"""The map that crews make by walking."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest

from command_post.fusion.interface import SmoothedTrack
from command_post.fusion.track_map import map_of


def track(*corners_m: tuple[float, float, float], from_s: float = 0.0) -> SmoothedTrack:
    """Return a track through corners, a stance every 1.2 m or so and second."""
    places = [np.array(corners_m[0])]
    for corner_m in corners_m[1:]:
        leg_m = np.array(corner_m) - places[-1]
        count = max(1, round(float(np.linalg.norm(leg_m)) / 1.2))
        begin_m = places[-1]
        places += [begin_m + leg_m * (k + 1) / count for k in range(count)]
    time_s = from_s + np.arange(len(places), dtype=float)
    return SmoothedTrack(time_s, np.array(places), np.zeros((len(places), 3)))


def test_a_way_gone_twice_is_one_way() -> None:
    there = track((0, 0, 0), (20, 0, 0))
    back = track((20, 0.3, 0), (0, 0.3, 0), from_s=100.0)
    walked = map_of({"r1": there, "r2": back})
    assert 12 <= len(walked.nodes) <= 22
    graph = walked.graph()
    assert nx.is_connected(graph)
    by_north = sorted(walked.nodes, key=lambda node: node.north_m)
    ends = by_north[0].number, by_north[-1].number
    length_m = nx.shortest_path_length(graph, *ends, weight="length_m")
    assert length_m == pytest.approx(20.0, abs=2.5)
    both = [node for node in walked.nodes if node.responders == ("r1", "r2")]
    assert len(both) > 0.7 * len(walked.nodes)
    assert max(edge.passes for edge in walked.edges) == 2
    assert max(node.last_s for node in walked.nodes) == pytest.approx(117.0, abs=1.0)


def test_storeys_are_joined_by_stairs_alone() -> None:
    up = track((0, 0, 0), (6, 0, 0), (10, 0, -3), (4, 0, -3))
    walked = map_of({"r1": up})
    kinds = {node.kind for node in walked.nodes}
    assert kinds == {"way", "stairs"}
    below = [n for n in walked.nodes if n.kind == "way" and n.down_m > -0.5]
    above = [n for n in walked.nodes if n.kind == "way" and n.down_m < -2.5]
    assert below
    assert above
    graph = walked.graph()
    graph.remove_nodes_from([n.number for n in walked.nodes if n.kind == "stairs"])
    assert not nx.has_path(graph, below[0].number, above[-1].number)


def test_what_is_walked_round_behind_one_door_is_a_room() -> None:
    corridor = track((0, 0, 0), (30, 0, 0))
    search = track(
        (0, 0, 0), (15, 0, 0), (15, 2, 0), (12, 2, 0), (12, 6, 0), (18, 6, 0), (18, 2, 0),
        (15, 2, 0), (15, 0, 0), (30, 0, 0),
    )  # fmt: skip
    walked = map_of({"r1": corridor, "r2": search})
    room = [node for node in walked.nodes if node.kind == "room"]
    assert len(room) >= 6
    assert all(node.east_m > 1.0 for node in room)
    corridors = [node for node in walked.nodes if node.kind == "way"]
    assert all(node.east_m < 2.6 for node in corridors)


def test_the_order_of_the_crews_makes_no_difference() -> None:
    one, other = track((0, 0, 0), (20, 0, 0)), track((10, -8, 0), (10, 8, 0))
    assert map_of({"a": one, "b": other}) == map_of({"b": other, "a": one})


def test_nobody_walked_nowhere() -> None:
    assert map_of({}).nodes == ()
    assert map_of({"r1": track((0, 0, 0))}).edges == ()
