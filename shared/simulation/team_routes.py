"""Who of a team sets a DAP down where: the first to come by a place where none stands."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from copy import deepcopy
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.messages import NodeId
from shared.simulation.chance import generator
from shared.simulation.plan import Plan
from shared.simulation.route import Footfall, Route, plan_route
from shared.simulation.scenario import Scenario, SetsDown
from shared.simulation.search import wall_round
from shared.simulation.set_downs import (
    ON_THE_WAY,
    SET_DOWN_S,
    set_down_on_the_way,
    stance_times_s,
    stop_to_set_down,
)

Array: TypeAlias = NDArray[np.float64]

TEAMS_KEPT = 4
COMES_BY_M = 1.5
"""Who comes so near a site sets a DAP down there."""
STRIDES_PASSING = 5


class _Visit(NamedTuple):
    """Somebody comes by a site for the first time: when, and when if nothing were set down."""

    time_s: float
    responder_id: NodeId
    footfall: int
    site: int
    planned_s: float


def route_of(
    scenario: Scenario, responder_id: NodeId, seed: int
) -> tuple[Route, np.random.Generator]:
    """Return the footfalls of ``responder_id``, and the chance that is left for how they are made.

    Raises ``ValueError`` as ``plan_route`` does.
    """
    if any(responder.carries for responder in scenario.responders.values()):
        return deepcopy(_team_routes(scenario, seed)[responder_id])
    chance = generator(seed, "walk", responder_id)
    return plan_route(scenario, responder_id, chance), chance


@lru_cache(maxsize=TEAMS_KEPT)
def _team_routes(scenario: Scenario, seed: int) -> dict[NodeId, tuple[Route, np.random.Generator]]:
    """Plan everybody's route, then stop them where they set something down."""
    routes, chances = {}, {}
    for responder_id in scenario.responders:
        chances[responder_id] = generator(seed, "walk", responder_id)
        routes[responder_id] = plan_route(scenario, responder_id, chances[responder_id])
    _set_down(scenario, routes)
    set_down_on_the_way(scenario, routes, seed)
    return {name: (route, chances[name]) for name, route in routes.items()}


def _set_down(scenario: Scenario, routes: dict[NodeId, Route]) -> None:
    """Let whoever comes by a free site first, and still carries a DAP, set it down there."""
    carried = {name: list(scenario.responders[name].carries) for name in routes}
    late_s = dict.fromkeys(routes, 0.0)
    taken: set[tuple[str, int]] = set()
    waiting = [
        visit for name in routes for visit in _visits(scenario, name, routes[name].footfalls)
    ]
    heapq.heapify(waiting)
    while waiting:
        visit = heapq.heappop(waiting)
        name = visit.responder_id
        site = (scenario.responders[name].sets_down, visit.site)
        now_s = visit.planned_s + late_s[name]
        if site in taken or not carried[name]:
            continue
        if now_s > visit.time_s:
            heapq.heappush(waiting, visit._replace(time_s=now_s))
            continue
        taken.add(site)
        late_s[name] += SET_DOWN_S
        stop_to_set_down(routes[name], carried[name].pop(0), visit.footfall)


def _visits(scenario: Scenario, name: NodeId, falls: list[Footfall]) -> Iterator[_Visit]:
    """Yield when ``name`` first comes by each site, at the footfall that is nearest to it then."""
    responder = scenario.responders[name]
    if not responder.carries or responder.sets_down in ON_THE_WAY:
        return
    reached_s, _ = stance_times_s(falls, responder.start_s)
    body_m = np.array([fall.body_m for fall in falls])
    for number, site_m in enumerate(_sites_m(scenario.building, responder.sets_down)):
        away_m = np.linalg.norm(body_m - site_m, axis=1)
        near = np.flatnonzero(away_m[1:] < COMES_BY_M) + 1
        if near.size:
            passing = near[near < near[0] + STRIDES_PASSING]
            nearest = int(passing[np.argmin(away_m[passing])])
            time_s = float(reached_s[nearest])
            yield _Visit(time_s, name, nearest, number, time_s)


def _sites_m(plan: Plan, sets_down: SetsDown) -> Array:
    """Return where DAPs are set down (n, 3: north, east, down): sites, or a corner of each room."""
    if sets_down == "at_sites":
        places = [(site.floor, site.place_m) for site in plan.sites]
    else:
        places = [(room.floor, wall_round(room)[0]) for room in plan.rooms]
    down_m = [-plan.floor_height_m(floor) for floor, _ in places]
    points_m = np.array([point for _, point in places]).reshape(-1, 2)
    return np.column_stack([points_m, down_m])
