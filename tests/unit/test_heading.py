"""The first heading: from the earth's field, or owned to be unknown."""

from __future__ import annotations

import math

import pytest

from edge_agent.inertial.heading import (
    MAGNETIC_HEADING_SD_RAD,
    UNKNOWN_HEADING_SD_RAD,
    MagneticHeading,
)
from shared.maths.rotations import Vector3


def compass(*fields_ut: Vector3) -> MagneticHeading:
    found = MagneticHeading()
    for level_field_ut in fields_ut:
        found.add(level_field_ut)
    return found


@pytest.mark.parametrize("heading_rad", [-3.0, -1.0, 0.0, 0.5, 2.0])
def test_the_frame_faces_so_that_the_field_points_north(heading_rad: float) -> None:
    # A frame turned right by the heading sees the field turned left by it.
    field = (25.0 * math.cos(heading_rad), -25.0 * math.sin(heading_rad), 40.0)
    assert compass(field).offset() == pytest.approx((heading_rad, MAGNETIC_HEADING_SD_RAD))


def test_readings_are_averaged() -> None:
    assert compass((20.0, 9.0, 40.0), (20.0, -9.0, 40.0)).offset().heading_rad == 0.0


FOUND = {
    "Ottawa": (17.0, -4.0, 50.0),
    "Quito": (26.0, -1.0, 9.0),
    "Singapore": (40.4, 0.2, -10.5),
    "Cape Town": (9.5, -4.5, -23.5),
    "Sydney": (24.4, 5.5, -51.5),
    "Yakutsk": (13.6, -4.5, 58.8),
}


@pytest.mark.parametrize("where", FOUND)
def test_the_field_is_trusted_all_over_the_earth(where: str) -> None:
    assert compass(FOUND[where]).offset().sd_rad == MAGNETIC_HEADING_SD_RAD


UNKNOWN = {
    "no magnetometer": (),
    "too weak to be the earth's": ((3.0, 0.0, 5.0),),
    "too strong to be the earth's": ((100.0, 0.0, 50.0),),
    "straight down": ((1.0, 1.0, 50.0),),
    "as strong as at the poles, and level": ((60.0, 0.0, 5.0),),
    "as weak as at the equator, and steep": ((7.0, 0.0, 20.0),),
    "not a number": ((math.nan, 20.0, 40.0),),
    "infinite": ((math.inf, -math.inf, 40.0),),
}


@pytest.mark.parametrize("why", UNKNOWN)
def test_without_a_field_to_trust_the_heading_is_unknown(why: str) -> None:
    assert compass(*UNKNOWN[why]).offset() == (0.0, UNKNOWN_HEADING_SD_RAD)
