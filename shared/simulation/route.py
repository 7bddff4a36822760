"""From the legs of a route to footfalls: where the boot and the body are, stance by stance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from shared.maths.angles import wrap_rad
from shared.messages import NodeId
from shared.simulation.gaits import CRAWL_POSTURE_RAD
from shared.simulation.legs import Climb, Gait, Habit, Move, Person, PlainLeg, Ride, Stand
from shared.simulation.scenario import Scenario
from shared.simulation.search import plain_legs

Array: TypeAlias = NDArray[np.float64]

FOOT_ASIDE_M = 0.14
"""How far right of the hip's middle the sensor on the right boot is carried."""
PIVOT_FROM_RAD = math.radians(50.0)
"""A change of direction beyond this is turned on the spot before going on."""
PIVOT_STRIDE_RAD = math.radians(70.0)
ROUND_UP_TO_RAD = math.radians(120.0)
"""Corners up to this are walked round; sharper ones are turned on the spot."""
CORNER_CUT_M = 0.6
"""How far before a corner the walker begins to round it."""
CORNER_TURN_M = 0.15
"""Within this of a bend one faces from where one came to where one goes."""
KNEEL_S = 1.8
LADDER_TREAD_M = 0.1
"""Steps no deeper than this are rungs."""
CLIMB_REACH_M = 0.6
"""How near the end of a flight a route must come before it can take it."""
PLACE_SPREAD_M = 0.012


class Footfall(NamedTuple):
    """One stance: how and in what time it was reached, where boot and body are, how long it stands.

    ``place_m`` is under the boot's sensor, ``body_m`` under the hip, both on the ground (NED);
    ``posture_rad`` is the boot's pitch at rest, ``ramp`` the share of its rise in which it gathered
    speed.
    """

    gait: Gait
    stride_s: float
    place_m: Array
    body_m: Array
    facing_rad: float
    posture_rad: float
    dwell_s: float = 0.0
    ramp: float = 0.5


class Route(NamedTuple):
    """The footfalls of one responder, and when, after which of them, a DAP is set down."""

    footfalls: list[Footfall]
    installs: dict[NodeId, tuple[int, float]]


def plan_route(scenario: Scenario, responder_id: NodeId, chance: np.random.Generator) -> Route:
    """Return the footfalls along the responder's legs.

    Raises ``ValueError`` if a leg climbs stairs that the route has not come to, or is to go where
    the building has no way.
    """
    responder = scenario.responders[responder_id]
    legs = plain_legs(scenario.building, responder, chance)
    planner = _Planner(scenario, _drawn(scenario.person_of(responder_id), chance), chance)
    north_m, east_m, down_m, heading_rad = scenario.start_of(responder_id)
    body_m = np.array([north_m, east_m, down_m])
    here = Footfall("stand", 0.0, _beside(body_m, heading_rad), body_m, heading_rad, 0.0)
    footfalls = [here]
    installs: dict[NodeId, tuple[int, float]] = {}
    following: list[PlainLeg | None] = [*legs[1:], None]
    for leg, next_leg in zip(legs, following, strict=True):
        here = footfalls[-1]
        if isinstance(leg, Stand):
            if leg.installs is not None:
                installs[leg.installs] = (len(footfalls) - 1, here.dwell_s + 0.5 * leg.for_s)
            now_s = responder.start_s + sum(fall.stride_s + fall.dwell_s for fall in footfalls)
            stand_s = max(leg.for_s, leg.until_s - now_s)
            footfalls[-1] = here._replace(dwell_s=here.dwell_s + stand_s)
        elif isinstance(leg, Move):
            exact = isinstance(next_leg, Climb)
            jitter_m = 0.0 if leg.exact else responder.route_jitter_m
            footfalls += planner.move(here, leg, jitter_m, exact_end=exact)
        elif isinstance(leg, Ride):
            footfalls.append(planner.ride(here, leg))
        else:
            footfalls += planner.climb(here, leg)
    return Route(footfalls, installs)


