"""The whole team at once: robust Gauss-Newton on a graph shaped like an arrow.

Iteratively reweighted least squares with Student's t, in numba; ``smoother_plain.py`` says the
same with dense matrices. Every sum is taken in one fixed order and with our own arithmetic, so that
the same graph and start give the same bits on any machine.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from command_post.fusion.team.arithmetic import (
    factorise,
    invert_factorised,
    logarithm,
    solve_factorised,
)
from command_post.fusion.team.blocks import determinant
from command_post.fusion.team.elimination import reduce_to_arrow, take_step
from command_post.fusion.team.graph import Graph, with_tails
from command_post.fusion.team.marginals import NO_COVARIANCE, marginals
from command_post.fusion.team.residuals import cost_of
from command_post.fusion.team.system import empty_system
from shared.compiled import compiled

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]


class Covariance(NamedTuple):
    """Of nodes (n, 6: nn, ne, ee, turn with turn, north and east) and of the arrow (A, A)."""

    node: Floats
    arrow: Floats


@compiled
def smooth(
    graph: Graph, pose: Floats, arrow: Floats, iterations: int, settled_m: float, covariance: int
) -> tuple[float, int, Floats, Floats]:
    """Improve ``pose`` (n, 3) and ``arrow`` (A,) in place, until no place moves ``settled_m``.

    Returns the cost before the last step (twice the negative log-posterior, up to a constant), the
    iterations made, and covariances as in :class:`Covariance`, about the state before that step and
    with the tails of turns: none, of each chain's last node and the arrow, or of all, as
    ``covariance`` says. A cost of infinity says that the equations could not be solved; pose and
    arrow are then as they were.
    """
    system = empty_system(graph, arrow.size)
    ends_at = np.zeros((graph.first.size - 1, 6))
    nothing = np.zeros((0, 0))
    change = np.zeros_like(pose)
    last_pose, last_arrow = np.zeros_like(pose), np.zeros_like(arrow)
    made = 0
    for made in range(1, iterations + 1):
        reduce_to_arrow(graph, pose, arrow, system)
        if not factorise(system.arrow):
            return math.inf, made, ends_at, nothing
        solve_factorised(system.arrow, system.arrow_right)
        last_pose[:] = pose
        last_arrow[:] = arrow
        if take_step(graph, system, pose, arrow, change) < settled_m:
            break
    cost = cost_of(graph, last_pose, last_arrow)
    if covariance == NO_COVARIANCE:
        return cost, made, ends_at, nothing
    reduce_to_arrow(with_tails(graph), last_pose, last_arrow, system)
    if not factorise(system.arrow):
        return math.inf, made, ends_at, nothing
    shared = invert_factorised(system.arrow)
    return cost, made, marginals(graph, system, shared, covariance), shared


@compiled
def log_determinant(graph: Graph, pose: Floats, arrow: Floats) -> float:
    """Return the logarithm of the determinant of the normal matrix about ``pose`` and ``arrow``.

    Not finite where that is not positive definite.
    """
    system = empty_system(graph, arrow.size)
    reduce_to_arrow(graph, pose, arrow, system)
    if not factorise(system.arrow):
        return math.inf
    total = 0.0
    for node in range(pose.shape[0]):
        total -= logarithm(determinant(system.inverse[node]))
    for column in range(arrow.size):
        total += 2.0 * logarithm(system.arrow[column, column])
    return total
