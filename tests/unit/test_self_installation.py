"""A box that notices that it was set down, by whom, and that it was taken up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
import pytest

from dap_node.self_installation import AtRest, PutDown, SelfInstallation, TakenUp
from shared.messages import Vector3
from shared.units import NS_PER_S
from tests.carries import Felt, Walk, at, readings, samples

SEEDS = range(20)
SET_DOWN_S = 60.0
END_S = 110.0
CARRIER = Walk([0.0, SET_DOWN_S, 68.0, END_S], [0.4, 0.4, 8.0, 30.0])
"""Carries the box for a minute, sets it down and goes on at a metre a second."""

PASSER_BY = Walk([0.0, 30.0, 34.0, 38.0, END_S], [20.0, 6.0, 1.5, 6.0, 20.0])
LINGERER = Walk([0.0, 75.0, 85.0, END_S], [0.4, 0.4, 8.0, 30.0])
"""Carries it, and stays beside it for a quarter of a minute."""

CARRIED = [Felt(SET_DOWN_S - 5.0, "walked with"), Felt(SET_DOWN_S, "held")]
LYING = [*CARRIED, Felt(END_S, "lying")]

Noticed: TypeAlias = PutDown | AtRest | TakenUp


def run(
    walks: Mapping[str, Walk],
    seed: int,
    felt: Sequence[tuple[int, Vector3]] = (),
    *,
    stands: bool = False,
    end_s: float = END_S,
) -> list[Noticed]:
    """Return all that the box notices; what it notices is taken to be so from then on."""
    box = SelfInstallation()
    events: list[tuple[int, str, float | Vector3]] = [(time, "", force) for time, force in felt]
    for number, (name, walk) in enumerate(walks.items()):
        events += [(time, name, dbm) for time, dbm in readings(walk, end_s, seed + 1000 * number)]
    if stands:
        box.stands()
    noticed: list[Noticed] = []
    for time_ns, name, told in sorted(events, key=lambda event: event[0]):
        if isinstance(told, tuple):
            box.feel(time_ns, told)
        else:
            box.hear(time_ns, name, told)
        found = box.tick(time_ns, stands=stands)
        if found is not None:
            noticed.append(found)
            stands = not isinstance(found, TakenUp)
            if stands:
                box.stands()
    return noticed


def offs_s(found: Sequence[Sequence[Noticed]], true_s: float) -> list[float]:
    return [(each[0].time_ns - at(true_s)) / NS_PER_S for each in found if each]


def test_without_an_accelerometer_it_is_who_carried_it_when_they_left() -> None:
    found = [run({"r1": CARRIER, "r2": PASSER_BY}, seed) for seed in SEEDS]
    assert {type(each) for one in found for each in one} == {PutDown}
    assert {each.installer_id for one in found for each in one if isinstance(each, PutDown)} == {
        "r1"
    }
    assert sum(len(one) == 1 for one in found) >= 0.9 * len(SEEDS)
    assert np.abs(offs_s(found, SET_DOWN_S)).max() < 3.0


def test_who_only_passes_by_or_stops_sending_has_not_set_it_down() -> None:
    silent = Walk([0.0, END_S], [0.4, 0.4])
    for seed in SEEDS:
        assert run({"r2": PASSER_BY}, seed) == []
        assert run({"r1": silent}, seed, end_s=SET_DOWN_S) == []


def test_who_stood_beside_a_box_that_stands_has_not_set_it_down_anew() -> None:
    assert all(run({"r1": CARRIER}, seed, stands=True) == [] for seed in SEEDS)


@pytest.mark.parametrize("carrier", [CARRIER, LINGERER])
def test_an_accelerometer_tells_when_to_the_second(carrier: Walk) -> None:
    found = [
        run({"r1": carrier, "r2": PASSER_BY}, seed, samples(LYING, seed)) for seed in SEEDS[:10]
    ]
    assert all(len(one) == 1 for one in found)
    assert {each.installer_id for one in found for each in one if isinstance(each, PutDown)} == {
        "r1"
    }
    assert np.abs(offs_s(found, SET_DOWN_S)).max() < 1.0


def test_a_box_that_is_held_or_was_never_carried_is_not_set_down() -> None:
    held = [Felt(55.0, "walked with"), Felt(END_S, "held")]
    for seed in SEEDS[:10]:
        assert run({"r1": Walk([0.0, END_S], [0.4, 0.4])}, seed, samples(held, seed)) == []
        lying = samples([Felt(END_S, "lying")], seed)
        assert run({"r1": CARRIER}, seed, lying) == []


def test_set_down_where_nobody_is_heard_it_does_not_know_by_whom() -> None:
    assert run({"r1": Walk([0.0, END_S], [15.0, 15.0])}, 0, samples(LYING, 0)) == []


def test_taken_up_and_set_down_elsewhere_it_says_both() -> None:
    felt = [Felt(20.0, "lying"), Felt(50.0, "walked with"), Felt(END_S, "lying")]
    carrier = Walk([0.0, 18.0, 20.0, 50.0, 60.0, END_S], [10.0, 10.0, 0.4, 0.4, 10.0, 30.0])
    for seed in SEEDS[:10]:
        up, down = run({"r1": carrier}, seed, samples(felt, seed), stands=True)
        assert isinstance(up, TakenUp)
        assert isinstance(down, PutDown)
        assert abs(up.time_ns - at(20.0)) < 2 * NS_PER_S
        assert abs(down.time_ns - at(50.0)) < NS_PER_S


def test_a_knock_is_not_taken_for_a_carry_unless_it_falls_over() -> None:
    felt = [Felt(20.0, "lying"), Felt(20.6, "knocked"), Felt(40.0, "lying")]
    for seed in SEEDS[:10]:
        assert run({}, seed, samples(felt, seed), stands=True) == []
        felt_over = samples([*felt, Felt(50.0, "lying")], seed, turned_after_s=20.3)
        over, lies = run({}, seed, felt_over, stands=True)
        assert isinstance(over, TakenUp)
        assert abs(over.time_ns - at(21.0)) < 3 * NS_PER_S
        assert isinstance(lies, AtRest)
        assert abs(lies.time_ns - at(21.0)) < 3 * NS_PER_S
