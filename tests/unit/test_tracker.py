"""Tracks: started, moved, tied, and what has no effect is counted."""

from __future__ import annotations

import math
from collections.abc import Mapping

import pytest

from command_post.fusion.dap_map import InstalledDap
from command_post.fusion.settings import FusionSettings
from command_post.fusion.track import Estimate
from command_post.fusion.tracker import Tracker
from shared.messages import DapInstallation, OdometryIncrement, ProximityEvent, TrackStart
from tests.stride_world import at_ns, installation, proximity, stride, track_start


class Answering:
    """A tracker whose every event is answered with what it changed of its node."""

    def __init__(self, tracks: Tracker) -> None:
        self._tracks = tracks
        self.counts = tracks.counts

    @property
    def estimates(self) -> Mapping[str, Estimate]:
        """The newest estimates."""
        return self._tracks.estimates

    @property
    def daps(self) -> Mapping[str, InstalledDap]:
        """The DAPs that stand."""
        return self._tracks.daps

    def start(self, name: str, start: TrackStart) -> Estimate | None:
        """Begin a track."""
        self._tracks.start(name, start)
        return self._changed(name)

    def move(self, name: str, increment: OdometryIncrement) -> Estimate:
        """Move somebody."""
        self._tracks.move(name, increment)
        estimate = self._changed(name)
        assert estimate is not None
        return estimate

    def near(self, dap_id: str, event: ProximityEvent) -> Estimate | None:
        """Tie somebody to a DAP."""
        self._tracks.near(dap_id, event)
        return self._changed(event.responder_id)

    def install(self, dap_id: str, said: DapInstallation) -> InstalledDap | None:
        """Set down a DAP."""
        self._tracks.install(dap_id, said)
        return dict(self._tracks.take_changes().daps).get(dap_id)

    def _changed(self, name: str) -> Estimate | None:
        return dict(self._tracks.take_changes().estimates).get(name)


def tracker(particles: int = 500) -> Answering:
    return Answering(Tracker(FusionSettings(particles=particles)))


def walk_north(
    tracks: Answering, name: str, count: int, first_s: float = 1.0, first: int = 0
) -> None:
    for k in range(count):
        tracks.move(name, stride(first_s + 1.1 * k, 1.2, 0.0, sequence=first + k))


def test_a_start_is_an_estimate() -> None:
    estimate = tracker().start("r1", track_start(0.0))
    assert estimate is not None
    assert estimate.time_ns == at_ns(0.0)
    assert math.hypot(estimate.north_m, estimate.east_m) < 0.1
    assert estimate.heading_sd_rad == math.pi
    assert estimate.last_proximity_time_ns is None


def test_strides_add_up_and_height_is_dead_reckoned() -> None:
    tracks = tracker()
    tracks.start("r1", track_start(0.0, heading_sd_rad=0.01))
    for k in range(10):
        tracks.move("r1", stride(1.0 + k, 0.0, 1.2, sequence=k, d_down_m=-0.17))
    estimate = tracks.estimates["r1"]
    assert (estimate.north_m, estimate.east_m) == pytest.approx((0.0, 12.0), abs=0.5)
    assert estimate.down_m == pytest.approx(-1.7)
    assert estimate.heading_rad == pytest.approx(math.pi / 2.0, abs=0.05)
    assert estimate.time_ns == at_ns(10.0)


def test_uncertainty_grows_until_a_dap_ties_it() -> None:
    tracks = tracker()
    tracks.install("dap1", installation(0.0, None, (24.0, 0.0)))
    tracks.start("r1", track_start(0.0))
    areas = []
    for k in range(20):
        nn, ne, ee = tracks.move("r1", stride(1.0 + k, 1.2, 0.0, sequence=k)).covariance_m2
        areas.append(nn * ee - ne**2)
    assert areas == sorted(areas)
    tied = tracks.near("dap1", proximity(20.5, "r1"))
    assert tied is not None
    assert tied.last_proximity_time_ns == at_ns(20.5)
    nn, ne, ee = tied.covariance_m2
    assert nn * ee - ne**2 < 0.5 * areas[-1]


