"""What a responder's unit says of their strides, errors and all, without its sensor simulated.

The errors are those that strides of a boot show: a scale and a heading drift that last, jumps of
the heading, strides that go unnoticed (settings: ``odometry_errors.OdometrySettings``). So hours
of a whole team cost moments.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from shared.messages import Activity, LocalPosition, NodeId, OdometryIncrement, Vector3
from shared.simulation.chance import generator
from shared.simulation.faults import NONE, Fault
from shared.simulation.legs import Gait
from shared.simulation.odometry_errors import OdometrySettings
from shared.simulation.scenario import Scenario
from shared.simulation.walker import Walk, simulate_walk

Array: TypeAlias = NDArray[np.float64]
Covariance4: TypeAlias = tuple[
    float, float, float, float, float, float, float, float, float, float
]  # fmt: skip

SETTLES_S = 1.0
"""How long after its wearer has come a unit is ready."""


class UnitStart(NamedTuple):
    """A unit begins to count strides, at ``time_s`` of the exercise.

    ``position`` is where its wearer says they are, if they do.
    """

    time_s: float
    position: LocalPosition | None
    heading_sd_rad: float


class Stride(NamedTuple):
    """A stride as the unit has it, in its own north-east-down frame; times of the exercise.

    ``covariance`` is the upper triangle, row by row, of (north, east, down, heading).
    """

    start_s: float
    end_s: float
    displacement_m: Vector3
    d_heading_rad: float
    heading_rad: float
    covariance: Covariance4
    gait: Gait


def as_increment(
    stride: Stride, start_ns: int, end_ns: int, sequence: int, activity: Activity = "unknown"
) -> OdometryIncrement:
    """Return a stride as an agent tells it, on a clock that dates it so; what it was, for sure."""
    d_north_m, d_east_m, d_down_m = stride.displacement_m
    return OdometryIncrement(
        event_time_ns=end_ns,
        sequence=sequence,
        start_time_ns=start_ns,
        d_north_m=d_north_m,
        d_east_m=d_east_m,
        d_down_m=d_down_m,
        d_heading_rad=stride.d_heading_rad,
        heading_rad=stride.heading_rad,
        covariance=stride.covariance,
        mount="boot",
        activity=activity,
        activity_confidence=0.0 if activity == "unknown" else 1.0,
    )


class _Drift(NamedTuple):
    """A unit's lasting errors, and of each stance (k,) how far its north is off, clockwise."""

    scale: float
    climb_bias_m: float
    north_off_rad: Array


def simulate_odometry(
    scenario: Scenario, responder_id: NodeId, seed: int
) -> Iterator[UnitStart | Stride]:
    """Yield what the unit of ``responder_id`` says in the exercise of ``seed``, by time."""
    walk = simulate_walk(scenario, responder_id, seed)
    settings = scenario.odometry
    fault = scenario.fault_of(responder_id)
    chance = generator(seed, "odometry", responder_id)
    begins_s = float(walk.reached_s[0]) + SETTLES_S
    known_sd_rad = math.radians(scenario.responders[responder_id].heading_sd_deg)
    restarts_s = [time_s for time_s in sorted(fault.restarts_s) if time_s < walk.left_s[-1]]
    missed = chance.random(len(walk.gaits)) < settings.missed
    drift = _drawn_drift(settings, walk, missed, chance)
    first_off_rad = _heading_error(known_sd_rad, chance)
    yield UnitStart(begins_s, _said_place(scenario, responder_id, chance), known_sd_rad)
    ends_s = [*restarts_s, math.inf]
    for stretch, until_s in enumerate(ends_s):
        if stretch:
            first_off_rad = _heading_error(math.pi, chance)
            yield UnitStart(ends_s[stretch - 1], None, math.pi)
        from_s = ends_s[stretch - 1] if stretch else begins_s
        ends = walk.reached_s[1:]
        counted = np.flatnonzero((ends > from_s) & (ends <= until_s) & ~missed)
        yield from _strides(walk, counted, drift, first_off_rad, settings, fault, chance)


def odometry_of(
    walk: Walk, settings: OdometrySettings, heading_sd_rad: float, chance: np.random.Generator
) -> Iterator[Stride]:
    """Yield the strides that a unit counts of ``walk``, heading known to ``heading_sd_rad``."""
    missed = chance.random(len(walk.gaits)) < settings.missed
    drift = _drawn_drift(settings, walk, missed, chance)
    off_rad = _heading_error(heading_sd_rad, chance)
    counted = np.flatnonzero(~missed)
    yield from _strides(walk, counted, drift, off_rad, settings, NONE, chance)


