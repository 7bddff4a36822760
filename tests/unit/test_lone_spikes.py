"""Single readings that are wildly wrong, and what only looks like them."""

from __future__ import annotations

import math

import pytest

from edge_agent.mounts.interface import Faults
from edge_agent.mounts.lone_spikes import LoneSpikes
from shared.maths.rotations import Vector3
from shared.messages import ImuSample

CALM_M_S2: Vector3 = (0.2, -0.1, -9.8)
STILL_RAD_S: Vector3 = (0.01, 0.0, 0.02)


def passed(*readings: tuple[Vector3, Vector3]) -> tuple[list[int], int]:
    """Return which of readings at 100 Hz are passed on, in order, and how many are counted out."""
    faults = Faults()
    gate = LoneSpikes(faults)
    samples = [ImuSample(10_000_000 * k, *reading) for k, reading in enumerate(readings)]
    through = [one for sample in samples for one in gate.take(sample)] + gate.finish()
    return [samples.index(one) for one in through], faults.unusable


CALM = (CALM_M_S2, STILL_RAD_S)


@pytest.mark.parametrize(
    "spike",
    [
        ((0.2, 120.0, -9.8), STILL_RAD_S),
        (CALM_M_S2, (0.0, 9.0, 0.0)),
        (CALM_M_S2, (30.0, 30.0, 0.0)),
        ((500.0, 0.0, 0.0), (-50.0, 3.0, 80.0)),
    ],
)
def test_a_single_wild_reading_is_left_out(spike: tuple[Vector3, Vector3]) -> None:
    assert passed(CALM, CALM, spike, CALM, CALM) == ([0, 1, 3, 4], 1)


def test_a_blow_that_lasts_and_what_comes_last_are_passed_on_in_order() -> None:
    blow = ((60.0, 20.0, -9.8), (5.0, 0.0, 0.0))
    assert passed(CALM, blow, blow, CALM) == ([0, 1, 2, 3], 0)
    assert passed(CALM, CALM, blow) == ([0, 1, 2], 0)


def test_a_sudden_turn_is_believed_where_gravity_turns_with_it() -> None:
    """By 30° within one sample, about the x axis: the last force is seen turned back."""
    angle_rad = math.radians(30.0)
    turned = (0.2, -9.8 * math.sin(angle_rad), -9.8 * math.cos(angle_rad))
    knocked = (CALM_M_S2, (angle_rad / 0.01, 0.0, 0.0))
    after = (turned, STILL_RAD_S)
    assert passed(CALM, knocked, after, after) == ([0, 1, 2, 3], 0)
    assert passed(CALM, knocked, CALM, CALM) == ([0, 2, 3], 1)


def test_about_the_vertical_a_large_turn_is_believed() -> None:
    knocked = (CALM_M_S2, (0.0, 0.0, 40.0))
    assert passed(CALM, knocked, CALM) == ([0, 1, 2], 0)


def test_readings_apart_in_time_or_not_numbers_are_for_others_to_judge() -> None:
    gate = LoneSpikes(Faults())
    first, wild = ImuSample(0, *CALM), ImuSample(2_000_000_000, (90.0, 0.0, 0.0), STILL_RAD_S)
    nothing = ImuSample(2_010_000_000, (math.nan, 0.0, math.inf), STILL_RAD_S)
    assert [one for sample in (first, wild) for one in gate.take(sample)] == [first, wild]
    later = ImuSample(2_020_000_000, *CALM)
    through = [one for sample in (nothing, later) for one in gate.take(sample)]
    assert through + gate.finish() == [nothing, later]
