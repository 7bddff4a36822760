"""Plans: GeoJSON walls in and out, where they lie, and the axis along which they run."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from command_post.commands.offline import plan as export_plan
from command_post.fusion.settings import FusionSettings
from command_post.fusion.walls import Wall, axis_of
from command_post.plans.plan_file import (
    geojson_of,
    load_walls,
    parse_walls,
    with_plan,
    with_usable_plan,
)
from shared.config import ConfigError

metres = st.floats(-1000.0, 1000.0).map(lambda value: round(value, 3))


def collection(geometry: dict[str, Any], **members: Any) -> bytes:
    feature = {"type": "Feature", "properties": {"floor": 1}, "geometry": geometry}
    return json.dumps({"type": "FeatureCollection", "features": [feature], **members}).encode()


LOCAL = {"clew:frame": "local"}
FAR_LINE = {"type": "LineString", "coordinates": [[0.0, 0.0], [1e300, 1.0]]}
LINE = {"type": "LineString", "coordinates": [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]]}


def test_a_line_is_a_wall_from_point_to_point() -> None:
    walls = parse_walls(collection(LINE, **LOCAL), "x")
    assert walls == (Wall(0.0, 0.0, 0.0, 4.0), Wall(0.0, 4.0, 3.0, 4.0))


def test_polygons_and_whole_numbers_are_read_too() -> None:
    ring = [[0, 0], [4, 0], [4, 3], [0, 0]]
    polygon = {"type": "Polygon", "coordinates": [ring, ring]}
    several = {"type": "MultiPolygon", "coordinates": [[ring], [ring]]}
    assert len(parse_walls(collection(polygon, **LOCAL), "x")) == 6
    assert len(parse_walls(collection(several, **LOCAL), "x")) == 6


def test_degrees_are_metres_from_the_origin() -> None:
    line = {"type": "LineString", "coordinates": [[8.0, 50.0], [8.001, 50.001]]}
    (wall,) = parse_walls(collection(line, **{"clew:origin": [8.0, 50.0]}), "x")
    # A thousandth of a degree at 50 degrees north, by the ellipsoid WGS 84.
    assert (wall.to_north_m, wall.to_east_m) == pytest.approx((111.23, 71.70), abs=0.02)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "no plan"),
        (b"[]", "no plan"),
        (collection(LINE), "lies nowhere"),
        (collection(LINE, **LOCAL, **{"clew:origin": [8.0, 50.0]}), "lies nowhere"),
        (collection(LINE, **{"clew:origin": [8.0, 95.0]}), "longitude"),
        (collection(LINE, **{"clew:origin": [8.0, 50.0]}), "km from the incident"),
        (collection(FAR_LINE, **LOCAL), r"reaches 1e\+297 km"),
        (collection({"type": "Point", "coordinates": [0.0, 0.0]}, **LOCAL), "no plan"),
        (collection({"type": "LineString", "coordinates": [[0.0, 0.0]]}, **LOCAL), "no plan"),
        (collection({"type": "Polygon", "coordinates": []}, **LOCAL), "0 walls"),
    ],
)
def test_what_is_no_plan_is_refused_and_it_says_why(content: bytes, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        parse_walls(content, "x")


@given(st.lists(st.tuples(metres, metres, metres, metres), min_size=1, max_size=9))
def test_what_is_written_is_read(rows: list[tuple[float, float, float, float]]) -> None:
    walls = tuple(wall for wall in (Wall(*row) for row in rows) if wall.length_m > 0.02)
    if walls:
        assert parse_walls(geojson_of(walls), "x") == walls


@given(st.floats(-0.7, 0.7))
def test_a_house_has_the_axis_of_its_walls(askew_rad: float) -> None:
    cosine, sine = math.cos(askew_rad), math.sin(askew_rad)
    house = [
        Wall(0.0, 0.0, 20.0 * cosine, 20.0 * sine),
        Wall(0.0, 0.0, -12.0 * sine, 12.0 * cosine),
        Wall(5.0, 5.0, 8.0, 9.0),
    ]
    assert axis_of(house) == pytest.approx(askew_rad, abs=0.03)


def test_a_round_house_has_no_axis() -> None:
    corners = [(9.0 * math.cos(k / 6.0), 9.0 * math.sin(k / 6.0)) for k in range(38)]
    walls = [Wall(*one, *other) for one, other in pairwise(corners)]
    assert axis_of(walls) is None
    assert axis_of([]) is None


def test_a_scenarios_building_is_a_plan(tmp_path: Path) -> None:
    file = tmp_path / "plan.geojson"
    assert export_plan("offices_diagonal", output=file) == 0
    assert len(load_walls(file)) > 50
    settings = with_plan(FusionSettings(), file)
    assert abs(settings.team.planned_axis_rad or 0.0) == pytest.approx(math.radians(45.0), abs=1e-6)
    assert with_plan(settings, None) is settings
    # A recording keeps it, with all other settings.
    assert msgspec.json.decode(msgspec.json.encode(settings), type=FusionSettings) == settings


def test_a_plan_that_is_of_no_use_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "plan.geojson"
    assert export_plan("round_house", output=file) == 0
    with pytest.raises(ConfigError, match="no axis"):
        with_plan(FusionSettings(), file)
    with pytest.raises(ConfigError, match="cannot be read"):
        load_walls(tmp_path / "none.geojson")


def test_a_post_goes_on_without_a_plan_that_it_cannot_use_and_says_so(tmp_path: Path) -> None:
    file = tmp_path / "plan.geojson"
    settings = FusionSettings()
    kept, why = with_usable_plan(settings, file)
    assert kept is settings
    assert why is not None
    assert why.startswith(f"going on without a plan: {file}: cannot be read")
    file.write_bytes(geojson_of((Wall(0.0, 0.0, 0.0, 5.0),)))
    assert with_usable_plan(settings, file) == (with_plan(settings, file), None)
