"""One responder's way by itself, the places that others know taken as known (pure).

What a whole crew would cost solved anew can so be told for one of them at a fraction of the work.
"""

from __future__ import annotations

import numpy as np

from command_post.fusion.team.assembly import UNKNOWN_SD_M, Assembled
from command_post.fusion.team.graph import AXIS, FIRST_UNIT, LEAD, Graph, with_columns
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.marginals import NO_COVARIANCE
from command_post.fusion.team.move_log import Floats, Ints
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.solution import Solution
from command_post.fusion.team.solving import (
    Solved,
    solved_from,
    solved_with_axis,
    turned_at,
    with_other_headings,
)


def commit_of_crowd(
    log: TeamLog, time_ns: int, before: Solution, settings: TeamSettings
) -> Solved | None:
    """Return a crew of many at ``time_ns``: other headings are tried of some of them, by turns.

    The whole crew is solved with another heading only where the responder alone fits better so.
    """
    found = solved_with_axis(log, time_ns, before, settings)
    if found is None or not found.is_sound:
        return found
    for index in turned_at(
        time_ns, len(found.assembled.chains), settings.turned_of_crowd, settings
    ):
        own = alone(found, index, settings)
        known = before.belief.units
        if with_other_headings(own, 0, known, settings) is not own:
            found = with_other_headings(found, index, known, settings)
    return found


def alone(found: Solved, index: int, settings: TeamSettings) -> Solved:
    """Return the chain at ``index`` solved alone, from where the whole solution has it.

    A place that others passed too stands where it was found, with a variance as if without the
    chain's own passes; one that nobody else knows is free, as before.
    """
    assembled, whole = found.assembled, found.assembled.graph
    chain, nodes = assembled.chains[index], assembled.nodes[index]
    first, end = whole.first[index : index + 2].tolist()
    units = len(chain.starts)
    ties = own_ties(found, index)
    base = assembled.place_column(0)
    passed = np.unique((whole.tie_at[ties, 1] - base) // 2)
    own_arrow = _own_columns(assembled, index, units, passed)
    straights = (whole.straight_at >= first - index) & (whole.straight_at < end - 1 - index)
    fixes = (whole.fix_at >= first) & (whole.fix_at < end)
    turns = (whole.turn_at >= first) & (whole.turn_at < end)
    move_at = whole.move_at[first - index : end - 1 - index] - np.array([first, 0, 0])
    move_at[:, 1] -= 2 * assembled.unit_first[index]
    tie_at = whole.tie_at[ties] - np.array([first, 0, 0, 2 * assembled.unit_first[index]])
    tie_at[:, 1] = FIRST_UNIT + 2 * units + 2 * np.searchsorted(passed, (tie_at[:, 1] - base) // 2)
    ends = np.array([0, end - first])
    columns, columns_first, width = with_columns(ends, move_at, tie_at, own_arrow.size)
    unit_sd = whole.unit_sd[2 * assembled.unit_first[index] :][: 2 * units]
    axis, lead = axis_and_lead(found)
    graph = Graph(
        ends, columns, columns_first, width,
        whole.move[first - index : end - 1 - index], move_at, whole.tie[ties], tie_at,
        whole.fix[fixes], whole.fix_at[fixes] - first, whole.turn[turns],
        whole.turn_at[turns] - first, whole.straight[straights],
        whole.straight_at[straights] - (first - index), places_by_others(found, ties)[passed],
        unit_sd, axis, lead,
    )  # fmt: skip
    by = [0 if assembled.installed_by[place] == index else -1 for place in passed.tolist()]
    seen = [assembled.seen_at[place] - first for place in passed.tolist()]
    places = [assembled.places[place] for place in passed.tolist()]
    own = Assembled(graph, [chain], [nodes], units, [0], places, seen, by, assembled.noise,
                    assembled.aside_m2[passed])  # fmt: skip
    return solved_from(
        own, found.pose[first:end].copy(), found.arrow[own_arrow], found.belief, settings,
        settings.commit_iterations, NO_COVARIANCE,
    )  # fmt: skip


def _own_columns(assembled: Assembled, index: int, units: int, passed: Ints) -> Ints:
    """Return the columns of the arrow that a chain touches, by what they are."""
    unit = assembled.unit_column(index) + np.arange(2 * units)
    place = assembled.place_column(0) + 2 * passed
    return np.concatenate([[AXIS, LEAD], unit, np.column_stack([place, place + 1]).ravel()])


def own_ties(found: Solved, index: int) -> Ints:
    """Return which ties of the graph are those of the chain at ``index``."""
    graph = found.assembled.graph
    return np.arange(*np.searchsorted(graph.tie_at[:, 0], graph.first[index : index + 2]))


def axis_and_lead(found: Solved) -> tuple[Floats, Floats]:
    """Return ``Graph.axis`` and ``Graph.lead`` that say of both what was found of them."""
    axis, lead = (
        np.array([found.arrow[each], max(float(found.shared[each, each]) ** 0.5, 1e-3)])
        for each in (AXIS, LEAD)
    )
    return np.append(axis, found.assembled.graph.axis[2]), lead


def places_by_others(found: Solved, own: Ints) -> Floats:
    """Return what is known of places apart from some's ``own`` ties: rows of ``Graph.place``."""
    graph, base = found.assembled.graph, found.assembled.place_column(0)
    count = len(graph.place)
    every = np.bincount((graph.tie_at[:, 1] - base) // 2, minlength=count)
    others = every - np.bincount((graph.tie_at[own, 1] - base) // 2, minlength=count)
    rows = graph.place.copy()
    known = np.flatnonzero((others > 0) & (rows[:, 2] >= UNKNOWN_SD_M))
    column = base + 2 * known
    variance = 0.5 * (found.shared[column, column] + found.shared[column + 1, column + 1])
    rows[known, 0] = found.arrow[column]
    rows[known, 1] = found.arrow[column + 1]
    rows[known, 2] = np.sqrt(variance * every[known] / others[known])
    return rows