def test_a_dap_reveals_the_heading_offset() -> None:
    tracks = tracker()
    tracks.install("dap1", installation(0.0, None, (24.0, 0.0)))
    tracks.start("r1", track_start(0.0, heading_sd_rad=0.5))
    turned = (1.2 * math.cos(-0.4), 1.2 * math.sin(-0.4))
    for k in range(20):
        tracks.move("r1", stride(1.0 + k, *turned, sequence=k))
    assert tracks.estimates["r1"].heading_rad == pytest.approx(-0.4, abs=0.1)
    tracks.near("dap1", proximity(20.5, "r1"))
    assert tracks.estimates["r1"].heading_rad == pytest.approx(0.0, abs=0.15)


def test_repeats_while_standing_still_tell_nothing_new() -> None:
    tracks = tracker()
    tracks.install("dap1", installation(0.0, None, (1.0, 1.0)))
    tracks.start("r1", track_start(0.0))
    first = tracks.near("dap1", proximity(1.0, "r1", phase="entered"))
    later = tracks.near("dap1", proximity(2.0, "r1"))
    assert first is not None
    assert later is not None
    assert later.covariance_m2 == first.covariance_m2
    assert later.last_proximity_time_ns == at_ns(2.0)


def test_leaving_ties_nobody() -> None:
    tracks = tracker()
    tracks.install("dap1", installation(0.0, None, (1.0, 1.0)))
    before = tracks.start("r1", track_start(0.0))
    assert tracks.near("dap1", proximity(1.0, "r1", phase="left")) is None
    assert tracks.estimates["r1"] == before


def test_proximity_that_cannot_be_used_is_counted() -> None:
    tracks = tracker()
    before = tracks.start("r1", track_start(0.0))
    tracks.install("far", installation(0.0, None, (5000.0, 0.0)))
    assert tracks.near("nowhere", proximity(1.0, "r1")) is None
    assert tracks.near("far", proximity(1.0, "r9")) is None
    assert tracks.near("far", proximity(1.0, "r1")) is None
    assert tracks.counts == {"unknown_dap": 1, "untracked_responder": 1, "contradicted": 1}
    assert tracks.estimates["r1"] == before


def test_a_dap_stands_where_its_installer_was_then_even_if_told_late() -> None:
    tracks = tracker()
    tracks.start("r1", track_start(0.0, heading_sd_rad=0.01))
    walk_north(tracks, "r1", 10)
    then = tracks.estimates["r1"]
    walk_north(tracks, "r1", 10, first_s=20.0, first=10)
    dap = tracks.install("dap2", installation(15.0, "r1"))
    assert dap is not None
    assert dap.position == then.position


def test_a_dap_asks_until_it_knows() -> None:
    tracks = tracker()
    tracks.start("r1", track_start(0.0))
    first = tracks.install("dap2", installation(5.0, "r1"))
    assert tracks.install("dap2", installation(5.0, "r1", sequence=1)) == first
    knows = installation(5.0, "r1", (1.0, 1.0), sequence=2)
    assert tracks.install("dap2", knows) is None
    assert tracks.daps["dap2"] == first


def test_someone_without_a_start_is_put_anywhere_then_found() -> None:
    tracks = tracker(particles=3000)
    tracks.install("dap1", installation(0.0, None, (10.0, -8.0)))
    lost = tracks.move("r1", stride(1.0, 1.2, 0.0, sequence=41))
    assert lost.covariance_m2[0] == pytest.approx(900.0, rel=0.2)
    found = tracks.near("dap1", proximity(1.5, "r1"))
    assert found is not None
    assert (found.north_m, found.east_m) == pytest.approx((10.0, -8.0), abs=1.5)
    assert tracks.counts["unknown_start"] == 1
    assert not tracks.counts["lost_increment"]


def test_a_start_heard_late_keeps_the_strides_since() -> None:
    tracks = tracker()
    walk_north(tracks, "r1", 10)
    late = tracks.start("r1", track_start(0.5, heading_sd_rad=0.01))
    assert late is not None
    assert late.north_m == pytest.approx(12.0, abs=0.7)


def test_a_new_start_begins_again_and_a_repeated_or_old_one_does_not() -> None:
    tracks = tracker()
    tracks.start("r1", track_start(0.0))
    walk_north(tracks, "r1", 5)
    walked = tracks.estimates["r1"]
    assert tracks.start("r1", track_start(0.0, sequence=1)) is None
    assert tracks.start("r1", track_start(-60.0, sequence=2)) is None
    assert tracks.estimates["r1"] == walked
    assert tracks.counts["stale_start"] == 1
    again = tracks.start("r1", track_start(100.0))
    assert again is not None
    assert again.north_m == pytest.approx(0.0, abs=0.1)


