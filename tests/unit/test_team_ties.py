"""What passes, meetings and DAPs that are set down say of where somebody is, and how surely."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from command_post.fusion.team.assembly import AS_TOLD, NO_AXIS, Assembled, assemble
from command_post.fusion.team.log import TeamLog
from command_post.fusion.team.settings import TeamSettings
from shared.messages import Contact
from tests.stride_world import at_ns, installation, stride, track_start
from tests.unit.test_team_tracker import peak_at

SETTINGS = TeamSettings(axis=False)
STRIDE_M = 1.2
STRIDES = 30


def walk(
    log: TeamLog, responder_id: str, *, stride_m: float = STRIDE_M, way_rad: float = 0.0
) -> None:
    """Let a responder go one way, a stride a second."""
    log.add_start(responder_id, track_start(0.0, heading_sd_rad=0.01))
    north_m, east_m = stride_m * math.cos(way_rad), stride_m * math.sin(way_rad)
    for k in range(STRIDES):
        log.add_move(responder_id, stride(2.0 + k, north_m, east_m, sequence=k))


def assembled_of(log: TeamLog) -> Assembled:
    assembled = assemble(log, at_ns(100.0), NO_AXIS, AS_TOLD, SETTINGS)
    assert assembled is not None
    return assembled


def sd_m(assembled: Assembled) -> NDArray[np.float64]:
    """Return the standard deviations of what was heard, in the graph's order."""
    tie = assembled.graph.tie
    return np.asarray(tie[tie[:, 3] > 0.0, 2])


@pytest.mark.parametrize(("apart_s", "blunter"), [(2.0, math.sqrt(2.0)), (10.0, 1.0)])
def test_a_dap_heard_twice_within_one_shadow_says_no_more_than_once(
    apart_s: float, blunter: float
) -> None:
    once, twice = TeamLog(), TeamLog()
    for log, times_s in ((once, [8.0]), (twice, [8.0, 8.0 + apart_s])):
        walk(log, "r1")
        log.add_dap("dap1", installation(0.0, None, (8.0, 0.0)))
        for time_s in times_s:
            log.add_peak("dap1", peak_at(time_s, "r1"))
    assert sd_m(assembled_of(twice)) == pytest.approx(blunter * sd_m(assembled_of(once))[0])


def test_two_daps_passed_at_once_are_shadowed_apart() -> None:
    log = TeamLog()
    walk(log, "r1")
    for dap_id in ("dap1", "dap2"):
        log.add_dap(dap_id, installation(0.0, None, (8.0, 0.0)))
        log.add_peak(dap_id, peak_at(8.0, "r1"))
    assert sd_m(assembled_of(log)) == pytest.approx(SETTINGS.sharpness.sd_at_m(-40.0))


@pytest.mark.parametrize(
    ("peaks_dbm", "used_dbm"),
    [([-51.0], [-51.0]), ([-51.0, -40.0], [-40.0]), ([-55.0], [])],
)
def test_a_faint_peak_is_used_of_who_passed_nothing_nearer(
    peaks_dbm: list[float], used_dbm: list[float]
) -> None:
    log = TeamLog()
    walk(log, "r1")
    log.add_dap("dap1", installation(0.0, None, (8.0, 0.0)))
    for k, peak_dbm in enumerate(peaks_dbm):
        log.add_peak("dap1", peak_at(8.0 + 9.0 * k, "r1", peak_dbm))
    used_m = [SETTINGS.sharpness.sd_at_m(each) for each in used_dbm]
    assert sd_m(assembled_of(log)).tolist() == pytest.approx(used_m)


@pytest.mark.parametrize(("stride_m", "blunter"), [(0.3, math.sqrt(2.0)), (1.2, 1.0)])
def test_who_go_slowly_side_by_side_meet_once(stride_m: float, blunter: float) -> None:
    once, twice = TeamLog(), TeamLog()
    for log, times_s in ((once, [5.0]), (twice, [5.0, 16.0])):
        for responder_id in ("r1", "r2"):
            walk(log, responder_id, stride_m=stride_m)
        for time_s in times_s:
            log.add_contact("r1", met(time_s))
    both = sd_m(assembled_of(twice))
    assert both.size == 4
    assert both == pytest.approx(blunter * sd_m(assembled_of(once))[0])


def met(time_s: float) -> Contact:
    return Contact(
        event_time_ns=at_ns(time_s), sequence=0, other_id="r2", peak_dbm=-45.0, width_s=1.0,
        sample_count=9,
    )  # fmt: skip


@pytest.mark.parametrize("way_deg", [0.0, 90.0, -135.0])
def test_a_dap_stands_before_who_set_it_down(way_deg: float) -> None:
    log, way_rad = TeamLog(), math.radians(way_deg)
    walk(log, "r1", way_rad=way_rad)
    log.add_dap("dap1", installation(60.0, "r1"))
    north_m, east_m = assembled_of(log).graph.tie[0, :2]
    reach_m = SETTINGS.install_ahead_m
    assert (north_m, east_m) == pytest.approx(
        (reach_m * math.cos(way_rad), reach_m * math.sin(way_rad))
    )


def test_who_has_not_moved_sets_it_down_where_they_stand() -> None:
    log = TeamLog()
    log.add_start("r1", track_start(0.0, heading_sd_rad=0.01))
    log.add_dap("dap1", installation(5.0, "r1"))
    assert assembled_of(log).graph.tie[0, :2] == pytest.approx((0.0, 0.0))
