"""How a walker's trunk moves: it rises over each leg, swings from side to side, and leans.

Twice a stride the trunk is highest, over the leg that stands, and lowest and fastest while both
feet are down; once a stride it goes to either side, turns and tilts. How much it rises and goes
aside goes by speed as motion capture of ten people found (Orendurff et al., "The effect of walking
speed on center of mass displacement", J. Rehabil. Res. Dev. 41, 2004); people differ around that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PchipInterpolator, PPoly

from shared.simulation.gaits import CRAWL_POSTURE_RAD
from shared.simulation.variation import unrest
from shared.simulation.walker import Walk

Array: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]
TorsoPlace: TypeAlias = Literal["belt", "chest"]

RISE_AT_SPEED = ((0.7, 0.0274), (1.6, 0.0483))
"""m/s, m: how far the centre of mass rises and falls in a step."""
TRUNK_OVER_CENTRE, TRUNK_SPREAD = 1.13, 0.1
"""The trunk rises further, for the legs go the other way; standard deviation of its logarithm. So
nine people with a sensor at the lower back have it, and so their landings below."""
LANDING, LANDING_SPREAD = 0.018, 0.006
LANDING_BY_RISE = -0.05
"""How much of the rise comes six times a stride, where the heel strikes: who rises more than the
others lands more softly, by so much for each unit of the logarithm."""
ASIDE_AT_SPEED = ((0.7, 0.0699), (1.6, 0.0385))
"""m/s, m: how far it goes from side to side in a stride."""
LEAST_RISE_M = 0.008
LEAST_ASIDE_M = 0.015
WIDE_FROM_M_S = 0.5
"""Below this speed one shuffles: the trunk hardly goes aside."""

SETTING_OUT_RISE, SETTING_OUT_RATE = 0.55, 0.5
"""Shares of what is usual: how much the trunk rises in a stride from standing, and how quickly it
steps as that begins. At the lower back of nine people the first step's bounce is a quarter of what
is usual, some 0.45 s after the foot has left, and the second's 0.6."""

STRIDE_SPREAD = 0.07
"""Strides of one person differ by so much of their rise, and of how far they go aside."""
UNREST = 0.6
CRAWLING_RAD = np.radians(-75.0)
CRAWLING_HEIGHT_M = 0.55
SWAY_KNOT_S = 0.6
SWAY = np.array([0.002, 0.002, 2e-4, *np.radians([0.2, 0.25, 0.3])])
"""Of a trunk that only balances: shifts (m), roll, pitch and yaw (rad), standard deviations."""
SETTLED_S = 0.4
"""Who dwells on a foot for longer stands, and the trunk is quiet."""


class Trunk(NamedTuple):
    """One person's trunk where the sensor is.

    ``rise``, ``aside``: shares of what is usual of the centre of mass at a speed. ``second`` is the
    part of the rise that comes four times a stride, and ``second_rad`` its lag, ``landing`` that
    which comes six times; ``third`` the part of the way aside that comes three times; ``surge`` how
    much of its speed the trunk gains and loses over a step; ``limp`` the difference between left
    and right. Angles are amplitudes of roll and yaw over the stride and pitch over the step, then
    lean in walking. ``lever_m`` is how far ahead of the trunk's axis the sensor is.
    """

    rise: float
    aside: float
    second: float
    second_rad: float
    landing: float
    third: float
    surge: float
    limp: float
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    lean_rad: float
    height_m: float
    lever_m: float


def draw_trunk(place: TorsoPlace, chance: np.random.Generator) -> Trunk:
    """Return one person's trunk, at the belt or at the chest."""
    belt = place == "belt"
    roll_deg, pitch_deg, yaw_deg = (4.0, 1.5, 4.5) if belt else (2.0, 1.5, -3.5)
    spread = np.exp(chance.normal(0.0, 0.25, 3))
    more = float(chance.normal(0.0, TRUNK_SPREAD))
    return Trunk(
        rise=TRUNK_OVER_CENTRE * math.exp(more),
        aside=float(np.exp(chance.normal(0.0, 0.2))),
        second=float(chance.normal(0.03, 0.015)),
        second_rad=float(chance.normal(0.8, 0.4)),
        landing=max(0.0, LANDING + LANDING_BY_RISE * more + LANDING_SPREAD * chance.normal()),
        third=float(chance.normal(0.06, 0.03)),
        surge=float(np.clip(chance.normal(0.11, 0.02), 0.04, 0.2)),
        limp=float(chance.normal(0.0, 0.05)),
        roll_rad=float(np.radians(roll_deg) * spread[0]),
        pitch_rad=float(np.radians(pitch_deg) * spread[1]),
        yaw_rad=float(np.radians(yaw_deg) * spread[2]),
        lean_rad=float(np.radians(chance.normal(-3.0, 1.5))),
        height_m=float(chance.normal(1.0 if belt else 1.3, 0.04)),
        lever_m=-0.11 if belt else 0.12,
    )


