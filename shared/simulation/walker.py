"""Where a responder really is: the route of a scenario, walked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.messages import NodeId
from shared.simulation.scenario import Climb, Gait, Move, Scenario, Stand

Array: TypeAlias = NDArray[np.float64]

BODY_RATE_HZ = 20.0


@dataclass(frozen=True)
class BodyTrack:
    """The body's way: ``time_s`` (n,), ``position_m`` (n, 3) NED, ``heading_rad`` (n,).

    The position is the hip's on the plan and the floor's in height: down is that of the floor or
    stair underfoot. Headings are continuous, not wrapped. Time 0 is the start of the exercise.
    """

    time_s: Array
    position_m: Array
    heading_rad: Array

    def at(self, time_s: Array) -> tuple[Array, Array]:
        """Return positions (m, 3) and headings (m,) at ``time_s`` (m,), held beyond the ends."""
        position_m = np.column_stack(
            [np.interp(time_s, self.time_s, self.position_m[:, axis]) for axis in range(3)]
        )
        return position_m, np.interp(time_s, self.time_s, self.heading_rad)


@dataclass(frozen=True)
class Walk:
    """A responder's true motion, between entering and leaving the exercise.

    ``stance_time_s`` (k,) and ``stance_position_m`` (k, 3) are the boot's stances, ``gaits``
    (k - 1) how each next one was reached. ``installed`` has the time at which each DAP was set down.
    """

    body: BodyTrack
    stance_time_s: Array
    stance_position_m: Array
    gaits: tuple[Gait, ...]
    installed: dict[NodeId, float]


def simulate_walk(scenario: Scenario, responder_id: NodeId, seed: int) -> Walk:  # noqa: ARG001
    """Return how ``responder_id`` moves in the exercise of ``seed``."""
    responder = scenario.responders[responder_id]
    person = scenario.person_of(responder_id)
    north_m, east_m, down_m, heading_rad = scenario.start_of(responder_id)
    times, points, headings = [responder.start_s], [(north_m, east_m, down_m)], [heading_rad]
    gaits: list[Gait] = []
    installed: dict[NodeId, float] = {}
    for leg in responder.route:
        if isinstance(leg, Stand):
            if leg.installs is not None:
                installed[leg.installs] = times[-1] + leg.for_s / 2.0
            targets: list[tuple[float, float, float]] = []
            times.append(times[-1] + leg.for_s)
            points.append(points[-1])
            headings.append(headings[-1])
            gaits.append("stand")
        elif isinstance(leg, Move):
            habit = getattr(person, leg.gait)
            targets = [(*point, points[-1][2]) for point in leg.to_m]
        else:
            habit = person.stairs_up
            targets = [_other_end(scenario, leg, points[-1])]
        for target in targets:
            step = np.subtract(target, points[-1])
            heading = float(np.arctan2(step[1], step[0]))
            strides = float(np.linalg.norm(step)) / habit.stride_m
            times += [times[-1] + 0.5, times[-1] + 0.5 + strides * habit.stride_s]
            points += [points[-1], target]
            headings += [heading, heading]
            gaits += ["stand", leg.gait if isinstance(leg, Move) else "stairs_up"]
    time_s, position_m = np.array(times), np.array(points)
    track = BodyTrack(time_s, position_m, np.unwrap(np.array(headings)))
    grid_s = np.arange(time_s[0], time_s[-1], 1.0 / BODY_RATE_HZ)
    body = BodyTrack(grid_s, *track.at(grid_s))
    return Walk(body, time_s, position_m, tuple(gaits), installed)


def _other_end(
    scenario: Scenario, leg: Climb, here: tuple[float, float, float]
) -> tuple[float, float, float]:
    flight = scenario.building.flight(leg.stairs)
    foot = (*flight.foot_m, -scenario.building.floor_height_m(flight.lower_floor))
    head = (*flight.head_m, -scenario.building.floor_height_m(flight.upper_floor))
    if np.linalg.norm(np.subtract(here, foot)) < np.linalg.norm(np.subtract(here, head)):
        return head
    return foot
