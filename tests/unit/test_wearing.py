"""How the sensor is worn: from the direction of strides, and from how the foot leans."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge_agent.inertial.heading import UNKNOWN_HEADING_SD_RAD
from edge_agent.inertial.wearing import Wearing
from shared.maths.angles import wrap_rad
from shared.maths.rotations import (
    Quaternion,
    about_down,
    from_rotation_vector,
    inverse,
    multiply,
    rotate,
)

FORWARD, ASIDE, BACKWARD = 0.0, 0.5 * math.pi, math.pi
LEVEL = (1.0, 0.0, 0.0, 0.0)


def stride(
    wearing: Wearing,
    heading_rad: float,
    way_rad: float = FORWARD,
    mounting: Quaternion = LEVEL,
    offset_rad: float = 0.0,
    *,
    lean: float = 0.2,
) -> None:
    """A stride by a wearer who faces ``heading_rad`` and goes ``way_rad`` clockwise of that.

    ``mounting`` is ``boot_from_sensor``; the tracker's heading is ``offset_rad`` behind theirs.
    """
    direction_rad = heading_rad + way_rad
    wearing.add(
        (1.2 * math.cos(direction_rad), 1.2 * math.sin(direction_rad), 0.0),
        (lean * math.cos(heading_rad), lean * math.sin(heading_rad)),
        heading_rad - offset_rad,
        0.0,
        multiply(about_down(heading_rad), mounting),
    )


def test_nothing_is_known_before_a_stride() -> None:
    wearing = Wearing()
    assert wearing.facing == (0.0, UNKNOWN_HEADING_SD_RAD)
    assert wearing.axes() is None
    assert wearing.words() is None


angles = st.floats(-math.pi, math.pi)


@given(offset_rad=angles, headings_rad=st.lists(angles, min_size=8, max_size=20), tilt_rad=angles)
def test_walking_tells_how_any_mounting_faces(
    offset_rad: float, headings_rad: list[float], tilt_rad: float
) -> None:
    mounting = from_rotation_vector((tilt_rad, 0.7, -0.4))
    wearing = Wearing()
    for heading_rad in headings_rad:
        stride(wearing, heading_rad, mounting=mounting, offset_rad=offset_rad)
    offset, sd_rad = wearing.facing
    assert wrap_rad(offset - offset_rad) == pytest.approx(0.0, abs=1e-9)
    assert sd_rad < math.radians(13.0)
    axes = wearing.axes()
    assert axes is not None
    for axis, along in zip(axes, ((1, 0, 0), (0, 1, 0), (0, 0, 1)), strict=True):
        assert axis == pytest.approx(rotate(inverse(mounting), along), abs=1e-9)


def test_it_gets_surer_with_every_stride() -> None:
    wearing = Wearing()
    sds_rad = []
    for _ in range(20):
        stride(wearing, 0.3)
        sds_rad.append(wearing.facing.sd_rad)
    assert sds_rad == sorted(sds_rad, reverse=True)
    assert sds_rad[0] > math.radians(25.0)
    assert math.radians(5.0) < sds_rad[-1] < math.radians(10.0)


@pytest.mark.parametrize("way_rad", [ASIDE, -ASIDE, BACKWARD])
def test_as_many_strides_aside_or_back_do_not_turn_the_wearer(way_rad: float) -> None:
    wearing = Wearing()
    for _ in range(12):
        stride(wearing, 0.5)
    for _ in range(12):
        stride(wearing, 0.5, way_rad)
    assert wearing.facing.offset_rad == pytest.approx(0.0, abs=0.12)


def test_a_flat_foot_tells_little() -> None:
    wearing = Wearing()
    for _ in range(5):
        stride(wearing, 0.0, lean=0.001)
    assert not wearing.known
    assert wearing.words() is None


@pytest.mark.parametrize(
    ("turn", "words"),
    [
        ((0.0, 0.0, 0.0), "its +x axis points forward, its +z axis down"),
        ((math.pi, 0.0, 0.0), "its +x axis points forward, its -z axis down"),
        ((0.0, 0.0, 0.5 * math.pi), "its -y axis points forward, its +z axis down"),
        ((0.0, -0.7, 0.0), "its +x axis points forward, its +z axis down, 40° askew"),
    ],
)
def test_the_mounting_is_told_in_words(turn: tuple[float, float, float], words: str) -> None:
    wearing = Wearing()
    for _ in range(10):
        stride(wearing, 0.0, mounting=from_rotation_vector(turn))
    assert wearing.words() == f"Boot sensor found: {words}"
