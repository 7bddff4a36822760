"""The plan beneath the page's map: walls, and images placed by a world file or by two points."""

from __future__ import annotations

from pathlib import Path

import pytest

from command_post.plans.plan_images import load_plan
from command_post.plans.plan_view import PNG, Placing, parse_spec, parse_world_file


def place(placing: Placing, column: float, row: float) -> tuple[float, float]:
    """Return north and east of a pixel."""
    a, d, b, e, c, f = placing
    return (d * column + e * row + f, a * column + b * row + c)


def test_two_points_say_how_large_how_turned_and_where() -> None:
    spec = parse_spec("a floor.png@3.2;100,50=20,-5;500,50=0,-5")
    assert (spec.file, spec.height_m) == ("a floor.png", 3.2)
    assert spec.placing is not None
    assert place(spec.placing, 100.0, 50.0) == pytest.approx((20.0, -5.0))
    assert place(spec.placing, 500.0, 50.0) == pytest.approx((0.0, -5.0))
    # To the right is south here: so down the image is west.
    assert place(spec.placing, 100.0, 150.0) == pytest.approx((20.0, -10.0))


def test_a_world_file_tells_of_pixels_middles() -> None:
    placing = parse_world_file("0.1\n0\n0\n-0.1\n-5.0\n20.0\n", "a.pgw")
    assert place(placing, 0.5, 0.5) == pytest.approx((20.0, -5.0))
    assert place(placing, 10.5, 0.5) == pytest.approx((20.0, -4.0))
    assert place(placing, 0.5, 10.5) == pytest.approx((19.0, -5.0))


@pytest.mark.parametrize(
    "text", ["a.png;1,2=3,4", "", "a.png;1,1=0,0;1,1=5,5", "a.png;1,1=0,0;9,9=0,0"]
)
def test_what_places_nothing_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="--plan-image"):
        parse_spec(text)


@pytest.mark.parametrize("text", ["1 2 3", "1 0 0 x 0 0", "1 0 2 0 0 0"])
def test_no_world_file_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"a\.pgw"):
        parse_world_file(text, "a.pgw")


def test_images_are_read_with_their_world_files_and_walls_beside(tmp_path: Path) -> None:
    image, walls = tmp_path / "f0.png", tmp_path / "walls.json"
    image.write_bytes(PNG + b"...")
    with pytest.raises(ValueError, match=r"f0\.pgw beside it"):
        load_plan(None, [str(image)])
    (tmp_path / "f0.pgw").write_text("0.1 0 0 -0.1 0 0")
    walls.write_text(
        '{"type": "FeatureCollection", "clew:frame": "local", "features": [{"type": "Feature",'
        '"geometry": {"type": "LineString", "coordinates": [[1.0, 2.0], [1.0, 9.0]]}}]}'
    )
    plan = load_plan(walls, [f"{image}@-3"])
    assert plan.images == (PNG + b"...",)
    assert plan.view.images[0].down_m == 3.0
    (wall,) = plan.view.walls_m
    assert (wall.from_north_m, wall.from_east_m, wall.to_north_m) == (2.0, 1.0, 9.0)
    image.write_bytes(b"GIF89a")
    with pytest.raises(ValueError, match="not a PNG"):
        load_plan(tmp_path / "none.json", [str(image)])
