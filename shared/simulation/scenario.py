"""An exercise: who walks where in which building, carrying what, and which DAPs stand there.

Scenario files give points as ``[north, east]`` in metres from the incident's origin, at the
entrance; times are seconds from the start of the exercise.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import Meta

from shared.config import ConfigError, load_toml
from shared.messages import NodeId
from shared.simulation.barometer import BarometerSettings
from shared.simulation.faults import NONE, Fault, misplaced
from shared.simulation.gnss import GnssReceiver
from shared.simulation.imu_errors import PHONE, ImuSettings
from shared.simulation.legs import Climb, Go, Leg, Person, Ride, Search, Seconds, Stand
from shared.simulation.magnetic import MagneticSettings
from shared.simulation.odometry_errors import OdometrySettings
from shared.simulation.plan import Plan, Point, load_plan, packaged_or_path
from shared.simulation.propagation import RadioParameters
from shared.simulation.turning import turned

SCENARIOS = Path(__file__).parent / "scenarios"
MISHAPS = Path(__file__).parent / "mishaps"

SetsDown: TypeAlias = Literal["at_sites", "in_rooms", "spaced", "advised"]

STAND_AT_LEAST_S = 3.0

RESERVED_IDS = frozenset({"post", "launcher"})
"""The post of a demo, and who gives its start."""


class Responder(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Who goes in when, from where, facing where, and along which legs.

    Chance moves each point of the route by ``route_jitter_m`` (standard deviation), save where
    stairs follow. A route begins and ends standing, for a sensor needs stillness to start from.
    ``carries`` are DAPs that they set down as they come by the plan's sites where none stands yet,
    in rooms that they search, after every ``spacing_m`` of their way, or when their unit advises
    it. ``heading_sd_deg`` is how well their unit knows its heading at first; 180 is not at all.
    """

    start_m: Point
    route: Annotated[tuple[Leg, ...], Meta(min_length=1)]
    route_jitter_m: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.1
    heading_deg: Annotated[float, Meta(ge=-360.0, le=360.0)] = 0.0
    floor: str = "ground"
    start_s: Seconds = 0.0
    person: str = "average"
    carries: tuple[NodeId, ...] = ()
    sets_down: SetsDown = "at_sites"
    spacing_m: Annotated[float, Meta(ge=1.0, le=1e3)] = 20.0
    heading_sd_deg: Annotated[float, Meta(ge=0.0, le=180.0)] = 30.0

    def __post_init__(self) -> None:
        """Refuse a route that does not begin and end standing."""
        for leg, where in ((self.route[0], "begin"), (self.route[-1], "end")):
            if not (isinstance(leg, Stand) and leg.for_s >= STAND_AT_LEAST_S):
                raise ValueError(f"route: let it {where} with a stand of {STAND_AT_LEAST_S} s")


