"""A boot whose gyro drifts, followed by the heading's aid alone: strides without their samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from edge_agent.inertial.boot_state import STRIDE, Stride
from edge_agent.inertial.heading_aid import HeadingAid
from edge_agent.inertial.stride_path import NO_PATH
from shared.maths.angles import wrap_rad
from shared.maths.rotations import about_down
from shared.messages import ImuSample
from shared.units import NS_PER_S

STRIDE_S, STRIDE_M = 1.1, 1.4

Magnetometer = Callable[[NDArray[np.float64], float], NDArray[np.float64]]
"""What is read (3,) at a place (3,), in the axes of a boot with that heading."""


class Followed(NamedTuple):
    """Errors of heading, clockwise, after each stride; how sure the aid is of it at the end."""

    error_rad: NDArray[np.float64]
    sd_rad: float
    told_rad2: float


def stride_of(start_ns: int, heading_rad: float, turned_rad: float) -> Stride:
    """Return a stride of usual doubt, straight ahead, in the tracker's frame."""
    north_m, east_m = STRIDE_M * math.cos(heading_rad), STRIDE_M * math.sin(heading_rad)
    covariance = np.diag([4e-4, 4e-4, 1e-4, math.radians(0.5) ** 2])
    return Stride(
        kind=STRIDE, start_ns=start_ns, end_ns=start_ns + round(STRIDE_S * NS_PER_S),
        displacement_m=(north_m, east_m, 0.0), heading_change_rad=turned_rad,
        heading_rad=heading_rad, covariance=tuple(map(tuple, covariance.tolist())),
        peak_speed_m_s=4.0, highest_m=0.1, lowest_m=0.0, statistic=0.1, rolling_height_m=0.07,
        path=NO_PATH, nav_from_body=about_down(heading_rad),
    )  # fmt: skip


def headings_along(corners_m: Sequence[tuple[float, float]]) -> Iterator[float]:
    """Return the heading of each stride along the closed way through ``corners_m``, for ever."""
    north_m, east_m = corners_m[-1]
    while True:
        for corner_north_m, corner_east_m in corners_m:
            d_north_m, d_east_m = corner_north_m - north_m, corner_east_m - east_m
            for _ in range(max(1, round(math.hypot(d_north_m, d_east_m) / STRIDE_M))):
                yield math.atan2(d_east_m, d_north_m)
            north_m, east_m = corner_north_m, corner_east_m


def follow(
    aid: HeadingAid,
    headings_rad: Iterator[float],
    minutes: float,
    drift_rad_s: float,
    read: Magnetometer | None,
    chance: np.random.Generator,
) -> Followed:
    """Walk along ``headings_rad`` with a gyro that drifts, correcting as a mount does."""
    place_m, before_rad = np.zeros(3), 0.0
    drifted_rad = frame_turn_rad = told_rad2 = 0.0
    errors_rad = []
    for number in range(round(60.0 * minutes / STRIDE_S)):
        walked_rad = next(headings_rad) + chance.normal(0.0, math.radians(2.0))
        drifted_rad += drift_rad_s * STRIDE_S
        place_m += STRIDE_M * np.array([math.cos(walked_rad), math.sin(walked_rad), 0.0])
        heading_rad = walked_rad + drifted_rad
        start_ns = round(number * STRIDE_S * NS_PER_S)
        stride = stride_of(start_ns, heading_rad, wrap_rad(heading_rad - before_rad))
        before_rad = heading_rad
        if read is not None:
            x, y, z = read(place_m, walked_rad).tolist()
            aid.read(ImuSample(stride.end_ns, (0.0, 0.0, -9.81), (0.0, 0.0, 0.0), (x, y, z)))
        correction = aid.take(stride, frame_turn_rad)
        frame_turn_rad += correction.turn_rad
        told_rad2 += correction.variance_rad2
        errors_rad.append(drifted_rad + frame_turn_rad)
    return Followed(np.array(errors_rad), aid.sd_rad, told_rad2)
