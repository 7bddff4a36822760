"""The pose of the sensor on the boot, at any time: analytic, twice continuously differentiable.

In contact the boot rolls over its sole (``sole.Sole``), never quite still; in swing its place on
the ground glides on, lifted. Around that comes a small random motion, which is what keeps a
boot from ever stopping dead.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from shared.simulation.gaits import StrideShape
from shared.simulation.sole import Sole

Array: TypeAlias = NDArray[np.float64]

PUSH_POWER = 5
LOAD_POWER = 3
"""How late and steeply the heel's rise gathers speed, how early and gently the sole comes down."""

AIRBORNE_EDGE = 0.07
"""Share of a stride over which a foot comes free of the ground or meets it, to either side."""


@dataclass(frozen=True)
class FootPath:
    """The strides of one boot (k) between its stances (k + 1), and its unrest.

    A stride starts at ``start_s`` and takes ``duration_s``; before the next the boot stands.
    ``shape`` is (fields of StrideShape, k). Of each stance, ``place_m`` is the point on the ground
    under the sensor when the boot is flat (NED), ``facing_rad`` its heading, ``posture_rad`` the
    pitch it rests at and ``roll_rate_rad_s`` how fast it rolls towards the toe in passing.
    ``ramp`` (k,) is the share of its rise in which a stride gathers speed, and loses it again.
    ``unrest`` is a spline from time to three shifts (m) and roll, pitch and yaw (rad).
    """

    start_s: Array
    duration_s: Array
    shape: Array
    place_m: Array
    facing_rad: Array
    posture_rad: Array
    roll_rate_rad_s: Array
    ramp: Array
    sole: Sole
    unrest: CubicSpline[np.float64]

    def pose(self, time_s: Array) -> tuple[Array, Array]:
        """Return the sensor's position (n, 3) NED and roll, pitch, yaw (n, 3) at ``time_s`` (n,).

        The angles turn the boot's forward-right-down frame in the order yaw, pitch, roll; yaw is
        continuous, not wrapped. Before the first stride and after the last the boot stands.
        """
        if not self.start_s.size:
            return self._standing(time_s)
        k = np.clip(np.searchsorted(self.start_s, time_s, side="right") - 1, 0, None)
        x = np.clip((time_s - self.start_s[k]) / self.duration_s[k], 0.0, 1.0)
        shape = StrideShape(*self.shape[:, k])
        shift = self.unrest(time_s)
        out_and_back = _bump(x, shape.swing_start, shape.swing_end)
        roll = shape.roll_rad * out_and_back + shift[:, 3]
        pitch = self._pitch(k, x, shape) + shift[:, 4]
        turned = _step((x - shape.go_start) / (shape.go_end - shape.go_start))
        yaw = self.facing_rad[k] + (self.facing_rad[k + 1] - self.facing_rad[k]) * turned
        aside_m = shape.aside_m * out_and_back
        ahead_m, height_m = self._rolled(x, pitch, shape)
        right_m = aside_m + height_m * np.sin(roll)
        position_m = self._place(k, x, shape) + shift[:, :3]
        position_m[:, 0] += ahead_m * np.cos(yaw) - right_m * np.sin(yaw)
        position_m[:, 1] += ahead_m * np.sin(yaw) + right_m * np.cos(yaw)
        position_m[:, 2] -= height_m * np.cos(roll)
        yaw += shape.yaw_rad * out_and_back + shift[:, 5]
        return position_m, np.column_stack([roll, pitch, yaw])

    @cached_property
    def _rolling(self) -> CubicSpline[np.float64]:
        return self.sole.rolling()

    def _standing(self, time_s: Array) -> tuple[Array, Array]:
        shift = self.unrest(time_s)
        ahead_m, height_m, _ = self._rolling(self.posture_rad[0] + shift[:, 4]).T
        heading = self.facing_rad[0]
        position_m = self.place_m[0] + shift[:, :3]
        position_m += ahead_m[:, None] * np.array([np.cos(heading), np.sin(heading), 0.0])
        position_m[:, 2] -= height_m
        return position_m, shift[:, 3:] + np.array([0.0, self.posture_rad[0], heading])

    def _pitch(self, k: NDArray[np.intp], x: Array, shape: StrideShape[Array]) -> Array:
        """Push-off, swing, landing, and the slow roll of a stance that is passed through.

        How each gathers and loses speed is fitted to mean profiles of motion-captured walking.
        """
        push = _glide(x, shape.push_start, shape.push_end, 0.76, 0.22, PUSH_POWER)
        swing = _glide(x, shape.swing_start, shape.swing_end, 0.45, 0.5)
        back = shape.load_start + shape.load_end - x
        load = 1.0 - _glide(back, shape.load_start, shape.load_end, 0.72, 0.25, LOAD_POWER)
        after = x > 0.5
        u = 2.0 * (x - after)
        slow = self.roll_rate_rad_s[k + after] * 0.5 * self.duration_s[k] * u * (1.0 - u**4) ** 3
        pitch = self.posture_rad[k] + (self.posture_rad[k + 1] - self.posture_rad[k]) * swing
        pitch += (shape.push_rad + shape.reach_rad) * swing
        return np.asarray(pitch - shape.push_rad * push - shape.reach_rad * load - slow)

    def _rolled(self, x: Array, pitch: Array, shape: StrideShape[Array]) -> tuple[Array, Array]:
        """How far ahead and how high the sensor is: rolled while in contact, free in the air."""
        ahead_m, height_m, free_m = self._rolling(pitch).T
        off = _step((x - shape.push_end + AIRBORNE_EDGE) / (2.0 * AIRBORNE_EDGE))
        on = _step((x - shape.touch + 2.0 * AIRBORNE_EDGE) / (2.0 * AIRBORNE_EDGE))
        return ahead_m, height_m + (off - on) * (free_m - height_m)

    def _place(self, k: NDArray[np.intp], x: Array, shape: StrideShape[Array]) -> Array:
        """The point on the ground that the foot glides over, lifted while it does.

        Its speed is what motion capture leaves once the rolling is taken out.
        """
        duration_s = self.duration_s[k]
        arrest = shape.arrest_s / duration_s
        landed = shape.touch + 0.5 * arrest
        swing = landed - shape.go_start
        even = _glide(x, shape.go_start, landed, 0.3, arrest / swing)
        along = (1.0 - shape.carry) * _glide(x, shape.go_start, shape.go_end, 0.45, 0.4)
        along += shape.carry * even
        rise = rise_share(x, shape.rise_start, shape.rise_end, self.ramp[k])
        way_m = self.place_m[k + 1] - self.place_m[k]
        place_m = self.place_m[k] + way_m * np.column_stack([along, along, rise])
        falling_s = shape.arrest_s * _ramp((landed - x) / arrest)
        lifted = _step((x - shape.go_start) / (0.5 * swing))
        clear_m = shape.lift_m * _bump(x, shape.go_start, landed)
        place_m[:, 2] -= lifted * shape.descent_m_s * falling_s + clear_m
        return place_m


