"""What a vehicle's mounts tell, about once a second: an increment that the wire can carry."""

from __future__ import annotations

import math
from typing import NamedTuple

from edge_agent.inertial.linear_zupt import PathPoint
from edge_agent.mounts.interface import Increment
from shared.units import NS_PER_S

LONGEST_M = 90.0
"""Of one increment: what goes farther is told in parts. The wire carries 100 m."""

SHUFFLED_M = 0.02
"""Less is no movement."""

MOST_SD_M_S = 50.0
"""Of speed, of which nothing else is known."""

SIDEWAYS_SD_M = 0.1
SLOPE_SD = 0.05
"""Of height: nobody knows how steep it goes, as a share of the way."""


class Drive(NamedTuple):
    """A movement of a vehicle over the level, and how well it is known."""

    start_ns: int
    end_ns: int
    north_m: float
    east_m: float
    d_heading_rad: float
    heading_rad: float
    speed_sd_m_s: float
    heading_variance_rad2: float
    facing_sd_rad: float


def drive_increments(drive: Drive) -> list[Increment]:
    """Return the increments of ``drive``: none if it is none, several if it is too long for one."""
    length_m = math.hypot(drive.north_m, drive.east_m)
    if length_m < SHUFFLED_M or drive.end_ns <= drive.start_ns:
        return []
    parts = max(1, math.ceil(length_m / LONGEST_M))
    bounds_ns = [
        drive.start_ns + (drive.end_ns - drive.start_ns) * part // parts
        for part in range(parts + 1)
    ]
    share = drive._replace(
        north_m=drive.north_m / parts,
        east_m=drive.east_m / parts,
        d_heading_rad=drive.d_heading_rad / parts,
        heading_variance_rad2=drive.heading_variance_rad2 / parts,
    )
    return [
        _increment(
            share._replace(
                start_ns=bounds_ns[part],
                end_ns=bounds_ns[part + 1],
                heading_rad=drive.heading_rad - (parts - 1 - part) * share.d_heading_rad,
            )
        )
        for part in range(parts)
    ]


def _increment(drive: Drive) -> Increment:
    lasted_s = (drive.end_ns - drive.start_ns) / NS_PER_S
    length_m = math.hypot(drive.north_m, drive.east_m)
    way_rad = math.atan2(drive.east_m, drive.north_m)
    c, s = math.cos(way_rad), math.sin(way_rad)
    along_m2 = (min(drive.speed_sd_m_s, MOST_SD_M_S) * lasted_s) ** 2
    hh = drive.heading_variance_rad2
    # Derivative of the way by the heading error at its end, which grew evenly.
    gn, ge = -0.5 * drive.east_m, 0.5 * drive.north_m
    aside_m2 = SIDEWAYS_SD_M**2
    covariance = (
        along_m2 * c * c + aside_m2 * s * s + hh * gn * gn,
        (along_m2 - aside_m2) * c * s + hh * gn * ge, 0.0, hh * gn,
        along_m2 * s * s + aside_m2 * c * c + hh * ge * ge, 0.0, hh * ge,
        SIDEWAYS_SD_M**2 + (SLOPE_SD * length_m) ** 2, 0.0,
        hh,
    )  # fmt: skip
    return Increment(
        drive.start_ns,
        drive.end_ns,
        (drive.north_m, drive.east_m, 0.0),
        drive.d_heading_rad,
        drive.heading_rad,
        covariance,
        (PathPoint(drive.start_ns, 0.0, 0.0, 0.0),),
        facing_sd_rad=drive.facing_sd_rad,
        steps=0,
        activity="unknown",
    )
