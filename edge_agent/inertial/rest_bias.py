"""The bias of a gyro on a person, who is never quite still: what it reads while they stand.

Who stands sways, by half a degree to and fro, and by some degrees a second: single seconds tell a
bias badly (a boot's, ``gyro_bias.py``, stands better). But swaying leads back to where it began, so
over a whole rest the bias is the slope of what the gyro adds up to, by least squares: the mean rate
would be wrong by all that the sway was off at its ends.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

from shared.maths.rotations import Vector3

Reading: TypeAlias = tuple[float, float, float, float]
"""Rates (rad/s) and the size of force (m/s²)."""

SHORTEST_REST_S = 1.0
SURE_AFTER_S = 0.5
SWAY_S = 0.6
LEAST_SWAY_RAD = math.radians(0.02)
"""How far who rests is turned at the end from how they were at the beginning: what rates scatter,
for so long, and something at the least."""
SWAY_APART_S = 3.0
"""After so long a sway is another one."""

SMOOTHED_S = 0.1
STILL_RAD_S = math.radians(5.0)
STILL_M_S2 = 0.4
"""At rest rates and the size of force, smoothed, stay so near to their means."""

MEAN_S = 2.0
"""What a reading is compared with: its mean over so long."""

FIRST_SD_RAD_S = math.radians(0.5)
WANDER_RAD_S_SQRT_S = math.radians(0.005)
"""Bias of a gyro nobody has calibrated, and how it wanders: with temperature, mostly."""

LARGEST_BIAS_RAD_S = math.radians(3.0)
"""A steady rate beyond this is a turn, and no bias."""


class _Rest(NamedTuple):
    """A rest up to a moment: how long, by how much it seemed to turn, how rates scattered.

    ``area_rad_s`` and ``moment_rad_s2`` are the integrals of the turn, and of the turn times how
    long it had lasted.
    """

    lasted_s: float = 0.0
    turned_rad: Vector3 = (0.0, 0.0, 0.0)
    scatter_rad2_s: float = 0.0
    area_rad_s: Vector3 = (0.0, 0.0, 0.0)
    moment_rad_s2: Vector3 = (0.0, 0.0, 0.0)

    def longer(self, rate_rad_s: Vector3, scatter_rad2_s2: float, duration_s: float) -> _Rest:
        """Return the rest with ``duration_s`` more, in which rates and their scatter were these."""
        middle_s = self.lasted_s + 0.5 * duration_s
        sums = zip(self.turned_rad, self.area_rad_s, self.moment_rad_s2, rate_rad_s, strict=True)
        x, y, z = (
            (
                turned + rate * duration_s,
                area + (turned + 0.5 * rate * duration_s) * duration_s,
                moment + middle_s * (turned + 0.5 * rate * duration_s) * duration_s,
            )
            for turned, area, moment, rate in sums
        )
        turned_rad, area_rad_s, moment_rad_s2 = zip(x, y, z, strict=True)
        return _Rest(
            self.lasted_s + duration_s,
            turned_rad,
            self.scatter_rad2_s + scatter_rad2_s2 * duration_s,
            area_rad_s,
            moment_rad_s2,
        )

    def slope_rad_s(self) -> Vector3:
        """Return how fast it seemed to turn, by least squares."""
        weight, half_s = 12.0 / self.lasted_s**3, 0.5 * self.lasted_s
        x, y, z = (
            weight * (moment - half_s * area)
            for moment, area in zip(self.moment_rad_s2, self.area_rad_s, strict=True)
        )
        return (x, y, z)

    def slope_variance(self) -> float:
        """Return the slope's variance, (rad/s)², of a sway that is another ``SWAY_APART_S`` on."""
        sway_rad2 = LEAST_SWAY_RAD**2 + SWAY_S**2 * self.scatter_rad2_s / self.lasted_s
        apart = self.lasted_s / SWAY_APART_S
        return sway_rad2 / self.lasted_s**2 * 12.0 * apart / ((apart + 1.0) * (apart + 2.0))


class RestBias:
    """Takes rates and the size of force in order; tells the bias and how well it is known.

    A rest counts up to half a second ago, or more: setting out begins before it can be told.
    """

    def __init__(self) -> None:
        self.bias_rad_s: Vector3 = (0.0, 0.0, 0.0)
        self._variance = FIRST_SD_RAD_S**2
        self._before: Vector3 = (0.0, 0.0, 0.0)
        self._variance_before = self._variance
        self._quick: Reading | None = None
        self._slow: Reading = (0.0, 0.0, 0.0, 0.0)
        self._rest = _Rest()
        self._sure = _Rest()

    @property
    def sd_rad_s(self) -> float:
        """Standard deviation of the bias, of each axis."""
        return math.sqrt(self._variance)

    def add(self, rate_rad_s: Vector3, force_m_s2: float, duration_s: float) -> None:
        """Take in a raw rate and the size of force, ``duration_s`` after those before."""
        self._variance += WANDER_RAD_S_SQRT_S**2 * duration_s
        if not self._is_still((*rate_rad_s, force_m_s2), duration_s):
            self._rest = self._sure = _Rest()
            self._before, self._variance_before = self.bias_rad_s, self._variance
            return
        wx, wy, wz = rate_rad_s
        sx, sy, sz, _ = self._slow
        scatter_rad2_s2 = ((wx - sx) ** 2 + (wy - sy) ** 2 + (wz - sz) ** 2) / 3.0
        self._rest = self._rest.longer(rate_rad_s, scatter_rad2_s2, duration_s)
        if self._rest.lasted_s - self._sure.lasted_s >= SURE_AFTER_S:
            if self._sure.lasted_s >= SHORTEST_REST_S:
                self._weigh(self._sure)
            self._sure = self._rest

    def _is_still(self, reading: Reading, duration_s: float) -> bool:
        if self._quick is None:
            self._quick = self._slow = reading
        quickly, slowly = (min(1.0, duration_s / time_s) for time_s in (SMOOTHED_S, MEAN_S))
        self._quick = _towards(self._quick, reading, quickly)
        self._slow = _towards(self._slow, reading, slowly)
        *turns, bounce = (abs(q - s) for q, s in zip(self._quick, self._slow, strict=True))
        return max(turns) < STILL_RAD_S and bounce < STILL_M_S2

    def _weigh(self, rest: _Rest) -> None:
        """Weigh what a rest tells against what was known as it began."""
        x, y, z = rest.slope_rad_s()
        if max(abs(x), abs(y), abs(z)) > LARGEST_BIAS_RAD_S:
            return
        gain = self._variance_before / (self._variance_before + rest.slope_variance())
        bx, by, bz = self._before
        self.bias_rad_s = (bx + gain * (x - bx), by + gain * (y - by), bz + gain * (z - bz))
        self._variance = (1.0 - gain) * self._variance_before


def _towards(old: Reading, new: Reading, share: float) -> Reading:
    """Return ``old`` moved by a share of the way to ``new``."""
    a, b, c, d = old
    w, x, y, z = new
    return (a + share * (w - a), b + share * (x - b), c + share * (y - c), d + share * (z - d))