def rise_share(x: Array, start: Array | float, end: Array | float, ramp: Array | float) -> Array:
    """Return the share of its rise (n,) that a foot, or a lift, has made at ``x``.

    It rises from ``start`` to ``end``, gathering and losing speed in ``ramp`` of that each.
    """
    return _glide(x, start, end, ramp, ramp)


def _step(x: Array) -> Array:
    """Go from 0 at x ≤ 0 to 1 at x ≥ 1, with two continuous derivatives."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x * x * x * (10.0 + x * (6.0 * x - 15.0)))


def _ramp(x: Array, power: int = 2) -> Array:
    """Stay 0 up to x = 0, then bend by x = 1 into a line of slope 1 (two continuous derivatives).

    The higher the power, the later the bend.
    """
    bent = np.clip(x, 0.0, 1.0)
    curve = bent ** (power + 1) * (1.0 - power / (power + 2) * bent)
    return np.asarray(curve + np.maximum(x - 1.0, 0.0))


def _glide(
    x: Array,
    start: Array | float,
    end: Array | float,
    up: Array | float,
    down: Array | float,
    power: int = 2,
) -> Array:
    """Go from 0 to 1 over [start, end]: gather speed in the share ``up``, lose it in ``down``."""
    y = (x - start) / (end - start)
    way = up * _ramp(y / up, power) - down * _ramp((y - 1.0 + down) / down)
    return np.asarray(way / (1.0 - up * power / (power + 2) - 0.5 * down))


def _bump(x: Array, start: Array, end: Array) -> Array:
    """Go from 0 up to 1 and back to 0 over [start, end], with two continuous derivatives."""
    y = np.clip((x - start) / (end - start), 0.0, 1.0)
    return np.asarray((4.0 * y * (1.0 - y)) ** 3)
