"""Where a responder really is: the route of a scenario, walked."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from shared.messages import NodeId
from shared.simulation.foot_path import FootPath, rise_share
from shared.simulation.gaits import StrideShape
from shared.simulation.legs import Gait
from shared.simulation.route import Footfall
from shared.simulation.scenario import Scenario
from shared.simulation.set_downs import stance_times_s
from shared.simulation.sole import Sole
from shared.simulation.team_routes import route_of
from shared.simulation.variation import unrest, varied_shapes

Array: TypeAlias = NDArray[np.float64]

BODY_RATE_HZ = 20.0
WALKS_KEPT = 32
SENSOR_PLACE_M = (0.055, 0.14, 0.08)
SENSOR_PLACE_SPREAD_M = (0.006, 0.01, 0.01)
"""The sensor above the sole, ahead of the heel, behind the ball: mean, standard deviation."""


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

    The boot stands from ``reached_s`` to ``left_s`` (k,) at each of ``footfalls``; ``gaits``
    (k - 1) tells how each next one was reached. ``installed`` has when each DAP was set down.
    ``chance`` is what the boot's own motion is drawn from, once that is asked for.
    """

    body: BodyTrack
    footfalls: list[Footfall]
    reached_s: Array
    left_s: Array
    installed: dict[NodeId, float]
    chance: np.random.Generator

    @cached_property
    def gaits(self) -> tuple[Gait, ...]:
        """How each stance but the first was reached."""
        return tuple(fall.gait for fall in self.footfalls[1:])

    @cached_property
    def foot(self) -> FootPath:
        """The pose of the sensor on the boot."""
        return _foot_path(self.footfalls, self.reached_s, self.left_s, self.chance)

    @property
    def stance_time_s(self) -> Array:
        """Middles of the boot's stances (k,)."""
        return np.asarray(0.5 * (self.reached_s + self.left_s))

    @cached_property
    def stance_position_m(self) -> Array:
        """The sensor's place (k, 3) in the middle of each stance, NED."""
        return self.foot.pose(self.stance_time_s)[0]

    @property
    def stride_m(self) -> Array:
        """True lengths of the strides (k - 1,), height included."""
        return np.asarray(np.linalg.norm(np.diff(self.stance_position_m, axis=0), axis=1))


@lru_cache(maxsize=WALKS_KEPT)
def simulate_walk(scenario: Scenario, responder_id: NodeId, seed: int) -> Walk:
    """Return how ``responder_id`` moves in the exercise of ``seed``.

    Raises ``ValueError`` if the route climbs stairs that it has not come to, or is to go where the
    building has no way.
    """
    route, chance = route_of(scenario, responder_id, seed)
    falls = route.footfalls
    reached_s, left_s = stance_times_s(falls, scenario.responders[responder_id].start_s)
    return Walk(
        body=_body_track(falls, reached_s, left_s),
        footfalls=falls,
        reached_s=reached_s,
        left_s=left_s,
        installed={
            dap: float(reached_s[k] + after_s) for dap, (k, after_s) in route.installs.items()
        },
        chance=chance,
    )


def _body_track(falls: list[Footfall], reached_s: Array, left_s: Array) -> BodyTrack:
    """The hip passes over the boot as the boot is in mid-stance, and goes on in between."""
    knots_s = np.column_stack([reached_s, left_s]).ravel()
    moments = np.append(True, np.diff(knots_s) > 0.0)
    places = np.array([[*fall.body_m, fall.facing_rad] for fall in falls]).repeat(2, axis=0)
    # The interpolation divides by differences: those below a nanometre are made none.
    track = PchipInterpolator(knots_s[moments], places[moments].round(9))
    count = max(2, int((knots_s[-1] - knots_s[0]) * BODY_RATE_HZ) + 1)
    time_s = np.linspace(knots_s[0], knots_s[-1], count)
    at = track(time_s)
    for before, fall, from_s, to_s in zip(falls, falls[1:], left_s, reached_s[1:], strict=False):
        if fall.gait == "lift":
            riding = (time_s >= from_s) & (time_s <= to_s)
            share = rise_share((time_s[riding] - from_s) / (to_s - from_s), 0.0, 1.0, fall.ramp)
            at[riding, 2] = before.body_m[2] + share * (fall.body_m[2] - before.body_m[2])
    return BodyTrack(time_s, at[:, :3], at[:, 3])


def _foot_path(
    falls: list[Footfall], reached_s: Array, left_s: Array, chance: np.random.Generator
) -> FootPath:
    place_m = np.array([fall.place_m for fall in falls])
    stride_m = np.linalg.norm(np.diff(place_m, axis=0), axis=1)
    start_s, end_s = left_s[:-1], reached_s[1:]
    gaits = tuple(fall.gait for fall in falls[1:])
    table = varied_shapes(gaits, stride_m, end_s - start_s, chance)
    shape = StrideShape(*table)
    passed = left_s[1:] == reached_s[1:]
    passed[-1:] = False
    return FootPath(
        start_s=start_s,
        duration_s=end_s - start_s,
        shape=table,
        place_m=place_m,
        facing_rad=np.array([fall.facing_rad for fall in falls]),
        posture_rad=np.array([fall.posture_rad for fall in falls]),
        roll_rate_rad_s=np.append(0.0, shape.passing_rad_s * passed),
        ramp=np.array([fall.ramp for fall in falls[1:]]),
        sole=Sole(*chance.normal(SENSOR_PLACE_M, SENSOR_PLACE_SPREAD_M)),
        unrest=unrest(reached_s[0], start_s, end_s, shape.unrest, left_s[-1], chance),
    )
