"""The arrow-shaped solver against the same said with dense matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from command_post.fusion.team.graph import (
    FIRST_UNIT,
    MOST_SCALE_SD,
    SCALE_DOF,
    Graph,
    with_columns,
)
from command_post.fusion.team.marginals import ENDS_ONLY, EVERY_NODE, NO_COVARIANCE
from command_post.fusion.team.residuals import cost_of
from command_post.fusion.team.smoother import log_determinant, smooth
from command_post.fusion.team.smoother_plain import smooth_plainly

Floats = NDArray[np.float64]
LENGTHS = (9, 1, 30)
PLACES = 4
UNITS = 4
UNIT_SD = np.array([0.02, 0.001, 0.02, 0.001, 0.25, 0.001, 0.02, 0.003])


def random_graph(seed: int) -> tuple[Graph, Floats, Floats]:
    """Return a graph of three chains, the first with two units, and states to start from."""
    chance = np.random.default_rng(seed)
    first = np.concatenate([[0], np.cumsum(LENGTHS)])
    from_node = [n for n in range(first[-1]) if n + 1 not in first]
    unit_of = [
        0 if n < 5 else 1 + int(np.searchsorted(first, n, side="right") - 1)
        for n in range(first[-1])
    ]
    move_at = np.array([(n, FIRST_UNIT + 2 * unit_of[n], 0) for n in from_node])
    count = len(from_node)
    move = np.column_stack([
        chance.normal(0.0, 5.0, (count, 2)), chance.uniform(3.0, 10.0, count),
        chance.uniform(0.1, 0.5, count), chance.uniform(0.01, 0.05, count),
    ])  # fmt: skip
    tied = np.sort(chance.integers(0, first[-1], 15))
    place = FIRST_UNIT + 2 * UNITS + 2 * chance.integers(0, PLACES, 15)
    scale = FIRST_UNIT + 2 * np.array(unit_of)[tied]
    tie_at = np.column_stack([tied, place, np.zeros(15, np.int64), scale])
    tie = np.column_stack([
        chance.normal(size=(15, 2)), chance.uniform(0.3, 2.0, 15), chance.choice([0.0, 4.0], 15),
        chance.normal(size=(15, 2)),
    ])  # fmt: skip
    size = FIRST_UNIT + 2 * UNITS + 2 * PLACES
    columns, columns_first, width = with_columns(first, move_at, tie_at, size)
    graph = Graph(
        first, columns, columns_first, width, move, move_at, tie, tie_at,
        fix=np.array([(0.0, 0.0, 0.0, 0.0, 0.5, 0.0), (0.1, 0.2, 3.0, 4.0, 2.0, 4.0)]),
        fix_at=np.array([0, 9]),
        turn=np.array([(0.0, 0.05), (6.2, 0.5), (0.0, 0.5)]),
        turn_at=first[:-1].copy(),
        straight=np.array([(0.3, 0.1), (1.0, 0.1), (-2.0, 0.1)]),
        straight_at=np.array([1, 4, 11]),
        place=np.column_stack([chance.normal(0.0, 10.0, (PLACES, 2)), np.full(PLACES, 100.0)]),
        unit_sd=UNIT_SD,
        axis=np.array([0.0, 0.02, 0.04]),
        lead=np.array([0.1, 0.5]),
    )  # fmt: skip
    pose = chance.normal(0.0, 5.0, (int(first[-1]), 3)) * [1.0, 1.0, 0.1]
    arrow = np.concatenate([
        [0.05, 0.3], np.tile([0.01, 0.001], UNITS), chance.normal(0.0, 5.0, 2 * PLACES)
    ])  # fmt: skip
    return graph, pose, arrow


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("iterations", [1, 2, 6])
def test_it_does_what_it_means(seed: int, iterations: int) -> None:
    graph, pose, arrow = random_graph(seed)
    plain = smooth_plainly(graph, pose, arrow, iterations)
    cost, made, nodes, shared = smooth(graph, pose, arrow, iterations, 0.0, EVERY_NODE)
    assert made == iterations
    assert cost == pytest.approx(plain.cost, rel=1e-9)
    assert pose == pytest.approx(plain.pose, abs=1e-7)
    assert arrow == pytest.approx(plain.arrow, abs=1e-7)
    of_arrow = plain.covariance[pose.size :, pose.size :]
    assert shared == pytest.approx(of_arrow, rel=1e-6, abs=1e-9)
    for node, (nn, ne, ee, tt, nt, et) in enumerate(nodes):
        block = plain.covariance[3 * node : 3 * node + 3, 3 * node : 3 * node + 3]
        said = np.array([[nn, ne, nt], [ne, ee, et], [nt, et, tt]])
        assert said == pytest.approx(block, rel=1e-6, abs=1e-9)


def test_the_determinant_is_that_of_the_normal_matrix() -> None:
    graph, pose, arrow = random_graph(4)
    sign, size = np.linalg.slogdet(smooth_plainly(graph, pose, arrow, 1).normal)
    assert sign == 1.0
    assert log_determinant(graph, pose, arrow) == pytest.approx(size, rel=1e-9)
    assert log_determinant(graph._replace(place=graph.place * np.nan), pose, arrow) == math.inf


def test_the_ends_alone_are_the_ends_of_all() -> None:
    graph, pose, arrow = random_graph(3)
    *_, ends, _ = smooth(graph, pose.copy(), arrow.copy(), 3, 0.0, ENDS_ONLY)
    *_, nodes, _ = smooth(graph, pose.copy(), arrow.copy(), 3, 0.0, EVERY_NODE)
    assert (ends == nodes[graph.first[1:] - 1]).all()


def test_the_cost_falls_to_a_place_of_rest() -> None:
    graph, pose, arrow = random_graph(5)
    costs = [smooth(graph, pose, arrow, 1, 0.0, NO_COVARIANCE)[0] for _ in range(60)]
    assert costs[-1] < costs[0]
    before = pose.copy()
    _, made, _, _ = smooth(graph, pose, arrow, 50, 1e-6, NO_COVARIANCE)
    assert made == 1
    assert pose == pytest.approx(before, abs=1e-5)


def test_of_what_nothing_else_tells_the_size_a_larger_map_is_as_good() -> None:
    graph, pose, arrow = random_graph(2)
    knowing_nothing = graph._replace(
        fix=graph.fix[:0], fix_at=graph.fix_at[:0], unit_sd=np.full_like(graph.unit_sd, 0.09),
        place=graph.place * [1.0, 1.0, 1e9], tie=graph.tie * [0.0, 0.0, 1.0, 1.0, 0.0, 0.0],
    )  # fmt: skip
    larger, places = arrow.copy(), FIRST_UNIT + 2 * UNITS
    scales = slice(FIRST_UNIT, places, 2)
    larger[scales] = 1.2 * (1.0 + arrow[scales]) - 1.0
    larger[places:] *= 1.2
    of_ways = [
        cost_of(knowing_nothing, a_pose, an_arrow) - cost_of_scales(an_arrow[scales], 0.09)
        for a_pose, an_arrow in ((pose, arrow), (pose * [1.2, 1.2, 1.0], larger))
    ]
    assert of_ways[1] == pytest.approx(of_ways[0], rel=1e-9)


def cost_of_scales(scales: Floats, sd: float) -> float:
    """Return what Student's t and its bound say against scales."""
    heavy = (SCALE_DOF + 1.0) * np.log1p((scales / sd) ** 2 / SCALE_DOF)
    return float((heavy + (scales / MOST_SCALE_SD) ** 2).sum())


def test_a_map_at_four_tenths_is_no_way_out() -> None:
    graph, pose, arrow = random_graph(2)
    smaller = arrow.copy()
    smaller[FIRST_UNIT : FIRST_UNIT + 2 * UNITS : 2] = -0.6
    nothing = graph._replace(move=graph.move[:0], tie=graph.tie[:0], tie_at=graph.tie_at[:0])
    assert cost_of(nothing, pose, smaller) - cost_of(nothing, pose, arrow) > 40.0 * UNITS


def test_equations_without_a_solution_cost_infinitely_much() -> None:
    graph, pose, arrow = random_graph(1)
    broken = graph._replace(place=graph.place * np.nan)
    cost, _, _, _ = smooth(broken, pose, arrow, 3, 0.0, ENDS_ONLY)
    assert cost == math.inf
