"""An exercise: who walks where in which building, carrying what, and which DAPs stand there.

Scenario files give points as ``[north, east]`` in metres from the incident's origin, at the
entrance; times are seconds from the start of the exercise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

from shared.config import ConfigError, load_toml
from shared.messages import NodeId
from shared.simulation.barometer import BarometerSettings
from shared.simulation.imu_errors import ImuSettings
from shared.simulation.magnetic import MagneticSettings
from shared.simulation.plan import Plan, Point, load_plan, packaged_or_path
from shared.simulation.propagation import RadioParameters

SCENARIOS = Path(__file__).parent / "scenarios"

Gait: TypeAlias = Literal[
    "stand", "walk", "fast_walk", "side_left", "side_right", "crawl", "stairs_up", "stairs_down",
    "ladder", "lift",
]  # fmt: skip
LevelGait: TypeAlias = Literal["walk", "fast_walk", "side_left", "side_right", "crawl"]
Seconds: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e5)]
Share: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]

STAND_AT_LEAST_S = 3.0


class Stand(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="do", tag="stand"):
    """Stand still for ``for_s``, and if told so set down the DAP ``installs`` meanwhile."""

    for_s: Seconds
    installs: NodeId | None = None


class Move(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="do", tag="move"):
    """Go on level ground through each point of ``to_m`` to the last, in one gait."""

    gait: LevelGait
    to_m: Annotated[tuple[Point, ...], Meta(min_length=1)]


class Climb(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="do", tag="climb"):
    """Take the flight ``stairs`` from the end one stands at to the other."""

    stairs: str


class Ride(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="do", tag="ride"):
    """Stand in a lift, where one is, that goes to the floor ``to_floor``."""

    to_floor: str
    speed_m_s: Annotated[float, Meta(gt=0.1, le=10.0)] = 1.6
    acceleration_m_s2: Annotated[float, Meta(gt=0.1, le=3.0)] = 1.0


Leg: TypeAlias = Stand | Move | Climb | Ride


class Habit(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a person makes one gait: length of a stride and the time it takes, on average.

    A stride is from one stance of a foot to the next of the same foot. On stairs the steps give
    the length.
    """

    stride_m: Annotated[float, Meta(gt=0.1, le=4.0)]
    stride_s: Annotated[float, Meta(gt=0.3, le=10.0)]


LADDER = Habit(0.6, 1.9)