@dataclass(frozen=True)
class TorsoPath:
    """The pose of a sensor on the trunk; see ``pose``.

    ``body`` goes along the plan (north, east, the floor's down, heading); ``phase`` is the stride's
    (rad, 2π a stride, 0 over the right leg); ``figures`` is, over time: the rise and the way aside
    (m), the surge (m), effort (0 to 1) and crouch (0 to 1). ``unrest`` and ``sway`` are splines
    from time to three shifts (m) and roll, pitch and yaw (rad).
    """

    trunk: Trunk
    body: CubicSpline[np.float64]
    phase: PPoly
    figures: PchipInterpolator
    unrest: CubicSpline[np.float64]
    sway: CubicSpline[np.float64]
    from_s: float
    until_s: float

    def pose(self, time_s: Array) -> tuple[Array, Array]:
        """Return the sensor's position (n, 3) NED and roll, pitch, yaw (n, 3) at ``time_s`` (n,).

        The angles turn the trunk's forward-right-down frame in the order yaw, pitch, roll; yaw is
        continuous, not wrapped. Before the first stride and after the last the trunk stands.
        """
        held_s = np.clip(time_s, self.from_s, self.until_s)
        phase, (rise, aside, surge, effort, crouch) = self.phase(held_s), self.figures(held_s).T
        t, trunk = 2.0 * phase, self.trunk
        limp = 1.0 + trunk.limp * np.cos(phase)
        lowered = 0.5 * rise * limp * (1.0 - np.cos(t))
        # Four and six times a stride, and nothing over the leg that stands.
        lag = trunk.second_rad
        lowered += trunk.second * rise * (np.cos(2.0 * t + lag) - np.cos(lag))
        lowered -= trunk.landing * rise * (np.cos(3.0 * t) - 1.0)
        ahead = trunk.lever_m - surge * np.sin(t)
        right = 0.5 * aside * (np.cos(phase) + trunk.third * np.cos(3.0 * phase))
        roll = trunk.roll_rad * effort * np.sin(phase)
        pitch = trunk.pitch_rad * effort * np.sin(t + 0.6) + trunk.lean_rad * effort
        pitch += CRAWLING_RAD * crouch
        body = self.body(held_s)
        yaw = body[:, 3] + trunk.yaw_rad * effort * np.cos(phase + 0.4)
        height_m = trunk.height_m + (CRAWLING_HEIGHT_M - trunk.height_m) * crouch
        position_m = body[:, :3].copy()
        position_m[:, 0] += ahead * np.cos(yaw) - right * np.sin(yaw)
        position_m[:, 1] += ahead * np.sin(yaw) + right * np.cos(yaw)
        position_m[:, 2] += lowered - height_m
        shift = self.unrest(time_s) + self.sway(time_s)
        return position_m + shift[:, :3], np.column_stack([roll, pitch, yaw]) + shift[:, 3:]


def torso_path(walk: Walk, place: TorsoPlace, chance: np.random.Generator) -> TorsoPath:
    """Return how the trunk of who walks ``walk`` moves at ``place``."""
    trunk = draw_trunk(place, chance)
    body = walk.body
    from_s, until_s = float(body.time_s[0]), float(body.time_s[-1])
    start_s, end_s = walk.left_s[:-1], walk.reached_s[1:]
    carried = np.array([gait == "lift" for gait in walk.gaits], dtype=bool)
    effort = np.where(carried, 0.0, 1.0)
    sway_s = np.arange(from_s - 2.0, until_s + 2.0, SWAY_KNOT_S)
    return TorsoPath(
        trunk=trunk,
        body=CubicSpline(body.time_s, np.column_stack([body.position_m, body.heading_rad])),
        phase=_phase(walk, carried),
        figures=_figures(walk, trunk, effort, chance),
        unrest=unrest(from_s, start_s, end_s, UNREST * effort, until_s, chance),
        sway=CubicSpline(sway_s, SWAY * chance.normal(0.0, 1.0, (len(sway_s), 6))),
        from_s=from_s,
        until_s=until_s,
    )


