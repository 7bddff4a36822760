"""Storeys of an unknown building, from the heights that people are at."""

from __future__ import annotations

from command_post.floors import Floor, floors_of


def test_heights_of_one_storey_are_one_floor() -> None:
    assert floors_of([0.1, -0.3, 0.4]) == [Floor(0, 0.07)]


def test_storeys_are_counted_from_the_one_nearest_the_origin_up_is_plus() -> None:
    floors = floors_of([0.2, -3.1, -6.3, 3.0, -3.3])
    assert [(floor.level, floor.down_m) for floor in floors] == [
        (2, -6.3), (1, -3.2), (0, 0.2), (-1, 3.0)
    ]  # fmt: skip


def test_without_anybody_there_is_the_ground() -> None:
    assert floors_of([]) == [Floor(0, 0.0)]
