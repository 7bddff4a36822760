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


UNKNOWN = {
    "no magnetometer": (),
    "too weak to be the earth's": ((3.0, 0.0, 5.0),),
    "too strong to be the earth's": ((100.0, 0.0, 50.0),),
    "straight down": ((1.0, 1.0, 50.0),),
    "not a number": ((math.nan, 20.0, 40.0),),
    "infinite": ((math.inf, -math.inf, 40.0),),
}


@pytest.mark.parametrize("why", UNKNOWN)
def test_without_a_field_to_trust_the_heading_is_unknown(why: str) -> None:
    assert compass(*UNKNOWN[why]).offset() == (0.0, UNKNOWN_HEADING_SD_RAD)
