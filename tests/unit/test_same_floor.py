"""What is heard through a slab counts less than what is heard on one's own floor, or not at all."""

from __future__ import annotations

import pytest

from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.team_tracker import TeamTracker
from shared.messages import Contact
from tests.stride_world import at_ns, installation, stride, track_start
from tests.unit.test_team_tracker import peak_at

STOREY_M = 3.2
STRIDES = 24
PASSED = 18


def climbing(tracker: TeamTracker, responder_id: str, storeys: float) -> None:
    """Let a responder go north, up ``storeys`` on their first eight strides."""
    tracker.start(responder_id, track_start(0.0, heading_sd_rad=0.1))
    for k in range(STRIDES):
        rise_m = storeys * STOREY_M / 8.0 if k < 8 else 0.0
        move = stride(2.0 + 1.1 * k, 1.2, 0.0, sequence=k, d_down_m=-rise_m)
        tracker.move(responder_id, move)


def east_after_a_pass(storeys: float) -> float:
    """Return how far east (m) one is put who passed 6 m west of a DAP, so high above it."""
    tracker = TeamTracker(TeamSettings())
    tracker.install("dap1", installation(0.0, None, (1.2 * PASSED, 6.0)))
    climbing(tracker, "r1", storeys)
    tracker.peak("dap1", peak_at(2.0 + 1.1 * (PASSED - 1), "r1"))
    tracker.move("r1", stride(40.0, 0.0, 0.0, sequence=STRIDES))
    return tracker.estimates["r1"].east_m


def east_after_a_meeting(storeys: float) -> float:
    """Return how far east (m) one is put who met another, said to be 6 m east, so far above."""
    tracker = TeamTracker(TeamSettings(axis=False))
    climbing(tracker, "r1", storeys)
    tracker.start("r2", track_start(0.0, heading_sd_rad=0.1))
    for k in range(STRIDES):
        tracker.move("r2", stride(2.0 + 1.1 * k, 1.2, 6.0 / STRIDES, sequence=k))
    met = Contact(
        event_time_ns=at_ns(2.0 + 1.1 * (STRIDES - 1)), sequence=0, other_id="r2",
        peak_dbm=-40.0, width_s=1.0, sample_count=9,
    )  # fmt: skip
    tracker.contact("r1", met)
    tracker.move("r1", stride(40.0, 0.0, 0.0, sequence=STRIDES))
    return tracker.estimates["r1"].east_m


def test_a_dap_on_ones_own_floor_pulls() -> None:
    assert east_after_a_pass(0.0) > 2.0


def test_a_dap_on_another_floor_pulls_little_and_one_beyond_that_does_not() -> None:
    assert east_after_a_pass(1.0) < 0.25 * east_after_a_pass(0.0)
    assert east_after_a_pass(1.5) == pytest.approx(0.0, abs=0.1)


def test_the_higher_the_less() -> None:
    pulled_m = [east_after_a_pass(storeys) for storeys in (0.0, 0.5, 0.7, 1.0)]
    assert pulled_m == sorted(pulled_m, reverse=True)


def test_so_it_is_with_people_who_meet() -> None:
    assert east_after_a_meeting(0.0) > 1.0
    assert east_after_a_meeting(1.0) == pytest.approx(0.0, abs=0.6)