def _drawn_drift(
    settings: OdometrySettings, walk: Walk, missed: NDArray[np.bool_], chance: np.random.Generator
) -> _Drift:
    took_s = np.diff(walk.reached_s)
    count = len(took_s)
    scale = 1.0 + settings.scale * chance.normal()
    climb_bias_m = settings.climb_bias_m * chance.normal()
    wander = np.cumsum(settings.rate_walk_deg_s * np.sqrt(took_s) * chance.normal(size=count))
    rate_deg_s = settings.rate_bias_deg_s * chance.normal() + wander
    jumps = (chance.random(count) < 1.0 / settings.strides_a_jump) | missed
    steps_deg = rate_deg_s * took_s + settings.heading_deg * chance.normal(size=count)
    steps_deg += jumps * settings.jump_deg * chance.normal(size=count)
    return _Drift(scale, climb_bias_m, np.append(0.0, np.cumsum(np.radians(steps_deg))))


def _heading_error(sd_rad: float, chance: np.random.Generator) -> float:
    """Draw how far a unit's first heading is off; of one that knows nothing, anything."""
    if sd_rad >= math.pi:
        return float(chance.uniform(-math.pi, math.pi))
    return float(sd_rad * chance.normal())


def _said_place(
    scenario: Scenario, responder_id: NodeId, chance: np.random.Generator
) -> LocalPosition:
    north_m, east_m, down_m, _ = scenario.start_of(responder_id)
    sd_m = scenario.odometry.start_m
    return LocalPosition(
        north_m=north_m + sd_m * float(chance.normal()),
        east_m=east_m + sd_m * float(chance.normal()),
        down_m=down_m,
        covariance_m2=(sd_m**2, 0.0, sd_m**2),
    )


def _strides(
    walk: Walk,
    counted: NDArray[np.intp],
    drift: _Drift,
    first_off_rad: float,
    settings: OdometrySettings,
    fault: Fault,
    chance: np.random.Generator,
) -> Iterator[Stride]:
    """Yield the strides ``counted`` by a unit that was off by ``first_off_rad`` before the first.

    A unit's heading is the true one less what its north is off; the way it gives a stride is that
    of the middle of the stride.
    """
    if not counted.size:
        return
    place_m = np.array([fall.place_m for fall in walk.footfalls])
    facing_rad = np.array([fall.facing_rad for fall in walk.footfalls])
    off_rad = first_off_rad + drift.north_off_rad - drift.north_off_rad[counted[0]]
    # Of this turn it does not know.
    changed_rad = math.radians(fault.turned_deg) * fault.is_so(walk.reached_s)
    own_rad = facing_rad - off_rad
    off_rad = off_rad + changed_rad
    heading_rad = facing_rad - off_rad
    scale = np.where(fault.is_so(walk.reached_s), fault.scale, 1.0)
    told_heading_rad = own_rad[counted[0]]
    for k in counted:
        moved_m = place_m[k + 1] - place_m[k]
        length_m = float(np.hypot(moved_m[0], moved_m[1]))
        noise = chance.normal(size=3)
        aside_m = settings.place_m + settings.place_per_m * length_m
        turn_rad = -0.5 * (off_rad[k] + off_rad[k + 1])
        cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
        long = float(scale[k + 1]) * drift.scale
        down_m = long * moved_m[2] + settings.height_m * noise[2] + drift.climb_bias_m
        yield Stride(
            start_s=float(walk.left_s[k]),
            end_s=float(walk.reached_s[k + 1]),
            displacement_m=(
                float(long * (moved_m[0] * cosine - moved_m[1] * sine) + aside_m * noise[0]),
                float(long * (moved_m[1] * cosine + moved_m[0] * sine) + aside_m * noise[1]),
                float(down_m),
            ),
            d_heading_rad=float(own_rad[k + 1] - told_heading_rad),
            heading_rad=float(heading_rad[k + 1]),
            covariance=_told_covariance(settings, length_m),
            gait=walk.gaits[k],
        )
        told_heading_rad = own_rad[k + 1]


def _told_covariance(settings: OdometrySettings, length_m: float) -> Covariance4:
    level_m2 = settings.told_place_m**2 + (settings.told_place_per_m * length_m) ** 2
    heading_rad2 = math.radians(settings.told_heading_deg) ** 2
    return (level_m2, 0.0, 0.0, 0.0,
            level_m2, 0.0, 0.0,
            settings.told_height_m**2, 0.0,
            heading_rad2)  # fmt: skip
