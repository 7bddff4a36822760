"""The team's tracker: what it makes of an exercise; and the order of arrival leaves no trace."""

from __future__ import annotations

import math
from copy import deepcopy
from typing import Any

import msgspec
import numpy as np
import pytest

from command_post.fusion.team import front
from command_post.fusion.team.front import told_by_cloud
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.team_tracker import TeamTracker
from command_post.fusion.track import Estimate
from shared.codec import Refusal, decode, parse_key
from shared.messages import (
    Contact,
    DapInstallation,
    LocalPosition,
    Message,
    Mount,
    OdometryIncrement,
    PositionFix,
    ProximityEvent,
    RssiPeak,
    TrackStart,
    Truth,
)
from shared.units import NS_PER_S
from tests.stride_world import at_ns, exercise, installation, stride, track_start


def give(tracker: TeamTracker, node_id: str, message: Message) -> None:
    match message:
        case TrackStart():
            tracker.start(node_id, message)
        case OdometryIncrement():
            tracker.move(node_id, message)
        case ProximityEvent():
            tracker.near(node_id, message)
        case RssiPeak():
            tracker.peak(node_id, message)
        case Contact():
            tracker.contact(node_id, message)
        case DapInstallation():
            tracker.install(node_id, message)


def heard(seed: int) -> list[tuple[str, Message]]:
    """Return what the nodes of the small world send, truth apart, in the order of arrival."""
    messages = []
    for each in exercise(seed):
        key = parse_key(each.key)
        assert not isinstance(key, Refusal)
        message = decode(key, each.payload)
        assert not isinstance(message, Refusal)
        if not isinstance(message, Truth):
            messages.append((key.node_id, message))
    return messages


def held_in_the_end(messages: list[tuple[str, Message]]) -> dict[str, Estimate]:
    tracker = TeamTracker(TeamSettings())
    for node_id, message in messages:
        give(tracker, node_id, message)
    # One more stride, far enough on for another tick.
    tracker.move("r1", stride(400.0, 0.0, 0.0, sequence=9999))
    return dict(tracker.estimates)


def test_the_order_of_arrival_leaves_no_trace_to_the_bit() -> None:
    messages = heard(3)
    chance = np.random.default_rng(7)
    cut_off = [
        (message.event_time_ns if node != "r2" else max(message.event_time_ns, at_ns(150.0)), index)
        for index, (node, message) in enumerate(messages)
    ]
    late = [messages[index] for _, index in sorted(cut_off)]
    scattered = [messages[index] for index in chance.permutation(len(messages))]
    in_order = held_in_the_end(messages)
    assert held_in_the_end(late) == in_order
    assert held_in_the_end(scattered) == in_order
    assert held_in_the_end(messages + messages[::3]) == in_order


def test_kept_midway_and_taken_up_it_goes_on_to_the_bit() -> None:
    messages = heard(4)
    middle = len(messages) // 2
    # What a unit kept to itself for a minute and a half comes after the restart.
    early_ns = messages[middle][1].event_time_ns - 90 * NS_PER_S
    held_back = [node == "r1" and message.event_time_ns > early_ns for node, message in messages]
    before = [each for each, late in zip(messages[:middle], held_back, strict=False) if not late]
    late = [each for each, late in zip(messages[:middle], held_back, strict=False) if late]
    assert len(late) > 40
    messages = [*before, *late, *messages[middle:]]
    middle = len(before)
    whole, half = TeamTracker(TeamSettings()), TeamTracker(TeamSettings())
    for node_id, message in messages[:middle]:
        give(whole, node_id, message)
        give(half, node_id, message)
    resumed = deepcopy(half)
    assert dict(resumed.estimates) == dict(whole.estimates)
    for node_id, message in messages[middle:]:
        give(whole, node_id, message)
        give(resumed, node_id, message)
    assert dict(resumed.estimates) == dict(whole.estimates)
    assert dict(resumed.daps) == dict(whole.daps)


