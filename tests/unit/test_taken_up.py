"""A DAP that says it was taken up holds nobody any more, and is found again once it lies still."""

from __future__ import annotations

import math
from collections.abc import Iterable

import pytest

from command_post.fusion.dap_map import DapMap
from command_post.fusion.settings import FusionMethod, FusionSettings
from command_post.fusion.team.settings import TeamSettings
from command_post.fusion.team.team_tracker import TeamTracker
from command_post.incident import Incident, IncidentSettings
from command_post.roster import RosterSettings, make_roster
from shared.codec import encode
from shared.messages import DapInstallation, Message, RssiPeak
from tests.patrol_world import Faults, patrol
from tests.stride_world import at_ns, installation, key_of, stride, track_start
from tests.unit.test_team_tracker import give

Heard = list[tuple[str, Message]]

TAKEN_S, LIES_S, END_S = 110.0, 120.0, 180.0
SPOT_M = (0.0, 15.0)


def taken_up(time_s: float, *, at_rest: bool = False) -> DapInstallation:
    return DapInstallation(
        event_time_ns=at_ns(time_s), sequence=0, installer_id=None, position=None, at_rest=at_rest
    )


def in_order(heard: Iterable[tuple[str, Message]]) -> Heard:
    kept = (each for each in heard if each[1].event_time_ns < at_ns(END_S))
    return sorted(kept, key=lambda each: (each[1].event_time_ns, each[0]))


def fused(heard: Heard, *, doubting: bool = False) -> TeamTracker:
    tracker = TeamTracker(TeamSettings(doubts=doubting))
    for node_id, message in heard:
        give(tracker, node_id, message)
    return tracker


def is_pass_of(dap_id: str, said: tuple[str, Message]) -> bool:
    return said[0] == dap_id and isinstance(said[1], RssiPeak)


def test_whom_a_dap_hears_while_it_is_carried_is_tied_to_nothing() -> None:
    clean = patrol(2).heard
    said = ("dap4", taken_up(TAKEN_S))
    before = [
        each
        for each in clean
        if not is_pass_of("dap4", each) or each[1].event_time_ns < at_ns(TAKEN_S)
    ]
    with_carrier = [
        ("dap4", RssiPeak(event_time_ns=at_ns(time_s), sequence=0, responder_id="r1",
                          peak_dbm=-38.0, width_s=2.0, sample_count=9))
        for time_s in (115.0, 130.0, 145.0, 160.0)
    ]  # fmt: skip
    silent = fused(in_order([*before, said]))
    told = fused(in_order([*before, said, *with_carrier]))
    assert "dap4" not in told.daps
    assert {"dap3", "dap5"} <= told.daps.keys()
    for name, estimate in silent.estimates.items():
        assert told.estimates[name].position == estimate.position
    assert told.afterwards().daps.keys() == told.daps.keys()


def test_once_it_lies_still_those_who_pass_it_find_it_and_nothing_is_doubted() -> None:
    faults = Faults(since_s=TAKEN_S, moved=("dap4", SPOT_M))
    heard = [
        each
        for each in patrol(2, faults).heard
        if not is_pass_of("dap4", each)
        or not at_ns(TAKEN_S) <= each[1].event_time_ns <= at_ns(LIES_S)
    ]
    said = [("dap4", taken_up(TAKEN_S)), ("dap4", taken_up(LIES_S, at_rest=True))]
    tracker = TeamTracker(TeamSettings())
    doubted: set[str] = set()
    for node_id, message in in_order([*heard, *said]):
        give(tracker, node_id, message)
        doubted |= {doubt.kind for doubt in tracker.doubts}
        if at_ns(TAKEN_S) <= message.event_time_ns <= at_ns(LIES_S) and node_id != "dap4":
            assert "dap4" not in tracker.daps or message.event_time_ns == at_ns(TAKEN_S)
    assert doubted == set()
    found = tracker.daps["dap4"]
    assert found.installed_ns == at_ns(LIES_S)
    place = found.position
    assert math.dist((place.north_m, place.east_m), SPOT_M) < 0.7


def test_set_down_again_it_stands_where_its_installer_does_however_late_that_is_heard() -> None:
    walk = [
        ("r1", stride(1.1 * n, 1.2, 0.0, sequence=n)) for n in range(1, 60)
    ]  # fmt: skip
    said: Heard = [
        ("r1", track_start(0.0)),
        *walk,
        ("d1", installation(11.05, "r1")),
        ("d1", taken_up(33.0)),
        ("d1", installation(44.05, "r1")),
    ]
    in_time = fused(in_order(said))
    late = fused([*in_order(said[:-1]), said[-1], ("r1", stride(70.0, 0.0, 0.0, sequence=70))])
    assert in_time.daps["d1"].position.north_m == pytest.approx(48.0, abs=1.0)
    assert late.daps["d1"].position.north_m == pytest.approx(48.0, abs=1.0)


def test_the_published_map_has_it_no_more_until_it_is_set_down_anew() -> None:
    daps = DapMap()
    daps.install("d1", installation(20.0, None, (1.0, 2.0)), lambda *_: None)
    assert daps.install("d1", taken_up(30.0), lambda *_: None) == "taken_up"
    assert "d1" not in daps
    old = installation(20.0, None, (1.0, 2.0))
    assert daps.install("d1", old, lambda *_: None) == "superseded"
    assert daps.install("d1", installation(40.0, None, (5.0, 2.0)), lambda *_: None) == "placed"


@pytest.mark.parametrize("method", ["published", "team"])
def test_the_commander_reads_that_it_stands_nowhere(method: FusionMethod) -> None:
    incident = Incident(IncidentSettings(fusion=FusionSettings(method=method)))
    now_ns = at_ns(0.0)
    for said in (installation(0.0, None, (1.0, 2.0)), taken_up(10.0)):
        now_ns = said.event_time_ns
        incident.handle(str(key_of("dap", "d1", DapInstallation)), encode(said), now_ns)
    incident.finish(now_ns)
    (row,) = make_roster(incident, now_ns, RosterSettings()).daps
    assert row.fault == "taken up, and nowhere until it is set down again"
    assert row.position is None
    assert incident.dap_places == {}
