"""Which belief of a building's axis is acted upon, of several and what each costs."""

from __future__ import annotations

import math

import pytest

from command_post.fusion.team.assembly import NO_AXIS, AxisBelief
from command_post.fusion.team.axis_choice import MOST_WORTH, best_of, rivals_of, worth_of

GIVEN = AxisBelief("given", 0.0, 0.01, frozenset())
PLANNED = GIVEN._replace(axis_rad=0.3)
FREE = AxisBelief("free", 0.7, 10.0, frozenset())
BELIEFS = [GIVEN, FREE, NO_AXIS]
GAIN = 4.0
WORTH = 3.0


def chosen(costs: list[float], held: AxisBelief, *, alone: bool = False) -> AxisBelief:
    """Return which of an axis given, another and none is acted upon at these costs."""
    return BELIEFS[best_of(BELIEFS, costs, held, GAIN, worth=WORTH, alone=alone)]


@pytest.mark.parametrize("held", BELIEFS)
def test_what_is_held_has_the_better_of_a_tie_and_of_no_more(held: AxisBelief) -> None:
    assert chosen([10.0, 11.5, 40.0], GIVEN) == GIVEN
    assert chosen([10.0, 8.5, 40.0], held) == FREE
    assert chosen([10.0, 12.5, 40.0], held) == GIVEN


def test_another_axis_and_none_speak_together_against_the_one_given() -> None:
    assert chosen([10.0, 10.2, 40.0], GIVEN) == GIVEN
    assert chosen([10.0, 40.0, 10.1 - WORTH], GIVEN) == GIVEN
    assert chosen([10.0, 10.2, 10.1 - WORTH], GIVEN) == NO_AXIS


def test_of_who_is_alone_it_takes_more_to_be_held_to_an_axis_or_to_none() -> None:
    costs = [20.0, 40.0, 18.0 - WORTH]
    assert chosen(costs, GIVEN) == NO_AXIS
    assert chosen(costs, GIVEN, alone=True) == GIVEN


def test_an_axis_is_worth_what_it_tells_of_headings_beyond_what_is_known() -> None:
    assert worth_of([0.01, 0.01], [0.01, 0.01]) == 0.0
    assert worth_of([0.01, 0.01], [0.01, 0.04]) == pytest.approx(math.log(2.0))
    assert worth_of([0.02], [0.01]) == 0.0
    assert worth_of([1e-4], [1.0]) == MOST_WORTH


def test_of_two_axes_given_the_one_held_is_kept() -> None:
    both = [PLANNED, *BELIEFS]
    costs = [10.0, 12.0, 40.0, 40.0]
    assert both[best_of(both, costs, GIVEN, GAIN, worth=WORTH, alone=False)] == GIVEN
    assert both[best_of(both, costs, PLANNED, GAIN, worth=WORTH, alone=False)] == PLANNED


def test_rivals_are_as_likely_as_they_cost() -> None:
    of_free, of_none = rivals_of([PLANNED, *BELIEFS], [3.0, 2.0, 2.0, 4.0], GIVEN)
    assert (of_free.mode, of_none.mode) == ("free", "none")
    assert of_free.axis_rad == FREE.axis_rad
    assert of_free.share / of_none.share == pytest.approx(math.e)
    assert of_free.share + of_none.share == pytest.approx(1.0 - of_free.share)