def test_known_dap_and_start_put_a_turned_frame_right() -> None:
    tracker = TeamTracker(TeamSettings(axis=False))
    off_rad = math.radians(25.0)
    tracker.start("r1", track_start(0.0, heading_sd_rad=0.5))
    tracker.install("dap1", installation(0.0, None, (24.0, 0.0)))
    for k in range(20):
        move = stride(2.0 + 1.1 * k, 1.2 * math.cos(off_rad), -1.2 * math.sin(off_rad), sequence=k)
        tracker.move("r1", move)
    tracker.peak("dap1", peak_at(2.0 + 1.1 * 19, "r1"))
    tracker.move("r1", stride(40.0, 0.0, 0.0, sequence=20))
    estimate = tracker.estimates["r1"]
    assert (estimate.north_m, estimate.east_m) == pytest.approx((24.0, 0.0), abs=0.7)
    assert estimate.last_proximity_time_ns == at_ns(2.0 + 1.1 * 19)


@pytest.mark.parametrize(("mount", "off_m"), [("chest", 1.0), ("boot", 2.5)])
def test_the_scale_of_a_chest_is_learnt_at_a_dap_and_kept(mount: Mount, off_m: float) -> None:
    # Each step is 1.2 m and told as 1.06: past a DAP at 24 m, and as far again.
    tracker = TeamTracker(TeamSettings(axis=False))
    tracker.start("r1", msgspec.structs.replace(track_start(0.0, 0.03), mount=mount))
    tracker.install("dap1", installation(0.0, None, (24.0, 0.0)))
    for k in range(41):
        told_m = 1.06 if k < 40 else 0.0
        tracker.move("r1", stride(2.0 + 1.1 * k, told_m, 0.0, sequence=k))
        if k == 19:
            tracker.peak("dap1", peak_at(2.0 + 1.1 * k, "r1"))
    error_m = tracker.estimates["r1"].north_m - 48.0
    assert error_m == pytest.approx(0.0, abs=off_m) if mount == "chest" else error_m < -off_m


def peak_at(time_s: float, responder_id: str, peak_dbm: float = -40.0) -> RssiPeak:
    return RssiPeak(
        event_time_ns=at_ns(time_s), sequence=0, responder_id=responder_id, peak_dbm=peak_dbm,
        width_s=1.0, sample_count=9,
    )  # fmt: skip


def test_a_unit_that_begins_anew_goes_on_from_where_it_was() -> None:
    tracker = TeamTracker(TeamSettings())
    tracker.start("r1", track_start(0.0, heading_sd_rad=0.05))
    for k in range(10):
        tracker.move("r1", stride(2.0 + k, 1.2, 0.0, sequence=k))
    tracker.start("r1", track_start(13.0, heading_sd_rad=3.1, sequence=1, placed=False))
    tracker.move("r1", stride(30.0, 1.2, 0.0, sequence=0))
    estimate = tracker.estimates["r1"]
    assert (estimate.north_m, estimate.east_m) == pytest.approx((12.6, 0.0), abs=1.5)
    assert estimate.heading_sd_rad > 1.0


def test_who_knows_no_heading_is_on_a_ring_until_a_dap_tells() -> None:
    tracker = TeamTracker(TeamSettings(axis=False))
    tracker.install("dap1", installation(0.0, None, (0.0, 24.0)))
    tracker.start("r1", track_start(0.0, heading_sd_rad=3.2))
    for k in range(20):
        tracker.move("r1", stride(2.0 + 1.1 * k, 1.2, 0.0, sequence=k))
    ring = tracker.estimates["r1"]
    assert ring.status == "lost"
    assert "heading not known" in ring.reason
    assert len(ring.regions_m) == 1
    outline = np.array(ring.regions_m[0])
    assert np.hypot(*outline.T).max() == pytest.approx(24.0, abs=4.0)
    tracker.peak("dap1", peak_at(22.9, "r1"))
    for k in range(20, 25):
        tracker.move("r1", stride(2.0 + 1.1 * k, 1.2, 0.0, sequence=k))
    found = tracker.estimates["r1"]
    assert (found.north_m, found.east_m) == pytest.approx((0.0, 30.0), abs=1.5)
    assert found.status == "tracking"
    assert found.regions_m == ()


