"""What a unit tells of where its wearer is: whom they met, satellite fixes, a known point."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from edge_agent.contacts import ContactWatch
from edge_agent.cues import CueDesk, Overheard
from edge_agent.gnss import GnssGate, GnssReading, GnssSettings
from edge_agent.sources.simulated_cues import simulated_cues
from shared.bus.interface import Received
from shared.bus.memory import MemoryNetwork
from shared.messages import Contact, LocalPosition, Message, PositionFix
from shared.rssi_peaks import Peak, PeakSettings
from shared.sender import Sender
from shared.simulation.gnss import GnssReceiver
from shared.simulation.scenario import load_scenario
from shared.simulation.walker import simulate_walk
from shared.units import NS_PER_S
from tests.heard import message_in

START_NS = 1_700_000_000 * NS_PER_S
DOOR = LocalPosition(north_m=1.0, east_m=2.0, down_m=0.0, covariance_m2=(0.25, 0.0, 0.25))


def at(time_s: float) -> int:
    return START_NS + round(time_s * NS_PER_S)


def passing(time_s: float) -> float:
    """Return the signal of somebody met at 20 s, a metre away, at 2 m/s."""
    return float(-40.0 - 22.0 * np.log10(np.hypot(1.0, 2.0 * (time_s - 20.0))))


def said_by(cues: list[Overheard | GnssReading], stands_at: LocalPosition | None) -> list[Message]:
    """Return what a unit says of ``cues``, and of a minute after them."""
    heard: list[Received] = []
    network = MemoryNetwork()
    network.connect().subscribe("clew/**", heard.append)
    unit = CueDesk(Sender(network.connect(), "fire", "responder", "r1"), stands_at)
    for cue in cues:
        unit.take(cue)
    unit.pass_time(at(60.0))
    return [message_in(received) for received in heard]


def test_a_meeting_is_told_with_its_moment() -> None:
    times_s = np.arange(0.0, 40.0, 0.21).tolist()
    (met,) = said_by([Overheard(at(time_s), "r2", passing(time_s)) for time_s in times_s], None)
    assert isinstance(met, Contact)
    assert met.other_id == "r2"
    assert met.event_time_ns == pytest.approx(at(20.0), abs=0.1 * NS_PER_S)


def test_it_does_not_matter_when_the_time_is_told() -> None:
    outcomes = []
    for period_s in (0.05, 0.7, 3.0):
        watch = ContactWatch(PeakSettings())
        met: list[Peak] = []
        told_s = 0.0
        for time_s in np.arange(0.0, 40.0, 0.21).tolist():
            while told_s + period_s <= time_s:
                told_s += period_s
                met += watch.pass_time(at(told_s))
            met += watch.pass_time(at(time_s))
            watch.hear(at(time_s), "r2", passing(time_s))
        outcomes.append(met + watch.pass_time(at(60.0)))
    assert len(outcomes[0]) == 1
    assert outcomes[0] == outcomes[1] == outcomes[2]


def test_one_fix_a_second_is_told_with_what_it_is_worth() -> None:
    cues = [GnssReading(at(0.2 * number), 5.0, -3.0, 0.5, 3.0) for number in range(11)]
    fixes = [fix for fix in said_by([*cues], None) if isinstance(fix, PositionFix)]
    assert [fix.event_time_ns for fix in fixes] == [at(0.0), at(1.0), at(2.0)]
    assert [fix.sequence for fix in fixes] == [0, 1, 2]
    assert {(fix.responder_id, fix.source) for fix in fixes} == {("r1", "gnss")}
    place = fixes[0].position
    assert (place.north_m, place.east_m, place.down_m) == (5.0, -3.0, 0.5)
    assert place.covariance_m2 == (9.0, 0.0, 9.0)


@pytest.mark.parametrize(
    ("sd_m", "told_sd_m"), [(0.3, 2.0), (5.0, 5.0), (20.0, None), (np.nan, None)]
)
def test_a_fix_claims_no_more_than_it_holds(sd_m: float, told_sd_m: float | None) -> None:
    place = GnssGate(GnssSettings()).take(GnssReading(at(0.0), 0.0, 0.0, 0.0, sd_m))
    assert (None if place is None else place.covariance_m2[0] ** 0.5) == told_sd_m


def test_a_clock_that_is_set_back_does_not_stop_the_fixes() -> None:
    gate = GnssGate(GnssSettings())
    told = [gate.take(GnssReading(at(time_s), 0.0, 0.0, 0.0, 3.0)) for time_s in (100.0, 0.0, 0.5)]
    assert [place is not None for place in told] == [True, True, False]


def test_a_known_point_is_told_once_as_time_begins() -> None:
    (fix,) = said_by([Overheard(at(3.0), "r2", -80.0)], DOOR)
    assert isinstance(fix, PositionFix)
    assert (fix.source, fix.position, fix.event_time_ns) == ("known_point", DOOR, at(3.0))


def test_a_scenario_with_receivers_gives_fixes_near_the_truth() -> None:
    scenario = load_scenario("corridor")
    outdoors = msgspec.structs.replace(scenario, gnss=GnssReceiver(until_m=100.0))
    assert not any(isinstance(cue, GnssReading) for cue in simulated_cues(scenario, "r1", 1))
    cues = list(simulated_cues(outdoors, "r1", 1))
    assert [cue.time_ns for cue in cues] == sorted(cue.time_ns for cue in cues)
    fixes = [cue for cue in cues if isinstance(cue, GnssReading)]
    body = simulate_walk(outdoors, "r1", 1).body
    true_m, _ = body.at(np.array([fix.time_ns / NS_PER_S for fix in fixes]))
    error_m = np.array([[fix.north_m, fix.east_m] for fix in fixes]) - true_m[:, :2]
    assert 15 <= len(fixes) <= 30
    assert np.all(np.abs(error_m) < 4.0 * np.array([fix.sd_m for fix in fixes])[:, None])
