"""How the sensor sits on the boot: which way is down from gravity, which way forward from gait.

A sensor may be strapped to any side of a boot, any way round. Which of its axes points down can be
read off a stance; which points forward, only off strides: people mostly walk the way they face. So
the direction of each stride is compared with the sensor's own heading. Those aside and backwards
are told by how the foot leans: whichever way one goes, the heel rises higher than the toes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD
from shared.maths.angles import wrap_rad
from shared.maths.rotations import Quaternion, Vector3, angle_between_rad, inverse, rotate

SHORTEST_STRIDE_M = 0.3
"""A shorter stride has no clear direction."""

FLATTEST_LEAN = 0.03
"""A foot that leant less on average does not tell its heel."""

FORWARD_RAD = math.radians(60.0)
"""A stride is one forward if it goes the way the foot leant to within this."""

OTHER_WEIGHT = 0.1
"""Of any other stride, in strides forward."""

MOST_WEIGHT = 40.0
"""So many strides are remembered: a strap that slips is followed."""

STRIDE_SD_RAD = math.radians(30.0)
"""How far off the way one faces one stride forward may be."""

TOE_OUT_SD_RAD = math.radians(5.0)
"""How far the way one walks is off the way one faces, however many strides are averaged."""

KNOWN_SD_RAD = math.radians(20.0)
"""Known to better than this, it can be said which axis points forward."""

SQUARE_RAD = math.radians(25.0)
"""A mounting further off than this from axes along the boot's is told as askew."""


class Facing(NamedTuple):
    """How far the wearer's heading is clockwise of the tracker's, and how well that is known."""

    offset_rad: float
    sd_rad: float


class Wearing:
    """Takes strides in order; tells how the sensor is worn on the boot. Plain state."""

    def __init__(self) -> None:
        self._north = self._east = self._weight = 0.0
        self._forward: Vector3 = (0.0, 0.0, 0.0)
        self._down: Vector3 = (0.0, 0.0, 0.0)

    def add(
        self,
        displacement_m: Vector3,
        lean: tuple[float, float],
        heading_rad: float,
        turned_rad: float,
        nav_from_sensor: Quaternion,
    ) -> None:
        """Take in a stride in any one level frame, with its sensor's attitude at the end.

        ``lean`` is which way, north and east, the upright of its start leant over it, as a mean
        of sines. ``heading_rad`` is the sensor's at the end by any fixed measure, ``turned_rad``
        how far it turned over the stride.
        """
        north_m, east_m, _ = displacement_m
        length_m = math.hypot(north_m, east_m)
        if length_m < SHORTEST_STRIDE_M:
            return
        lean_north, lean_east = lean
        leant = math.hypot(lean_north, lean_east)
        along = (north_m * lean_north + east_m * lean_east) / length_m
        forward = leant > FLATTEST_LEAN and along > leant * math.cos(FORWARD_RAD)
        weight = 1.0 if forward else OTHER_WEIGHT
        direction_rad = math.atan2(east_m, north_m)
        offset_rad = direction_rad - (heading_rad - 0.5 * turned_rad)
        kept = min(1.0, MOST_WEIGHT / (self._weight + weight))
        self._north = kept * (self._north + weight * math.cos(offset_rad))
        self._east = kept * (self._east + weight * math.sin(offset_rad))
        self._weight = kept * (self._weight + weight)
        sensor_from_nav = inverse(nav_from_sensor)
        ahead_rad = direction_rad + 0.5 * turned_rad
        ahead = (math.cos(ahead_rad), math.sin(ahead_rad), 0.0)
        self._forward = _blend(self._forward, rotate(sensor_from_nav, ahead), weight, kept)
        self._down = _blend(self._down, rotate(sensor_from_nav, (0.0, 0.0, 1.0)), weight, kept)

    @property
    def facing(self) -> Facing:
        """The wearer's heading against the tracker's; unknown before a stride."""
        length = math.hypot(self._north, self._east)
        if length == 0.0:
            return Facing(0.0, UNKNOWN_HEADING_SD_RAD)
        spread_rad2 = -2.0 * math.log(min(1.0, length / self._weight))
        variance_rad2 = TOE_OUT_SD_RAD**2 + (STRIDE_SD_RAD**2 + spread_rad2) / self._weight
        return Facing(
            wrap_rad(math.atan2(self._east, self._north)),
            min(math.sqrt(variance_rad2), UNKNOWN_HEADING_SD_RAD),
        )

    @property
    def known(self) -> bool:
        """Whether gait has told which way is forward."""
        return self.facing.sd_rad < KNOWN_SD_RAD

    def axes(self) -> tuple[Vector3, Vector3, Vector3] | None:
        """Return forward, right and down of the boot in the sensor's axes, once known."""
        if not self.known:
            return None
        down = _unit(self._down)
        along = sum(f * d for f, d in zip(self._forward, down, strict=True))
        fx, fy, fz = (f - along * d for f, d in zip(self._forward, down, strict=True))
        forward = _unit((fx, fy, fz))
        (fx, fy, fz), (dx, dy, dz) = forward, down
        return forward, (dy * fz - dz * fy, dz * fx - dx * fz, dx * fy - dy * fx), down

    def words(self) -> str | None:
        """Say how the sensor is worn, once known."""
        axes = self.axes()
        if axes is None:
            return None
        forward, _, down = axes
        ahead, ahead_off_rad = _nearest_axis(forward)
        below, below_off_rad = _nearest_axis(down)
        askew_rad = max(ahead_off_rad, below_off_rad)
        told = f"Boot sensor found: its {ahead} axis points forward, its {below} axis down"
        if askew_rad > SQUARE_RAD or ahead[1] == below[1]:
            return f"{told}, {math.degrees(askew_rad):.0f}° askew"
        return told


def _blend(old: Vector3, new: Vector3, weight: float, kept: float) -> Vector3:
    x, y, z = (kept * (a + weight * b) for a, b in zip(old, new, strict=True))
    return (x, y, z)


def _unit(vector: Vector3) -> Vector3:
    length = math.hypot(*vector)
    x, y, z = (component / length for component in vector)
    return (x, y, z)


def _nearest_axis(direction: Vector3) -> tuple[str, float]:
    """Return the name, as in ``-y``, of the axis nearest to ``direction``, and the angle to it."""
    index = max(range(3), key=lambda axis: abs(direction[axis]))
    sign = 1.0 if direction[index] > 0.0 else -1.0
    x, y, z = (sign if axis == index else 0.0 for axis in range(3))
    return ("+" if sign > 0.0 else "-") + "xyz"[index], angle_between_rad(direction, (x, y, z))