def test_what_comes_late_of_who_knows_no_heading_is_not_drawn_anew_each(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drawn = []

    def told(*given: Any) -> Estimate:
        drawn.append(told_by_cloud(*given))
        return drawn[-1]

    monkeypatch.setattr(front, "told_by_cloud", told)
    tracker = TeamTracker(TeamSettings())
    tracker.start("r1", track_start(0.0, math.pi / math.sqrt(3.0)))
    missed = range(10, 50)
    for number in (each for each in range(80) if each not in missed):
        tracker.move("r1", stride(1.0 + number, 1.0, 0.0, sequence=number))
    live = len(drawn)
    assert live >= 40
    estimate = tracker.estimates["r1"]
    for number in missed:
        tracker.move("r1", stride(1.0 + number, 1.0, 0.0, sequence=number))
        assert tracker.estimates["r1"] == estimate
    assert len(drawn) - live <= 1
    # The next tick has them, and where they lead is drawn.
    tracker.move("r1", stride(90.0, 1.0, 0.0, sequence=80))
    assert len(drawn) - live > 1
    assert tracker.estimates["r1"] == drawn[-1] != estimate


def test_a_commanders_word_pulls_a_track() -> None:
    tracker = TeamTracker(TeamSettings())
    tracker.start("r1", track_start(0.0, heading_sd_rad=0.5))
    for k in range(30):
        tracker.move("r1", stride(2.0 + k, 1.2, 0.0, sequence=k))
    place = LocalPosition(north_m=30.0, east_m=18.0, down_m=0.0, covariance_m2=(1.0, 0.0, 1.0))
    tracker.fix(
        PositionFix(
            event_time_ns=at_ns(31.0), sequence=0, responder_id="r1", source="commander",
            position=place,
        )
    )  # fmt: skip
    tracker.move("r1", stride(50.0, 0.0, 0.0, sequence=30))
    estimate = tracker.estimates["r1"]
    assert math.hypot(estimate.north_m - 30.0, estimate.east_m - 18.0) < 3.0


def test_afterwards_knows_better_than_live() -> None:
    tracker = TeamTracker(TeamSettings())
    for node_id, message in heard(5):
        give(tracker, node_id, message)
    afterwards = tracker.afterwards()
    assert sorted(afterwards.tracks) == ["r1", "r2", "r3"]
    for track in afterwards.tracks.values():
        assert len(track.time_s) == len(track.position_m) == len(track.covariance_m2)
        nn, ne, ee = track.covariance_m2.T
        assert (nn * ee > ne**2).all()
    assert set(afterwards.daps) == {"dap1", "dap2", "dap3", "dap4"}
    truth = {"dap2": (0.0, 20.0), "dap3": (0.0, 40.0), "dap4": (-15.0, 40.0)}
    for dap_id, (north_m, east_m) in truth.items():
        place = afterwards.daps[dap_id].position
        assert math.hypot(place.north_m - north_m, place.east_m - east_m) < 3.0


def test_afterwards_who_rides_stood_until_the_ride() -> None:
    tracker = TeamTracker(TeamSettings())
    tracker.start("r1", track_start(0.0, heading_sd_rad=0.03))
    for each in range(1, 6):
        tracker.move("r1", stride(each, 1.0, 0.0, sequence=each))
    ride = msgspec.structs.replace(
        stride(30.0, 0.0, 0.0, sequence=6, d_down_m=-3.0), start_time_ns=at_ns(26.0)
    )
    tracker.move("r1", ride)
    track = tracker.afterwards().tracks["r1"]
    assert (np.diff(track.time_s) > 0.0).all()
    from_start_s = track.time_s - at_ns(0.0) / NS_PER_S
    down_m = np.interp([15.0, 25.0, 28.0, 30.0], from_start_s, track.position_m[:, 2])
    np.testing.assert_allclose(down_m, [0.0, 0.0, -1.5, -3.0], atol=0.02)