def test_an_agent_that_begins_anew_goes_on_where_it_was() -> None:
    tracks = tracker()
    first = tracks.start("r1", track_start(0.0, placed=False))
    assert first is not None
    assert first.covariance_m2[0] == pytest.approx(1.0, rel=0.3)
    walk_north(tracks, "r1", 10)
    before = tracks.estimates["r1"]
    after = tracks.start("r1", track_start(100.0, placed=False))
    assert after is not None
    assert after.north_m == pytest.approx(before.north_m, abs=0.2)
    assert after.covariance_m2[2] == pytest.approx(before.covariance_m2[2], rel=0.3)


def test_a_gap_in_the_numbers_widens_the_track() -> None:
    whole, gapped = tracker(), tracker()
    for tracks in (whole, gapped):
        tracks.start("r1", track_start(0.0, heading_sd_rad=0.01))
    walk_north(whole, "r1", 2)
    gapped.move("r1", stride(1.0, 1.2, 0.0, sequence=0))
    gapped.move("r1", stride(2.1, 1.2, 0.0, sequence=3))
    assert gapped.counts["lost_increment"] == 2
    assert gapped.estimates["r1"].covariance_m2[2] > whole.estimates["r1"].covariance_m2[2] + 2.0


def test_a_late_stride_still_moves_and_turns_back_no_clock() -> None:
    tracks = tracker()
    tracks.start("r1", track_start(0.0, heading_sd_rad=0.01))
    tracks.move("r1", stride(1.0, 1.2, 0.0, sequence=0))
    tracks.move("r1", stride(3.2, 1.2, 0.0, sequence=2))
    late = tracks.move("r1", stride(2.1, 0.0, 1.2, sequence=1))
    assert (late.north_m, late.east_m) == pytest.approx((2.4, 1.2), abs=0.5)
    assert late.time_ns == at_ns(3.2)
    assert late.heading_rad == pytest.approx(0.0, abs=0.05)


def test_a_clock_that_was_set_back_is_followed() -> None:
    tracks = tracker()
    tracks.start("r1", track_start(0.0))
    tracks.move("r1", stride(5000.0, 1.2, 0.0, sequence=0))
    assert tracks.move("r1", stride(2.0, 1.2, 0.0, sequence=1)).time_ns == at_ns(2.0)
    assert tracks.install("dap2", installation(3.0, "r1")) is not None


def test_a_unit_that_begins_anew_is_followed_though_its_start_was_lost() -> None:
    tracks = tracker()
    tracks.start("r1", track_start(0.0))
    walk_north(tracks, "r1", 20)
    assert tracks.move("r1", stride(40.0, 1.2, 0.0, sequence=0)).time_ns == at_ns(40.0)
    assert tracks.move("r1", stride(41.1, 1.2, 0.0, sequence=1)).time_ns == at_ns(41.1)
    assert tracks.counts["lost_increment"] == 0


def test_others_do_not_change_a_track_by_one_bit() -> None:
    alone, together = tracker(), tracker()
    together.start("r2", track_start(0.0))
    walk_north(together, "r2", 30)
    for tracks in (alone, together):
        tracks.start("r1", track_start(0.0))
        walk_north(tracks, "r1", 30)
    assert alone.estimates["r1"] == together.estimates["r1"]
    assert together.estimates["r1"].north_m != together.estimates["r2"].north_m


def test_extreme_messages_leave_estimates_within_their_bounds() -> None:
    tracks = tracker()
    tracks.start("r1", track_start(0.0, heading_sd_rad=1e6))
    wild = OdometryIncrement(
        event_time_ns=2**63 - 1, sequence=2**63 - 1, start_time_ns=0, d_north_m=100.0,
        d_east_m=-100.0, d_down_m=100.0, d_heading_rad=1e4, heading_rad=-1e4,
        covariance=(1e12, -1e12, 1e12, 1e12, -1e12, 1e12, 1e12, 1e12, 1e12, 1e12), mount="boot",
    )  # fmt: skip
    tracks.move("r1", stride(1.0, 1.0, 0.0, sequence=0))
    for _ in range(50):
        estimate = tracks.move("r1", wild)
    assert all(math.isfinite(value) for value in (*estimate.covariance_m2, estimate.north_m))
    assert abs(estimate.heading_rad) <= math.pi