class _Planner:
    """Lays footfalls for one person, whose chance decides every stride a little."""

    def __init__(self, scenario: Scenario, person: Person, chance: np.random.Generator) -> None:
        self._building = scenario.building
        self._person = person
        self._chance = chance

    def move(
        self, here: Footfall, leg: Move, jitter_m: float, *, exact_end: bool
    ) -> list[Footfall]:
        """Footfalls on level ground through the leg's points, each moved by chance a little."""
        shifts = np.clip(self._chance.normal(0.0, 1.0, (len(leg.to_m), 2)), -2.0, 2.0) * jitter_m
        if exact_end:
            shifts[-1] = 0.0
        points = [here.body_m[:2], *(np.array(leg.to_m) + shifts)]
        falls = [here]
        posture_rad = CRAWL_POSTURE_RAD if leg.gait == "crawl" else 0.0
        if posture_rad != here.posture_rad:
            kneeling = here._replace(gait="crawl", stride_s=KNEEL_S, posture_rad=posture_rad)
            falls.append(kneeling._replace(dwell_s=0.0))
        for piece in _split_at_sharp_corners(points):
            way = _rounded(piece)
            aim_rad = _direction(way[1] - way[0]) + _facing_off(leg.gait)
            falls += self._pivot(falls[-1], aim_rad)
            falls += self._strides(falls[-1], leg.gait, way)
        return falls[1:]

    def climb(self, here: Footfall, leg: Climb) -> list[Footfall]:
        """Footfalls on every second step of the flight, from the end that ``here`` is at."""
        stairs = self._building.flight(leg.stairs)
        foot_m = np.array([*stairs.foot_m, -self._building.floor_height_m(stairs.lower_floor)])
        head_m = np.array([*stairs.head_m, -self._building.floor_height_m(stairs.upper_floor)])
        up = bool(np.linalg.norm(here.body_m - foot_m) < np.linalg.norm(here.body_m - head_m))
        near_m, far_m = (foot_m, head_m) if up else (head_m, foot_m)
        if np.linalg.norm(here.body_m - near_m) > CLIMB_REACH_M:
            raise ValueError(
                f"stairs {leg.stairs!r} begin at {near_m[:2].tolist()}, the route is at "
                f"{here.body_m[:2].round(2).tolist()}: let a move end there first"
            )
        gait: Gait = "stairs_up" if up else "stairs_down"
        facing_rad = _direction(far_m[:2] - near_m[:2])
        if stairs.tread_m < LADDER_TREAD_M:
            # One faces it on the way down as well.
            gait, facing_rad = "ladder", _direction(head_m[:2] - foot_m[:2])
        habit = self._person.habit(gait)
        falls = [here, *self._pivot(here, facing_rad)]
        facing_rad = falls[-1].facing_rad + wrap_rad(facing_rad - falls[-1].facing_rad)
        shares = np.append(np.arange(2, stairs.steps, 2), stairs.steps) / stairs.steps
        for share in shares:
            body_m = near_m + share * (far_m - near_m)
            falls.append(self._fall(gait, habit, body_m, facing_rad, 0.0))
        return falls[1:]

    def ride(self, here: Footfall, leg: Ride) -> Footfall:
        """The stance at the end of a lift's ride: short of time, it is not as fast as it could."""
        rise_m = np.array([0.0, 0.0, -self._building.floor_height_m(leg.to_floor) - here.body_m[2]])
        way_m = abs(float(rise_m[2]))
        # The glide's acceleration is at most 1.5 times its mean.
        speed_m_s = min(leg.speed_m_s, math.sqrt(way_m * leg.acceleration_m_s2 / 1.5))
        ramp_s = 1.5 * speed_m_s / leg.acceleration_m_s2
        ride_s = way_m / speed_m_s + ramp_s
        return here._replace(
            gait="lift",
            stride_s=ride_s,
            place_m=here.place_m + rise_m,
            body_m=here.body_m + rise_m,
            dwell_s=0.0,
            ramp=ramp_s / ride_s,
        )

    def _pivot(self, here: Footfall, aim_rad: float) -> list[Footfall]:
        """Turn on the spot towards ``aim_rad``, if it is far from where one faces."""
        turn_rad = wrap_rad(aim_rad - here.facing_rad)
        if abs(turn_rad) < PIVOT_FROM_RAD:
            return []
        count = math.ceil(abs(turn_rad) / PIVOT_STRIDE_RAD)
        gait: Gait = "walk" if here.posture_rad == 0.0 else "crawl"
        habit = self._person.habit(gait)
        return [
            self._fall(
                gait, habit, here.body_m, here.facing_rad + turn_rad * share, here.posture_rad
            )
            for share in np.arange(1, count + 1) / count
        ]

    def _strides(self, here: Footfall, gait: Gait, way_m: Array) -> Iterator[Footfall]:
        """Whole strides along ``way_m`` (n, 2), none like another, the last one to its end."""
        habit = self._person.habit(gait)
        along_m = np.append(0.0, np.cumsum(np.hypot(*np.diff(way_m, axis=0).T)))
        count = max(1, round(along_m[-1] / habit.stride_m))
        parts = np.maximum(self._chance.normal(1.0, self._person.spread, count), 0.5)
        ends_m = np.cumsum(parts) / parts.sum() * along_m[-1]
        steps = np.diff(way_m, axis=0)
        directions = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])) + _facing_off(gait)
        directions += here.facing_rad + wrap_rad(directions[0] - here.facing_rad) - directions[0]
        # One turns at a corner, not from the middle of one straight to that of the next.
        margins_m = np.minimum(CORNER_TURN_M, 0.5 * np.diff(along_m))
        turns_m = np.column_stack((along_m[:-1] + margins_m, along_m[1:] - margins_m)).ravel()
        for end_m in ends_m:
            place = [np.interp(end_m, along_m, way_m[:, axis]) for axis in (0, 1)]
            body_m = np.array([*place, here.body_m[2]])
            facing_rad = float(np.interp(end_m, turns_m, np.repeat(directions, 2)))
            yield self._fall(gait, habit, body_m, facing_rad, here.posture_rad)

    def _fall(
        self, gait: Gait, habit: Habit, body_m: Array, facing_rad: float, posture_rad: float
    ) -> Footfall:
        stride_s = habit.stride_s * max(0.6, self._chance.normal(1.0, self._person.spread))
        place_m = _beside(body_m, facing_rad)
        place_m[:2] += self._chance.normal(0.0, PLACE_SPREAD_M, 2)
        return Footfall(gait, stride_s, place_m, body_m, facing_rad, posture_rad)


