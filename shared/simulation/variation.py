"""No two people, strides or moments are alike: what chance does to the boot's motion."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from shared.simulation.gaits import SHAPES, StrideShape
from shared.simulation.legs import Gait, Person

Array: TypeAlias = NDArray[np.float64]

PERSON_SPREAD = StrideShape(**dict.fromkeys(StrideShape._fields, 0.0))._replace(
    push_rad=0.06,
    reach_rad=0.12,
    descent_m_s=0.15,
    strike_m_s2=0.3,
    roll_rad=0.3,
    yaw_rad=0.3,
    passing_rad_s=0.2,
    unrest=0.15,
)
"""How much people differ in each field: standard deviation of its logarithm."""

STRIDE_SPREAD = StrideShape(**dict.fromkeys(StrideShape._fields, 0.0))._replace(
    push_rad=0.05,
    reach_rad=0.10,
    descent_m_s=0.25,
    arrest_s=0.25,
    carry=0.20,
    strike_m_s2=0.6,
    roll_rad=0.3,
    yaw_rad=0.3,
    passing_rad_s=0.35,
    unrest=0.2,
)
"""How much one person's strides differ, likewise."""

SCALED_BY_LENGTH = (
    "push_rad", "reach_rad", "descent_m_s", "roll_rad", "yaw_rad", "aside_m", "strike_m_s2",
)  # fmt: skip
"""What is smaller in a short stride."""
PASSING_EXPONENT = 1.5

STILL = 0.04
"""Unrest of a standing boot, where that of a walking one is 1."""

UNREST_KNOT_S = 0.025
SLOW_UNREST_KNOTS = 3.0
FAST_UNREST = np.array([2e-5, 2e-5, 1e-5, *np.radians([0.02, 0.01, 0.02])])
SLOW_UNREST = np.array([3e-4, 3e-4, 2e-4, *np.radians([0.5, 0.12, 0.2])])
"""Standard deviations of the unrest: three shifts (m); roll, pitch and yaw (rad)."""


def varied_shapes(
    gaits: tuple[Gait, ...], stride_m: Array, stride_s: Array, chance: np.random.Generator
) -> Array:
    """Return (fields of StrideShape, k): how one person makes each of ``k`` strides.

    A stride shorter than its gait's usual one is also made with a smaller movement, and the slower
    it is the less the boot rolls in passing.
    """
    if not gaits:
        return np.empty((len(StrideShape._fields), 0))
    # A lift's ride is nobody's habit.
    usual = [Person().habit("walk" if gait == "lift" else gait) for gait in gaits]
    length = stride_m / np.array([habit.stride_m for habit in usual])
    speed = length * np.array([habit.stride_s for habit in usual]) / stride_s
    effort = np.clip(0.35 + 0.65 * length, 0.35, 1.2)
    shapes = np.array([SHAPES[gait] for gait in gaits]).T
    shapes *= np.exp(chance.normal(0.0, np.array(PERSON_SPREAD)))[:, None]
    shapes *= np.exp(chance.normal(0.0, np.array(STRIDE_SPREAD)[:, None], shapes.shape))
    scaled = [StrideShape._fields.index(name) for name in SCALED_BY_LENGTH]
    shapes[scaled] *= effort
    shapes[StrideShape._fields.index("passing_rad_s")] *= (
        np.clip(speed, 0.3, 2.0) ** PASSING_EXPONENT
    )
    sides = [StrideShape._fields.index(name) for name in ("roll_rad", "yaw_rad")]
    shapes[sides] *= chance.choice([-1.0, 1.0], 2)[:, None]
    return shapes


def unrest(
    from_s: float,
    start_s: Array,
    end_s: Array,
    strength: Array,
    until_s: float,
    chance: np.random.Generator,
) -> CubicSpline[np.float64]:
    """Return the boot's small random motion as ``FootPath.unrest`` wants it.

    It lasts from ``from_s`` to ``until_s``, of the given ``strength`` (k,) in the strides from
    ``start_s`` to ``end_s`` (k,) and ``STILL`` outside them: a fast trembling, a slow giving way.
    """
    knots_s = np.arange(from_s - 1.0, until_s + 1.0, UNREST_KNOT_S)
    k = np.searchsorted(start_s, knots_s, side="right") - 1
    inside = (k >= 0) & (knots_s < np.append(end_s, -np.inf)[k])
    level = np.where(inside, np.append(strength, STILL)[k], STILL)
    level = gaussian_filter1d(level, 2.0)[:, None]
    fast = chance.normal(0.0, 1.0, (len(knots_s), 6)) * FAST_UNREST
    slow = gaussian_filter1d(chance.normal(0.0, 1.0, (len(knots_s), 6)), SLOW_UNREST_KNOTS, axis=0)
    slow *= math.sqrt(2.0 * math.sqrt(math.pi) * SLOW_UNREST_KNOTS) * SLOW_UNREST
    return CubicSpline(knots_s, level * (fast + slow))
