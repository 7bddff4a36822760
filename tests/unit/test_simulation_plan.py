"""Buildings: what a straight line meets, and what a plan file may not say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shared.config import ConfigError
from shared.simulation.plan import PLANS, Door, Floor, Plan, Room, Stairs, Wall, load_plan


def house(**changes: object) -> Plan:
    parts: dict[str, object] = {
        "description": "two floors, a brick wall with a door below, a light one above",
        "floors": (Floor("ground", 0.0), Floor("first", 3.0)),
        "walls": (
            Wall("ground", (4.0, -10.0), (4.0, 10.0), "brick", (Door(at_m=10.0, width_m=1.0),)),
            Wall("first", (7.0, -10.0), (7.0, 10.0)),
        ),
    }
    return Plan(**(parts | changes))  # type: ignore[arg-type]


def line(*points: tuple[float, float, float]) -> np.ndarray:
    return np.array(points)


def test_a_wall_is_met_but_not_through_its_door() -> None:
    plan = house()
    beside = plan.walls_crossed(line((0.0, 2.0, -1.0)), line((10.0, 2.0, -1.0)))
    through = plan.walls_crossed(line((0.0, 0.3, -1.0)), line((10.0, 0.3, -1.0)))
    before = plan.walls_crossed(line((0.0, 2.0, -1.0)), line((3.9, 2.0, -1.0)))
    assert (beside.item(), through.item(), before.item()) == (1, 0, 0)


def test_only_walls_of_the_floor_that_the_line_is_on_are_met() -> None:
    plan = house()
    above = plan.walls_crossed(line((0.0, 2.0, -4.0)), line((10.0, 2.0, -4.0)))
    rising = plan.walls_crossed(line((0.0, 2.0, -1.0)), line((10.0, 2.0, -4.0)))
    assert (above.item(), rising.item()) == (1, 2)
    assert plan.floors_crossed(line((0.0, 2.0, -1.0)), line((10.0, 2.0, -4.0))).item() == 1


def test_walls_are_counted_by_class() -> None:
    plan = house()
    ends = line((0.0, 2.0, -1.0)), line((10.0, 2.0, -4.0))
    counts = [plan.walls_crossed(*ends, attenuation).item() for attenuation in ("light", "brick")]
    assert counts == [1, 1]
    assert plan.walls_crossed(*ends, "concrete").item() == 0


def test_many_lines_at_once_are_as_one_by_one() -> None:
    plan = load_plan("house_of_four_daps")
    chance = np.random.default_rng(1)
    from_m = chance.uniform((-14, 1, -1.5), (14, 59, 0), (200, 3))
    to_m = chance.uniform((-14, 1, -1.5), (14, 59, 0), (200, 3))
    together = plan.walls_crossed(from_m, to_m)
    each = zip(from_m, to_m, strict=True)
    one_by_one = [plan.walls_crossed(a[None], b[None]).item() for a, b in each]
    assert together.tolist() == one_by_one
    assert together.max() > 3


@pytest.mark.parametrize(
    ("down_m", "floor"), [(0.0, 0), (-1.7, 0), (-2.49, 0), (-2.51, 1), (-3.0, 1), (5.0, 0)]
)
def test_feet_on_the_last_steps_are_on_the_upper_floor(down_m: float, floor: int) -> None:
    assert house().floors_of(line((0.0, 0.0, down_m))).item() == floor


def test_a_flight_knows_its_tread() -> None:
    stairs = Stairs("main", "ground", "first", (0.0, 0.0), (0.0, 5.8), 20)
    plan = house(stairs=(stairs,))
    assert plan.flight("main").tread_m == pytest.approx(0.29)
    with pytest.raises(ValueError, match=r"no stairs 'back'.*main"):
        plan.flight("back")


def test_floors_must_rise_and_be_known() -> None:
    with pytest.raises(ValueError, match="rise"):
        house(floors=(Floor("first", 3.0), Floor("ground", 0.0)))
    corners = ((0.0, 0.0), (0.0, 1.0), (1.0, 1.0))
    with pytest.raises(ValueError, match="'attic'"):
        house(rooms=(Room("loft", "attic", corners),))


def test_a_plan_is_found_by_name_or_path(tmp_path: Path) -> None:
    copy = tmp_path / "mine.toml"
    copy.write_text((PLANS / "course_building.toml").read_text(encoding="utf-8"), encoding="utf-8")
    assert load_plan(str(copy)) == load_plan("course_building")
    with pytest.raises(ConfigError, match=r"course_building, .*house_of_four_daps"):
        load_plan("house_of_cards")
    with pytest.raises(ConfigError, match="no such file"):
        load_plan(str(tmp_path / "absent.toml"))


@pytest.mark.parametrize("bend_deg", [90.0, -90.0, 200.0, 1e-3])
def test_a_bent_wall_is_an_arc_with_its_doors_on_it(bend_deg: float) -> None:
    wall = Wall("ground", (0.0, 0.0), (10.0, 0.0), "light", (), bend_deg)
    half_rad = np.radians(bend_deg) / 2.0
    radius_m = 5.0 / np.sin(half_rad)
    assert wall.length_m == pytest.approx(abs(radius_m * 2.0 * half_rad))
    # Clockwise from north: it first goes left of the chord and turns right, about a middle there.
    middle_m = np.array([5.0, radius_m * np.cos(half_rad)])
    for share in np.linspace(0.0, 1.0, 9):
        away_m = wall.at(share * wall.length_m) - middle_m
        assert np.hypot(*away_m) == pytest.approx(abs(radius_m))
    np.testing.assert_allclose(wall.at(0.0), wall.start_m, atol=1e-12)
    np.testing.assert_allclose(wall.at(wall.length_m), wall.end_m, atol=1e-9)


def test_a_bent_wall_is_met_but_not_through_its_door() -> None:
    arc = Wall("ground", (0.0, -10.0), (0.0, 10.0), "brick", (Door(at_m=5.0 * np.pi),), 180.0)
    plan = house(walls=(arc,))
    out = line((0.0, 0.0, -1.0))
    assert plan.walls_crossed(out, line((12.0, 0.0, -1.0))).item() == 0
    assert plan.walls_crossed(out, line((-12.0, 0.0, -1.0))).item() == 0
    np.testing.assert_allclose(plan.doors_m("ground"), arc.at(5.0 * np.pi)[None])
    beyond_m = 1.2 * arc.at(2.0)
    assert plan.walls_crossed(out, line((*beyond_m, -1.0))).item() == 1
    assert len(plan.wall_pieces_m) > 10


def test_a_door_must_be_in_its_wall() -> None:
    with pytest.raises(ValueError, match=r"at_m = 11 is beyond the wall, which is 10.00 m long"):
        Wall("ground", (0.0, 0.0), (0.0, 10.0), doors=(Door(at_m=11.0),))