def _drawn(person: Person, chance: np.random.Generator) -> Person:
    """Return the person as they are today: every habit a few percent off."""

    def today(habit: Habit) -> Habit:
        length, time = np.clip(chance.normal(1.0, 0.02, 2), 0.9, 1.1)
        return Habit(habit.stride_m * float(length), habit.stride_s * float(time))

    habits = {
        name: today(value)
        for name, value in msgspec.structs.asdict(person).items()
        if isinstance(value, Habit)
    }
    return msgspec.structs.replace(person, **habits)


def _beside(body_m: Array, facing_rad: float) -> Array:
    right = np.array([-math.sin(facing_rad), math.cos(facing_rad), 0.0])
    return np.asarray(body_m + FOOT_ASIDE_M * right)


def _facing_off(gait: Gait) -> float:
    """How the body faces from where it goes (rad): side steps go to one's left or right."""
    return {"side_left": 0.5 * math.pi, "side_right": -0.5 * math.pi}.get(gait, 0.0)


def _direction(step_m: Array) -> float:
    return math.atan2(step_m[1], step_m[0])


def _split_at_sharp_corners(points: list[Array]) -> list[list[Array]]:
    """Cut the line through ``points`` where it turns back; drop points one already stands on."""
    kept = [points[0]]
    for point in points[1:]:
        if np.hypot(*(point - kept[-1])) > 1e-3:
            kept.append(point)
    pieces = [kept[:2]]
    for before, corner, after in zip(kept, kept[1:], kept[2:], strict=False):
        turn_rad = wrap_rad(_direction(after - corner) - _direction(corner - before))
        if abs(turn_rad) > ROUND_UP_TO_RAD:
            pieces.append([corner])
        pieces[-1].append(after)
    return [piece for piece in pieces if len(piece) > 1]


def _rounded(points: list[Array]) -> Array:
    """Return the line through ``points`` as many points (n, 2), its corners parabolas."""
    share = np.linspace(0.0, 1.0, 9)[:, None]
    pieces = [points[0][None]]
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        into, out = before - corner, after - corner
        cut_m = min(CORNER_CUT_M, 0.5 * float(np.hypot(*into)), 0.5 * float(np.hypot(*out)))
        start = corner + into * (cut_m / np.hypot(*into))
        end = corner + out * (cut_m / np.hypot(*out))
        pieces.append((1 - share) ** 2 * start + 2 * share * (1 - share) * corner + share**2 * end)
    pieces.append(points[-1][None])
    way = np.concatenate(pieces)
    moved = np.append(True, np.hypot(*np.diff(way, axis=0).T) > 1e-6)
    return np.asarray(way[moved])
