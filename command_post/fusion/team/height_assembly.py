"""From an assembled graph to the heights of its nodes and places, and to storeys (pure)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from command_post.fusion.team.assembly import Assembled
from command_post.fusion.team.heights import HeightGraph, smooth_heights, storeys
from command_post.fusion.team.log import Height, TeamLog
from command_post.fusion.team.move_log import Floats, Ints
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.ties import PlaceId
from shared.compiled import compiled

UNKNOWN_HEIGHT_SD_M = 100.0
LEAST_SD_M = 0.02
MOST_M = 1e6
LEVEL_SLOPE = 0.1
"""Walking that rises no steeper than this is walking on a storey."""


class Heights(NamedTuple):
    """Nodes' and places' heights (m down) and variances (m²), in the order of the graph's."""

    node_m: Floats
    node_m2: Floats
    place_m: Floats
    place_m2: Floats

    @property
    def is_sound(self) -> bool:
        """Whether they could be solved."""
        return all(
            bool((np.abs(each) < MOST_M).all()) for each in (self.node_m, self.place_m)
        ) and all(bool(np.isfinite(each).all()) for each in self)


def solve_heights(
    log: TeamLog, assembled: Assembled, until_ns: int, settings: TeamSettings
) -> Heights:
    """Return all heights with what has been heard until ``until_ns``."""
    first = assembled.graph.first
    rows = [_rows(assembled, index) for index in range(len(assembled.chains))]
    fixes = [
        fix
        for index in range(len(assembled.chains))
        for fix in _fixes(log, assembled, index, until_ns, settings)
    ]
    base = assembled.place_column(0)
    tied = np.column_stack([
        assembled.graph.tie_at[:, 0], (assembled.graph.tie_at[:, 1] - base) // 2
    ])  # fmt: skip
    graph = HeightGraph(
        first,
        np.concatenate([move for move, _ in rows]),
        np.concatenate([at for _, at in rows]),
        np.full(len(tied), settings.passed_height_sd_m),
        tied,
        np.array([row for row, _ in fixes]).reshape(-1, 2),
        np.array([node for _, node in fixes], np.int64),
        np.array(
            [_known(log, place, until_ns) for place in assembled.places]
        ).reshape(-1, 2),
    )  # fmt: skip
    return Heights(*smooth_heights(graph))


def walked_storeys(assembled: Assembled, heights: Heights) -> Floats:
    """Return the storeys (m down, ascending) on which the team has walked."""
    down_m, walked_m = [], []
    for index, chain in enumerate(assembled.chains):
        nodes = assembled.nodes[index]
        length_m = np.diff(chain.length_m[nodes])
        rise_m = np.abs(np.diff(chain.rise[nodes, 0]))
        level = rise_m <= LEVEL_SLOPE * length_m
        first = int(assembled.graph.first[index])
        down_m.append(heights.node_m[first + 1 : first + len(nodes)][level])
        walked_m.append(length_m[level])
    return storeys(np.concatenate(down_m), np.concatenate(walked_m))


def _rows(assembled: Assembled, index: int) -> tuple[Floats, Ints]:
    """Return a chain's rows of ``HeightGraph.move`` and ``move_at``."""
    first = int(assembled.graph.first[index])
    rows = _rises(assembled.chains[index].rise, assembled.nodes[index])
    return rows, np.arange(first, first + len(rows))


@compiled
def _rises(rise: Floats, nodes: Ints) -> Floats:
    """Return how far it goes down (m) from each of the ``nodes`` to the next, give or take."""
    rows = np.empty((nodes.size - 1, 2))
    for row in range(nodes.size - 1):
        one, other = nodes[row], nodes[row + 1]
        rows[row, 0] = rise[other, 0] - rise[one, 0]
        variance_m2 = max(rise[other, 1] - rise[one, 1], 0.0)
        rows[row, 1] = max(math.sqrt(variance_m2), LEAST_SD_M)
    return rows


def _fixes(
    log: TeamLog, assembled: Assembled, index: int, until_ns: int, settings: TeamSettings
) -> list[tuple[tuple[float, float], int]]:
    """Return a chain's known heights, each carried over to the node nearest in time."""
    chain, nodes = assembled.chains[index], assembled.nodes[index]
    first = int(assembled.graph.first[index])
    fixes = []
    for unit, start in enumerate(chain.starts):
        if start.position is not None or unit == 0:
            down_m = 0.0 if start.position is None else start.position.down_m
            node = first + int(np.searchsorted(nodes, chain.begin_of(unit)))
            sd_m = settings.start_height_sd_m if start.down_sd_m is None else start.down_sd_m
            fixes.append(((down_m, sd_m), node))
    for height in log.responders[chain.responder_id].heights:
        if height.time_ns <= until_ns:
            stance = chain.nearest(height.time_ns)[0]
            at = max(int(np.searchsorted(nodes, stance, side="right")) - 1, 0)
            on_m = float(chain.rise[stance, 0] - chain.rise[nodes[at], 0])
            fixes.append(((height.down_m - on_m, max(height.sd_m, LEAST_SD_M)), first + at))
    return fixes


def _known(log: TeamLog, place: PlaceId, until_ns: int) -> tuple[float, float]:
    """Return what is known of a place's height: somebody's last word, or where it was set up."""
    if place[0] != "dap":
        return 0.0, UNKNOWN_HEIGHT_SD_M
    dap_id, installed_ns = place[1], int(place[2])
    said: Height | None = None
    for height in log.dap_heights.get(dap_id, []):
        if installed_ns <= height.time_ns <= until_ns:
            said = height
    if said is not None:
        return said.down_m, max(said.sd_m, LEAST_SD_M)
    installed = next(each for each in log.daps[dap_id] if each.time_ns == installed_ns)
    if (
        installed.position is None
        or installed.said_ns is not None
        or (installed.installer_id in log.responders)
    ):
        return 0.0, UNKNOWN_HEIGHT_SD_M
    return installed.position.down_m, math.sqrt(0.1)
