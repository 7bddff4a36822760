"""Steps too many or too few are put where they were."""

from __future__ import annotations

import math

import numpy as np
import pytest

from edge_agent.evaluation.step_places import StepsOff, paired, steps_off
from edge_agent.inertial.step_detection import Step
from edge_agent.mounts.interface import Increment
from edge_agent.mounts.step_increment import Direction, step_ahead

LANDED_S = np.array([*np.arange(1.0, 21.0), 23.5, 24.5])
"""Ten steps out, ten back, a rest, and two steps on the spot."""

TURNED_S = 10.5


def told(ended_s: np.ndarray, about_rad: float = math.pi) -> list[Increment]:
    """Return steps that end then, of somebody who turns about at once."""
    turned = np.diff(np.append(0.0, (ended_s > TURNED_S) * about_rad))
    return [
        step_ahead(
            Step(round((end_s - 0.5) * 1e9), round(end_s * 1e9), 0.0, 0.0),
            0.6,
            Direction(0.0, float(turn), 0.0),
        )
        for end_s, turn in zip(ended_s, turned, strict=True)
    ]


@pytest.mark.parametrize(
    ("more_s", "missed", "off"),
    [
        ([], [], StepsOff(0, 0, 0, 0, 0)),
        ([0.4], [], StepsOff(1, 0, 0, 0, 0)),
        ([], [4, 15], StepsOff(0, -2, 0, 0, 0)),
        ([12.45], [], StepsOff(0, 0, 1, 0, 0)),
        ([], [19], StepsOff(0, 0, 0, -1, 0)),
        ([26.0, 27.0], [20], StepsOff(0, 0, 0, 0, 1)),
        ([0.4], [8], StepsOff(1, 0, -1, 0, 0)),
    ],
)
def test_errors_are_put_where_they_were(
    more_s: list[float], missed: list[int], off: StepsOff
) -> None:
    ended_s = np.sort(np.append(np.delete(LANDED_S, missed), more_s))
    found = steps_off(told(ended_s), LANDED_S)
    assert found == off
    assert sum(off) == len(ended_s) - len(LANDED_S)


def test_who_does_not_turn_about_has_no_places() -> None:
    assert steps_off(told(LANDED_S, 0.5), LANDED_S) is None
    assert steps_off(told(LANDED_S), LANDED_S[:0]) is None
    assert steps_off(told(LANDED_S)[:3], LANDED_S) is None
    assert steps_off(told(LANDED_S), LANDED_S[6:14]) is None


def test_a_landing_is_one_steps_alone() -> None:
    found = paired(np.array([0.9, 1.1, 2.5]), np.array([1.05, 2.0]))
    np.testing.assert_array_equal(found.steps, [False, True, False])
    np.testing.assert_array_equal(found.landings, [True, False])
