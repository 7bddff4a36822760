"""Heights: the scalar elimination against dense algebra, and storeys from where people walk."""

from __future__ import annotations

import numpy as np
import pytest

from command_post.fusion.team.heights import (
    HeightGraph,
    smooth_heights,
    storey_shares,
    storeys,
)


def graph_of(ties: bool) -> HeightGraph:
    chance = np.random.default_rng(2)
    first = np.array([0, 6, 7, 15])
    from_node = np.array([n for n in range(15) if n + 1 not in first])
    count = len(from_node)
    at = np.column_stack([chance.integers(0, 15, 8), chance.integers(0, 3, 8)])
    return HeightGraph(
        first,
        np.column_stack([chance.normal(0.0, 1.0, count), chance.uniform(0.05, 0.3, count)]),
        from_node,
        np.full(8 if ties else 0, 1e3),
        at if ties else at[:0],
        np.array([(0.0, 0.2), (-1.0, 0.3), (0.5, 0.2), (-3.0, 0.5)]),
        np.array([0, 6, 7, 12]),
        np.array([(0.0, 0.3), (0.0, 100.0), (-3.0, 100.0)]) if ties else np.empty((0, 2)),
    )


@pytest.mark.parametrize("ties", [True, False])
def test_elimination_is_dense_algebra(ties: bool) -> None:
    graph = graph_of(ties)
    states = 15 + len(graph.place)
    rows: list[tuple[dict[int, float], float, float]] = [
        ({int(a): -1.0, int(a) + 1: 1.0}, down, sd)
        for a, (down, sd) in zip(graph.move_at, graph.move, strict=True)
    ]
    rows += [
        ({int(a): 1.0}, down, sd) for a, (down, sd) in zip(graph.fix_at, graph.fix, strict=True)
    ]
    rows += [({15 + k: 1.0}, down, sd) for k, (down, sd) in enumerate(graph.place)]
    # So wide a tie weighs (ν + 1)/ν whatever its residual.
    rows += [({int(a): 1.0, 15 + int(p): -1.0}, 0.0, 1e3 / np.sqrt(1.5)) for a, p in graph.tie_at]
    design, value = np.zeros((len(rows), states)), np.zeros(len(rows))
    for row, (entries, said, sd) in enumerate(rows):
        for column, entry in entries.items():
            design[row, column] = entry / sd
        value[row] = said / sd
    covariance = np.linalg.inv(design.T @ design)
    solution = covariance @ design.T @ value
    node, node_m2, place, place_m2 = smooth_heights(graph)
    assert np.concatenate([node, place]) == pytest.approx(solution, abs=1e-4)
    spread = np.concatenate([node_m2, place_m2])
    assert spread == pytest.approx(np.diag(covariance), rel=1e-3)


def test_a_tie_through_the_ceiling_is_outvoted() -> None:
    graph = HeightGraph(
        np.array([0, 4]), np.array([(0.0, 0.05), (-3.0, 0.1), (0.0, 0.05)]), np.array([0, 1, 2]),
        np.array([0.4, 0.4, 0.4]), np.array([[0, 0], [1, 0], [3, 0]]),
        np.array([(0.0, 0.1)]), np.array([0]), np.array([(0.0, 0.1)]),
    )  # fmt: skip
    node, _, _, _ = smooth_heights(graph)
    assert node[3] == pytest.approx(-3.0, abs=0.15)


def test_storeys_are_where_people_walk() -> None:
    down_m = np.concatenate([np.full(40, 0.1), np.full(30, -3.1), np.linspace(0.0, -3.0, 8)])
    found = storeys(down_m, np.full(len(down_m), 1.0))
    assert found == pytest.approx([-3.1, 0.1], abs=0.2)
    (level_m, share), other = storey_shares(-2.6, 0.6, found.tolist())
    assert level_m == pytest.approx(-3.1, abs=0.2)
    assert share + other[1] == pytest.approx(1.0)
    assert 0.8 < share < 1.0


def test_who_has_not_walked_has_no_storey() -> None:
    assert storeys(np.empty(0), np.empty(0)).size == 0
    assert storey_shares(0.0, 1.0, ()) == []
