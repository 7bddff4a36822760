"""Where the incident lies on the Earth: there and back, and as the ellipsoid has it."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.geodesy import Origin, parse_origin

metres = st.floats(-2000.0, 2000.0)


@given(st.floats(-85.0, 85.0), st.floats(-179.0, 179.0), st.floats(-180.0, 180.0), metres, metres)
def test_there_and_back_is_where_one_was(
    latitude: float, longitude: float, bearing: float, north_m: float, east_m: float
) -> None:
    origin = Origin(
        latitude_deg=latitude, longitude_deg=longitude, height_m=40.0, bearing_deg=bearing
    )
    back = origin.local(origin.geodetic(north_m, east_m, -3.0))
    assert back == pytest.approx((north_m, east_m, -3.0), abs=1e-5)


def test_a_degree_is_as_long_as_the_ellipsoid_has_it() -> None:
    origin = Origin(latitude_deg=45.0, longitude_deg=0.0)
    place = origin.geodetic(100.0, 0.0, 0.0)
    # Radius of curvature in the meridian of WGS 84 at 45 degrees: 6,367,381.8 m.
    assert place.latitude_deg - 45.0 == pytest.approx(math.degrees(100.0 / 6_367_381.8), rel=1e-6)
    assert place.longitude_deg == pytest.approx(0.0, abs=1e-12)


def test_the_bearing_turns_the_incidents_north_clockwise() -> None:
    origin = Origin(latitude_deg=0.0, longitude_deg=0.0, bearing_deg=90.0)
    place = origin.geodetic(100.0, 0.0, 0.0)
    assert place.longitude_deg > 0.0008
    assert abs(place.latitude_deg) < 1e-9


@pytest.mark.parametrize("text", ["", "37", "37,200", "91,0", "37;127", "a,b", "37,127,1,2,3"])
def test_what_is_no_origin_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=f"^--origin '{text}': "):
        parse_origin(text)


def test_an_origin_is_read() -> None:
    assert parse_origin("37.5, -126.9") == Origin(latitude_deg=37.5, longitude_deg=-126.9)
    whole = Origin(latitude_deg=37.5, longitude_deg=126.9, height_m=38.0, bearing_deg=-12.5)
    assert parse_origin("37.5,126.9,38,-12.5") == whole