def _phase(walk: Walk, carried: Mask) -> PPoly:
    """Return the stride's phase (rad) over time, smooth from stride to stride.

    Who sets out or comes to stand does so at ``SETTING_OUT_RATE``, at once: by then nothing moves
    by the phase.
    """
    turns = 2.0 * np.pi * np.append(0.0, np.cumsum(~carried))
    rests = np.flatnonzero(_stood(walk))
    pieces: list[PPoly] = []
    for rest, next_rest in zip(rests, [*rests[1:], None], strict=True):
        if walk.left_s[rest] > walk.reached_s[rest]:
            standing_s = [walk.reached_s[rest], walk.left_s[rest]]
            pieces.append(PchipInterpolator(standing_s, turns[[rest, rest]]))
        if next_rest is not None:
            stepped_s = np.append(walk.left_s[rest], walk.reached_s[rest + 1 : next_rest + 1])
            stepped = turns[rest : next_rest + 1]
            rates = PchipInterpolator(stepped_s, stepped).derivative()(stepped_s)
            rates[[0, -1]] *= SETTING_OUT_RATE
            pieces.append(CubicHermiteSpline(stepped_s, stepped, rates))
    begins_s = np.concatenate([piece.x[:-1] for piece in pieces])
    return PPoly(np.hstack([piece.c for piece in pieces]), np.append(begins_s, pieces[-1].x[-1]))


def _stood(walk: Walk) -> Mask:
    """Return at which stances (k,) one stands, rather than passes over them."""
    stood = walk.left_s - walk.reached_s > SETTLED_S
    stood[[0, -1]] = True
    return np.asarray(stood)


def _figures(
    walk: Walk, trunk: Trunk, effort: Array, chance: np.random.Generator
) -> PchipInterpolator:
    """Each stride has its own in its middle; who stands has none of them, but may crouch."""
    start_s, end_s, stood = walk.left_s[:-1], walk.reached_s[1:], _stood(walk)
    way_m = np.diff(np.array([fall.body_m for fall in walk.footfalls]), axis=0)[:, :2]
    speed_m_s = np.hypot(*way_m.T) / (end_s - start_s)
    varied = np.exp(chance.normal(0.0, STRIDE_SPREAD, (2, len(speed_m_s))))
    rise_m = trunk.rise * np.maximum(_line(RISE_AT_SPEED, speed_m_s), LEAST_RISE_M)
    rise_m[stood[:-1]] *= SETTING_OUT_RISE
    aside_m = trunk.aside * np.maximum(_line(ASIDE_AT_SPEED, speed_m_s), LEAST_ASIDE_M)
    aside_m *= np.minimum(speed_m_s / WIDE_FROM_M_S, 1.0)
    # The integral of what speed gains and loses as often as the trunk rises.
    surge_m = trunk.surge * speed_m_s * (end_s - start_s) / (4.0 * np.pi)
    crouch = np.array([fall.posture_rad for fall in walk.footfalls]) / CRAWL_POSTURE_RAD
    striding = np.column_stack(
        [rise_m * varied[0], aside_m * varied[1], surge_m, np.ones_like(effort)]
    )
    striding *= effort[:, None]
    knots: dict[float, Array] = {}
    for place, (reached_s, left_s) in enumerate(zip(walk.reached_s, walk.left_s, strict=True)):
        if stood[place]:
            quiet = np.array([0.0, 0.0, 0.0, 0.0, crouch[place]])
            knots[float(reached_s)] = knots[float(left_s)] = quiet
        if place < len(striding):
            middle = 0.5 * (crouch[place] + crouch[place + 1])
            knots[float(0.5 * (start_s[place] + end_s[place]))] = np.append(striding[place], middle)
    times_s = sorted(knots)
    return PchipInterpolator(times_s, np.array([knots[time_s] for time_s in times_s]))


def _line(points: tuple[tuple[float, float], tuple[float, float]], x: Array) -> Array:
    (x0, y0), (x1, y1) = points
    return np.asarray(y0 + (y1 - y0) / (x1 - x0) * (x - x0))