class Team(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Responders who do alike: each of ``members`` as ``every`` says, one after another.

    They go in ``stagger_s`` apart and carry ``daps_each`` DAPs, called after them: r1-1, r1-2. The
    unit of the first knows its heading to ``leader_heading_sd_deg``, where that is given.
    """

    members: Annotated[tuple[NodeId, ...], Meta(min_length=1)]
    every: Responder
    stagger_s: Seconds = 0.0
    daps_each: Annotated[int, Meta(ge=0, le=20)] = 0
    leader_heading_sd_deg: Annotated[float, Meta(ge=0.0, le=180.0)] | None = None

    def responders(self) -> dict[NodeId, Responder]:
        """Return the members by id."""
        told = {}
        for place, member in enumerate(self.members):
            known = self.leader_heading_sd_deg if place == 0 else None
            told[member] = msgspec.structs.replace(
                self.every,
                start_s=self.every.start_s + place * self.stagger_s,
                carries=tuple(f"{member}-{number}" for number in range(1, self.daps_each + 1)),
                heading_sd_deg=self.every.heading_sd_deg if known is None else known,
            )
        return told


class Dap(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A DAP at ``position_m`` (north, east, down) from the start; without, a leg installs it."""

    position_m: tuple[float, float, float] | None = None


class Scenario(msgspec.Struct, frozen=True, forbid_unknown_fields=True, dict=True, eq=False):
    """An exercise, but for its chance: that comes from a seed.

    ``teams`` are among the responders once it is loaded. With ``turned_deg`` the whole of it, the
    building included, lies turned clockwise about the origin. A scenario equals only itself, so
    that what is worked out of it can be kept. ``imu`` is what is worn on boots and belts, ``phone``
    at the chest. Without ``gnss`` nobody has a satellite receiver.
    """

    description: str
    plan: str
    responders: dict[NodeId, Responder] = {}
    teams: dict[str, Team] = {}
    turned_deg: Annotated[float, Meta(ge=-360.0, le=360.0)] = 0.0
    daps: dict[NodeId, Dap] = {}
    people: dict[str, Person] = {}
    imu: ImuSettings = ImuSettings()
    phone: ImuSettings = PHONE
    magnetic: MagneticSettings = MagneticSettings()
    barometer: BarometerSettings | None = None
    radio: RadioParameters = RadioParameters()
    gnss: GnssReceiver | None = None
    odometry: OdometrySettings = OdometrySettings()
    faults: dict[NodeId, Fault] = {}
    taped_m: Annotated[float, Meta(gt=0.0, le=1e5)] | None = None

    def __post_init__(self) -> None:
        """Refuse DAPs not installed once, people who are not described, and ids that are taken."""
        if not self.responders and not self.teams:
            raise ValueError("responders: nobody goes in; describe one, or a team")
        _refuse_ids(self.everybody, self.daps)
        installed = [dap_id for dap_id, _ in self.installations]
        for dap_id, dap in self.daps.items():
            ways = installed.count(dap_id) + (dap.position_m is not None)
            if ways != 1:
                raise ValueError(
                    f"daps.{dap_id}: give it a position_m, or let one leg install it; has {ways}"
                )
        carried = {dap_id for each in self.responders.values() for dap_id in each.carries}
        for dap_id in installed:
            if dap_id not in self.daps and dap_id not in carried:
                raise ValueError(f"a leg installs {dap_id!r}: list it under daps")
        for responder_id, responder in self.responders.items():
            if responder.person not in self.people and responder.person != "average":
                raise ValueError(
                    f"responders.{responder_id}.person: {responder.person!r} is not under people"
                )

    @property
    def installations(self) -> list[tuple[NodeId, NodeId]]:
        """Which DAP is installed by which responder, in the order of the file.

        Of those that somebody carries it depends on chance whether they are set down at all.
        """
        told: list[tuple[NodeId, NodeId]] = []
        for responder_id, responder in self.responders.items():
            legs = [leg for leg in responder.route if isinstance(leg, Stand)]
            told += [(leg.installs, responder_id) for leg in legs if leg.installs is not None]
            told += [(dap_id, responder_id) for dap_id in responder.carries]
        return told

    @property
    def everybody(self) -> list[NodeId]:
        """All who go in, alone or in teams."""
        return [*self.responders, *(one for team in self.teams.values() for one in team.members)]

    @cached_property
    def building(self) -> Plan:
        """The plan, loaded, as it lies."""
        plan = load_plan(self.plan)
        return turned(plan, Plan, self.turned_deg) if self.turned_deg else plan

    def person_of(self, responder_id: NodeId) -> Person:
        """How the responder moves."""
        return self.people.get(self.responders[responder_id].person, Person())

    def fault_of(self, node_id: NodeId) -> Fault:
        """What is wrong with a responder's unit or a DAP; with most nothing is."""
        return self.faults.get(node_id, NONE)

    def start_of(self, responder_id: NodeId) -> tuple[float, float, float, float]:
        """North, east, down and heading (rad) of the responder before the first leg."""
        responder = self.responders[responder_id]
        heights_m = {floor.name: floor.height_m for floor in self.building.floors}
        height_m = heights_m[responder.floor]
        north_m, east_m = responder.start_m
        return north_m, east_m, -height_m, math.radians(responder.heading_deg)


def _refuse_ids(everybody: Collection[NodeId], daps: Collection[NodeId]) -> None:
    for node_id in (*everybody, *daps):
        if node_id in RESERVED_IDS:
            raise ValueError(f"id {node_id!r}: is the demo's own; give another")
        if node_id in everybody and node_id in daps:
            raise ValueError(f"id {node_id!r}: a responder and a DAP have it; give each its own")


class Mishap(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What goes wrong in any exercise: with which of its nodes, by id."""

    description: str
    faults: dict[NodeId, Fault]


def load_scenario(name_or_path: str) -> Scenario:
    """Return the packaged scenario of that name, or the one in the TOML file at that path.

    ``offices+clock_behind`` is ``offices`` with that mishap, packaged or in a TOML file, and more
    may follow. Raises ``shared.config.ConfigError`` if there is none or it, or its plan, cannot be
    used. A plan that is a path is taken from the scenario's folder.
    """
    name, *mishaps = name_or_path.split("+") if not Path(name_or_path).exists() else [name_or_path]
    path = packaged_or_path(name, SCENARIOS)
    scenario = load_toml(path, Scenario)
    for mishap in mishaps:
        told = load_toml(packaged_or_path(mishap, MISHAPS), Mishap)
        for twice in sorted(scenario.faults.keys() & told.faults.keys()):
            raise ConfigError(f"{mishap}: something is wrong with {twice} already; leave one out")
        scenario = msgspec.structs.replace(scenario, faults=scenario.faults | told.faults)
    if scenario.plan.endswith(".toml"):
        scenario = msgspec.structs.replace(scenario, plan=str(path.parent / scenario.plan))
    scenario = _as_it_lies(_with_teams(scenario))
    complaints = misplaced(scenario.faults, scenario.responders, scenario.daps)
    for complaint in (*complaints, *_out_of_place(scenario)):
        raise ConfigError(f"{path}: {complaint}")
    return scenario


def _with_teams(scenario: Scenario) -> Scenario:
    """Return the scenario with all teams among its responders, and what they carry among its DAPs.

    Raises ``ConfigError`` for two who are called alike.
    """
    everybody = scenario.everybody
    for name in everybody:
        if everybody.count(name) > 1:
            raise ConfigError(f"{name!r} is there more than once among responders and teams")
    responders = dict(scenario.responders)
    for team in scenario.teams.values():
        responders |= team.responders()
    carried = {dap_id: Dap() for each in responders.values() for dap_id in each.carries}
    return msgspec.structs.replace(
        scenario, responders=responders, teams={}, daps=scenario.daps | carried
    )


def _as_it_lies(scenario: Scenario) -> Scenario:
    """Return the scenario with all that it says of places turned by ``turned_deg``."""
    if not scenario.turned_deg:
        return scenario
    turn_deg = scenario.turned_deg
    return msgspec.structs.replace(
        scenario,
        responders={
            name: msgspec.structs.replace(
                turned(each, Responder, turn_deg), heading_deg=each.heading_deg + turn_deg
            )
            for name, each in scenario.responders.items()
        },
        daps={name: turned(dap, Dap, turn_deg) for name, dap in scenario.daps.items()},
        faults={name: turned(each, Fault, turn_deg) for name, each in scenario.faults.items()},
    )


def _out_of_place(scenario: Scenario) -> Iterator[str]:
    """Say where the responders are sent that the plan does not have."""
    for responder_id, responder in scenario.responders.items():
        where = f"responders.{responder_id}"
        yield from _not_in(scenario.building, "floors", f"{where}.floor", responder.floor)
        if responder.carries and responder.sets_down == "at_sites" and not scenario.building.sites:
            yield f'{where}.sets_down: the plan has no sites; list some, or use "spaced"'
        for index, leg in enumerate(responder.route):
            for complaint in _leg_out_of_place(scenario.building, leg):
                yield f"{where}.route[{index}].{complaint}"


def _leg_out_of_place(plan: Plan, leg: Leg) -> Iterator[str]:
    match leg:
        case Climb():
            yield from _not_in(plan, "stairs", "stairs", leg.stairs)
        case Ride():
            yield from _not_in(plan, "floors", "to_floor", leg.to_floor)
        case Go() if leg.floor is not None:
            yield from _not_in(plan, "floors", "floor", leg.floor)
        case Search():
            for floor in leg.floors:
                yield from _not_in(plan, "floors", "floors", floor)
    if isinstance(leg, Go | Search) and not plan.ways:
        yield "do: the plan has no ways to go by; list some, or move from point to point"


def _not_in(plan: Plan, kind: Literal["floors", "stairs"], key: str, name: str) -> Iterator[str]:
    known = [each.name for each in getattr(plan, kind)]
    if name not in known:
        yield f"{key}: no {name!r} in the plan; use one of {known}"
