"""The stride of one swing: strapdown, closed on zero velocity by linear calibration.

"Step length estimation algorithm for rescue personnel using linear calibration". Over a swing
``t ∈ [0, T]`` the acceleration is ``a(t) = C(t)·f(t) − f_ib``, its integral ``v(t)`` ought to be
zero when the boot stands again, and what is left of it is taken to have grown linearly:
``v_c(t) = v(t) − v(T)·t/T``. The stride is the integral of ``v_c``, vertical part included. A
constant error of acceleration is so removed exactly.
"""

from __future__ import annotations

from typing import NamedTuple

from shared.maths.rotations import Vector3
from shared.units import NS_PER_S


class PathPoint(NamedTuple):
    """Where the boot was at ``time_ns``: north, east, down of where the swing began, metres."""

    time_ns: int
    north_m: float
    east_m: float
    down_m: float


class Stride(NamedTuple):
    """One swing of the boot.

    ``residual_m_s`` is ``v(T)``, what the linear calibration took away. ``path`` has one point a
    sample; the first is the start (zero), the last the whole displacement.
    """

    displacement_m: Vector3
    residual_m_s: Vector3
    duration_s: float
    path: tuple[PathPoint, ...]


class Swing:
    """Velocity over a swing, from the last sample of one stance on."""

    def __init__(self, time_ns: int, force_m_s2: Vector3, gravity_m_s2: float) -> None:
        """Begin at rest at ``time_ns``, with specific force in the level frame and |f_ib|."""
        self._gravity_m_s2 = gravity_m_s2
        self._times_ns = [time_ns]
        self._velocities_m_s: list[Vector3] = [(0.0, 0.0, 0.0)]
        self._acceleration_m_s2 = self._free_of_gravity(force_m_s2)

    @property
    def duration_s(self) -> float:
        """How long it lasts so far."""
        return (self._times_ns[-1] - self._times_ns[0]) / NS_PER_S

    @property
    def start_ns(self) -> int:
        """When it began."""
        return self._times_ns[0]

    def add(self, time_ns: int, force_m_s2: Vector3) -> None:
        """Carry velocity on to a later sample's specific force in the level frame (trapezoid)."""
        half_s = 0.5 * (time_ns - self._times_ns[-1]) / NS_PER_S
        an, ae, ad = self._acceleration_m_s2
        bn, be, bd = self._acceleration_m_s2 = self._free_of_gravity(force_m_s2)
        vn, ve, vd = self._velocities_m_s[-1]
        self._times_ns.append(time_ns)
        self._velocities_m_s.append(
            (vn + half_s * (an + bn), ve + half_s * (ae + be), vd + half_s * (ad + bd))
        )

    def close(self) -> Stride:
        """Return the stride, the boot standing at the last sample (there are two or more)."""
        start_ns = self._times_ns[0]
        whole_ns = self._times_ns[-1] - start_ns
        residual_m_s = self._velocities_m_s[-1]
        rn, re, rd = residual_m_s
        north_m = east_m = down_m = 0.0
        before_ns, un, ue, ud = start_ns, 0.0, 0.0, 0.0
        path: list[PathPoint] = []
        for time_ns, (vn, ve, vd) in zip(self._times_ns, self._velocities_m_s, strict=True):
            share = (time_ns - start_ns) / whole_ns
            half_s = 0.5 * (time_ns - before_ns) / NS_PER_S
            cn, ce, cd = vn - rn * share, ve - re * share, vd - rd * share
            north_m += half_s * (un + cn)
            east_m += half_s * (ue + ce)
            down_m += half_s * (ud + cd)
            path.append(PathPoint(time_ns, north_m, east_m, down_m))
            before_ns, un, ue, ud = time_ns, cn, ce, cd
        displacement_m = (north_m, east_m, down_m)
        return Stride(displacement_m, residual_m_s, whole_ns / NS_PER_S, tuple(path))

    def _free_of_gravity(self, force_m_s2: Vector3) -> Vector3:
        # f_ib points up, which is −down.
        north, east, down = force_m_s2
        return (north, east, down + self._gravity_m_s2)