class Person(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How somebody moves. ``spread`` is the standard deviation of a stride, as a share of it."""

    walk: Habit = Habit(1.2, 1.12)
    fast_walk: Habit = Habit(1.8, 0.95)
    side_left: Habit = Habit(0.6, 1.3)
    side_right: Habit = Habit(0.6, 1.3)
    crawl: Habit = Habit(0.6, 1.5)
    stairs_up: Habit = Habit(0.67, 1.3)
    stairs_down: Habit = Habit(0.67, 1.2)
    spread: Share = 0.03

    def habit(self, gait: Gait) -> Habit:
        """How they make ``gait``, which is not standing; a ladder is climbed by all alike."""
        if gait == "ladder":
            return LADDER
        habit: Habit = getattr(self, gait)
        return habit


class Responder(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Who goes in when, from where, facing where, and along which legs.

    Chance moves each point of the route by ``route_jitter_m`` (standard deviation), save where
    stairs follow. A route begins and ends standing, for a sensor needs stillness to start from.
    """

    start_m: Point
    route: Annotated[tuple[Leg, ...], Meta(min_length=1)]
    route_jitter_m: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.1
    heading_deg: float = 0.0
    floor: str = "ground"
    start_s: Seconds = 0.0
    person: str = "average"

    def __post_init__(self) -> None:
        """Refuse a route that does not begin and end standing."""
        for leg, where in ((self.route[0], "begin"), (self.route[-1], "end")):
            if not (isinstance(leg, Stand) and leg.for_s >= STAND_AT_LEAST_S):
                raise ValueError(f"route: let it {where} with a stand of {STAND_AT_LEAST_S} s")


class Dap(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A DAP at ``position_m`` (north, east, down) from the start; without, a leg installs it."""

    position_m: tuple[float, float, float] | None = None


class Scenario(msgspec.Struct, frozen=True, forbid_unknown_fields=True, dict=True):
    """An exercise, but for its chance: that comes from a seed."""

    description: str
    plan: str
    responders: Annotated[dict[NodeId, Responder], Meta(min_length=1)]
    daps: dict[NodeId, Dap] = {}
    people: dict[str, Person] = {}
    imu: ImuSettings = ImuSettings()
    magnetic: MagneticSettings = MagneticSettings()
    barometer: BarometerSettings | None = None
    radio: RadioParameters = RadioParameters()
    taped_m: Annotated[float, Meta(gt=0.0, le=1e5)] | None = None

    def __post_init__(self) -> None:
        """Refuse DAPs that nobody or more than one installs, and people who are not described."""
        installed = [dap_id for dap_id, _ in self.installations]
        for dap_id, dap in self.daps.items():
            ways = installed.count(dap_id) + (dap.position_m is not None)
            if ways != 1:
                raise ValueError(
                    f"daps.{dap_id}: give it a position_m, or let one leg install it; has {ways}"
                )
        for dap_id in installed:
            if dap_id not in self.daps:
                raise ValueError(f"a leg installs {dap_id!r}: list it under daps")
        for responder_id, responder in self.responders.items():
            if responder.person not in self.people and responder.person != "average":
                raise ValueError(
                    f"responders.{responder_id}.person: {responder.person!r} is not under people"
                )

    @property
    def installations(self) -> list[tuple[NodeId, NodeId]]:
        """Which DAP is installed by which responder, in the order of the file."""
        return [
            (leg.installs, responder_id)
            for responder_id, responder in self.responders.items()
            for leg in responder.route
            if isinstance(leg, Stand) and leg.installs is not None
        ]

    @cached_property
    def building(self) -> Plan:
        """The plan, loaded."""
        return load_plan(self.plan)

    def person_of(self, responder_id: NodeId) -> Person:
        """How the responder moves."""
        return self.people.get(self.responders[responder_id].person, Person())

    def start_of(self, responder_id: NodeId) -> tuple[float, float, float, float]:
        """North, east, down and heading (rad) of the responder before the first leg."""
        responder = self.responders[responder_id]
        heights_m = {floor.name: floor.height_m for floor in self.building.floors}
        height_m = heights_m[responder.floor]
        north_m, east_m = responder.start_m
        return north_m, east_m, -height_m, math.radians(responder.heading_deg)


def load_scenario(name_or_path: str) -> Scenario:
    """Return the packaged scenario of that name, or the one in the TOML file at that path.

    Raises ``shared.config.ConfigError`` if there is none or it, or its plan, cannot be used. A
    plan that is a path is taken from the scenario's folder.
    """
    path = packaged_or_path(name_or_path, SCENARIOS)
    scenario = load_toml(path, Scenario)
    if scenario.plan.endswith(".toml"):
        scenario = msgspec.structs.replace(scenario, plan=str(path.parent / scenario.plan))
    for complaint in _out_of_place(scenario):
        raise ConfigError(f"{path}: {complaint}")
    return scenario


def _out_of_place(scenario: Scenario) -> Iterator[str]:
    """Say which floors and stairs the responders are sent to that the plan does not have."""
    floors = [floor.name for floor in scenario.building.floors]
    flights = [stairs.name for stairs in scenario.building.stairs]
    for responder_id, responder in scenario.responders.items():
        where = f"responders.{responder_id}"
        if responder.floor not in floors:
            yield f"{where}.floor: no {responder.floor!r} in the plan; use one of {floors}"
        for index, leg in enumerate(responder.route):
            if isinstance(leg, Climb) and leg.stairs not in flights:
                stairs = f"no {leg.stairs!r} in the plan; use one of {flights}"
                yield f"{where}.route[{index}].stairs: {stairs}"
            if isinstance(leg, Ride) and leg.to_floor not in floors:
                floor = f"no {leg.to_floor!r} in the plan; use one of {floors}"
                yield f"{where}.route[{index}].to_floor: {floor}"
