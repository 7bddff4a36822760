"""A team of which nobody knows a heading: the map may be turned any way, until something tells."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest

from command_post.confidence import inside95
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.team_tracker import TeamTracker
from command_post.fusion.track import Estimate
from shared.maths.polygons import inside_polygon
from shared.messages import LocalPosition, OdometryIncrement, PositionFix, RssiPeak
from tests.stride_world import STRIDE_M, STRIDE_S, at_ns, installation, stride, track_start

UNKNOWN_SD_RAD = math.pi
WAYS_DEG = {"r1": [0] * 20 + [60] * 15 + [210] * 12, "r2": [0] * 20 + [60] * 15 + [110] * 12}
"""Which way each stride goes, the map not turned."""
FRAMES_DEG = {"r1": 50.0, "r2": -100.0}
DAPS = {"dap1": 10, "dap2": 20, "dap3": 35}
"""After how many strides each DAP stands; r1 sets it down, r2 passes it."""
R2_LATER_S = 20.0


class Team(NamedTuple):
    """A tracker that has heard two responders, and where they are in the end."""

    tracker: TeamTracker
    places_m: dict[str, complex]
    end_s: float

    def told(self, responder_id: str) -> Estimate:
        """Return the newest estimate."""
        return self.tracker.estimates[responder_id]

    def off_m(self, responder_id: str) -> float:
        """Return how far that is off the truth."""
        estimate = self.told(responder_id)
        return abs(complex(estimate.north_m, estimate.east_m) - self.places_m[responder_id])

    def is_in_region(self, responder_id: str) -> bool:
        """Whether the truth is within the outlines told, or the ellipse where there are none."""
        estimate, place_m = self.told(responder_id), self.places_m[responder_id]
        place = np.array([[place_m.real, place_m.imag]])
        if estimate.regions_m:
            return any(inside_polygon(place, outline)[0] for outline in estimate.regions_m)
        off_m = place - [estimate.north_m, estimate.east_m]
        return bool(inside95(off_m, np.array([estimate.covariance_m2]))[0])


def walked(turned_deg: float, leader_sd_rad: float = UNKNOWN_SD_RAD) -> Team:
    """Walk both ways from one door, the whole map turned; r1 perhaps knows their heading."""
    tracker = TeamTracker(TeamSettings())
    chance = np.random.default_rng(11)
    events: list[tuple[float, str, OdometryIncrement | str]] = []
    places_m = {}
    for name, ways_deg in WAYS_DEG.items():
        later_s = R2_LATER_S if name == "r2" else 0.0
        frame_deg = FRAMES_DEG[name]
        if name == "r1" and leader_sd_rad < UNKNOWN_SD_RAD:
            frame_deg = 0.0
        sd_rad = leader_sd_rad if name == "r1" else UNKNOWN_SD_RAD
        tracker.start(name, track_start(later_s, sd_rad))
        place_m = 0j
        first = 100 - len(ways_deg)
        for number, way_deg in enumerate(ways_deg, start=1):
            time_s = later_s + 2.0 + STRIDE_S * number
            way = math.radians(way_deg + turned_deg)
            place_m += STRIDE_M * complex(math.cos(way), math.sin(way))
            own = STRIDE_M * np.exp(1j * (way - math.radians(frame_deg)))
            own += complex(*(0.02 * chance.standard_normal(2)))
            events.append(
                (time_s, name, stride(time_s, own.real, own.imag, sequence=first - 1 + number))
            )
            events += [(time_s, dap_id, name) for dap_id, count in DAPS.items() if count == number]
        places_m[name] = place_m
    for time_s, node_id, event in sorted(events, key=lambda each: (each[0], each[1])):
        if isinstance(event, OdometryIncrement):
            tracker.move(node_id, event)
        elif event == "r1":
            tracker.install(node_id, installation(time_s, event))
        else:
            tracker.peak(node_id, RssiPeak(
                event_time_ns=at_ns(time_s), sequence=0, responder_id=event, peak_dbm=-40.0,
                width_s=1.0, sample_count=9,
            ))  # fmt: skip
    team = Team(tracker, places_m, max(each[0] for each in events))
    rested(team, team.end_s + 12.0, 100)
    return team


def rested(team: Team, time_s: float, number: int) -> None:
    """Let both stand for a while, so that all is solved that was heard."""
    for name in WAYS_DEG:
        for k in range(2):
            said = stride(time_s + 4.0 * k, 0.0, 0.0, sequence=number + k)
            team.tracker.move(name, said)


@pytest.mark.parametrize("turned_deg", [130.0, -75.0])
def test_where_nobody_knows_a_heading_the_map_may_lie_any_way(turned_deg: float) -> None:
    team = walked(turned_deg)
    one, other = team.told("r1"), team.told("r2")
    assert all(team.is_in_region(name) for name in WAYS_DEG)
    assert all(each.regions_m and each.heading_sd_rad > 1.0 for each in (one, other))
    assert one.status == "lost"
    assert "which way the map is turned is not known" in one.reason
    # How far they are from each other is told all the same, on one map.
    apart_m = abs(complex(one.north_m - other.north_m, one.east_m - other.east_m))
    assert apart_m == pytest.approx(abs(team.places_m["r1"] - team.places_m["r2"]), abs=2.0)


def test_what_tells_where_one_is_turns_the_whole_map() -> None:
    team = walked(130.0)
    place_m = team.places_m["r1"]
    at = LocalPosition(
        north_m=place_m.real, east_m=place_m.imag, down_m=0.0, covariance_m2=(1.0, 0.0, 1.0)
    )
    team.tracker.fix(
        PositionFix(
            event_time_ns=at_ns(team.end_s + 17.0), sequence=0, responder_id="r1", position=at,
            source="commander",
        )
    )  # fmt: skip
    rested(team, team.end_s + 32.0, 102)
    for name in WAYS_DEG:
        assert team.off_m(name) < 3.0
        assert team.is_in_region(name)
        assert team.told(name).status == "tracking"


def test_one_heading_known_turns_the_whole_map() -> None:
    team = walked(130.0, leader_sd_rad=0.05)
    for name in WAYS_DEG:
        assert team.off_m(name) < 4.0
        assert team.told(name).regions_m == ()


def test_afterwards_places_are_told_as_surely_as_the_map_is_turned() -> None:
    team = walked(130.0)
    after = team.tracker.afterwards()
    for name, place_m in team.places_m.items():
        track = after.tracks[name]
        off_m = track.position_m[-1:, :2] - [place_m.real, place_m.imag]
        assert inside95(off_m, track.covariance_m2[-1:])[0]
    nn, _, ee = after.daps["dap3"].position.covariance_m2
    assert nn + ee > 20.0**2
